/* SPDX-License-Identifier: MIT */
/* AVR port of hal_cpu.h: timers, first frames. The rest is in switch.S and hal_port.h. */
#include "kernel.h"

#include <avr/interrupt.h>
#include <avr/sleep.h>

/* T1 runs freely at F_CPU / 8. The clock advances its compare register B; compare A and capture remain free. T0
 * counts a slice in steps of 1024 cycles, at 8 MHz 128 us: 9.86 to 9.98 ms, because the prescaler is never
 * restarted. */
enum { CLOCK_COUNTS = F_CPU / 8 / 1000, SLICE_COUNTS = F_CPU / 1024 / 100 };

/* Assumptions of switch.S. */
#define ASSUME(name, condition) typedef char name[(condition) ? 1 : -1]
ASSUME(pcb_begins_so, offsetof(sys_pcb, sp) == 0 && offsetof(sys_pcb, limit) == 2 && offsetof(sys_pcb, status) == 8);
ASSUME(ready_is_bit_0, SYS_READY == 1);
ASSUME(kernel_stack_is_the_ports, SYS_KERNEL_STACK == HAL_KERNEL_STACK);

extern void os_thread_start(void);
extern uint8 _end; /* first byte after the variables; the stack of main grows down towards it */

HAL_USED void cpu_clock_isr(void)
{
    do { /* more than once after a delay of a millisecond or more */
        OCR1B += CLOCK_COUNTS;
        os_clock_tick();
    } while ((sint16)(TCNT1 - OCR1B) >= 0);
}

HAL_USED void cpu_overflow(void) /* kernel stack */
{
    cli();
    os_trap(OS_STACK, 0, 0); /* the faulting program counter is unknown */
}

void hal_init(sys_pcb *process)
{
    process->limit = &_end;
    stack_paint(&_end, &_end + sizeof(uint16));
    GPIOR0 = 0;
    sei(); /* level slice; no interrupt is enabled yet */
}

void hal_start(void)
{
    cli();
    TCCR0A = 1 << WGM01; /* counts to OCR0A */
    TCCR0B = 1 << CS02 | 1 << CS00;
    OCR0A = SLICE_COUNTS - 1;
    TIMSK0 = 1 << OCIE0A;
    TCNT0 = 0;
    TIFR0 = 1 << OCF0A;
    TCCR1A = 0;
    TCCR1B = 1 << CS11;
    OCR1B = TCNT1 + CLOCK_COUNTS;
    TIFR1 = 1 << OCF1B;
    TIMSK1 |= 1 << OCIE1B;
    sei();
}

/* Frame of a yielded thread (switch.S) that returns into os_thread_start with r17:r16 = entry, r15:r14 = argument. */
bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    enum { R14 = 6, R15 = 5, R16 = 4, R17 = 3, RETURN_HIGH = 19, RETURN_LOW = 20 }; /* above sp */
    uint8 *sp = stack + bytes - 1 - RETURN_LOW;
    sp[RETURN_LOW] = (uint8)(uint16)os_thread_start;
    sp[RETURN_HIGH] = (uint8)((uint16)os_thread_start >> 8);
    sp[R16] = (uint8)(uint16)entry;
    sp[R17] = (uint8)((uint16)entry >> 8);
    sp[R14] = (uint8)(uint16)arg;
    sp[R15] = (uint8)((uint16)arg >> 8);
    process->sp = sp;
    process->limit = stack;
    return true;
}

__attribute__((noinline)) void hal_stop(void) /* tools recognise a fatal stop by it */
{
    cli(); /* no interrupt wakes the CPU again: the robot stops, a simulated run ends */
    SMCR = 1 << SM1 | 1 << SE;
    for (;;) {
        sleep_cpu();
    }
}
