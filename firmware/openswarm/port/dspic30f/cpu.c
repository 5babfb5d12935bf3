/* SPDX-License-Identifier: MIT */
/* dsPIC30F port of hal_cpu.h: timers, first frames. The rest is in switch.S and hal_port.h. */
#include "kernel.h"

/* 1 ms is 14,745.6 Tcy at 14.7456 MHz: five periods are exactly 5 ms (README.md). */
#define PR(period) ((period) - 1u)
enum { SLICE_PERIOD = 18432 /* counts of 8 Tcy: 10 ms */ };

/* Assumptions of switch.S. */
HAL_ASSUME(pcb_begins_so, offsetof(sys_pcb, sp) == 0 && offsetof(sys_pcb, limit) == 2 && offsetof(sys_pcb, status) == 8);
HAL_ASSUME(sizes_and_bits, sizeof(sys_pcb) == 18 && SYS_DSP == 1 << 4 && SYS_READY == 1);
HAL_ASSUME(kernel_stack_is_the_ports, SYS_KERNEL_STACK == HAL_KERNEL_STACK);

extern void os_resume_yielded(void), os_thread_start(void);
COMES_BACK(hal_yield, 0);
COMES_BACK(hal_block, 0);
RESUMED_BY(os_resume_yielded, switch.S / resume_preempted, switch.S / resume_dsp);
LOOPS_OF(switch.S / resume_dsp, 0);
STACK_AREA(os_memory, HAL_KERNEL_STACK);
THREADS(sys_function);
KNOWN_VALUE(CORCON, 0x0024); /* no DO loop is open; each open one adds 10 bytes and 21 Tcy to a SYS_DSP frame */
INTERRUPT_LEVEL(T2, 1);
INTERRUPT_LEVEL(C2, 1);
LINKS_IN_RAM(switch.S);
OUTSIDE_ONLY(T2, C2); /* the kernel runs at their level */
HIGHEST_LEVEL(4, openswarm/kernel, openswarm/option, openswarm/io, openswarm/board);
static volatile sint16 clock_phase; /* delay of the clock in fifths of a cycle */

HAL_USED void cpu_clock_isr(void)
{
    IFS0bits.T1IF = 0;
    PR1 = PR(14745); /* of the period that has just begun */
    clock_phase = (sint16)(clock_phase + 3);
    if (clock_phase > 0) {
        PR1 = PR(14746);
        clock_phase = (sint16)(clock_phase - 5);
    }
    os_clock_tick();
}

void hal_init(sys_pcb *process)
{
    process->limit = SPLIM;
    CPU_SRL |= CPU_IPL_SLICE;
}

void hal_start(void)
{
    PR1 = PR(14745); /* after a reset both timers are 0, T1's flag is clear and its priority is 4 (dspic30f6014a.md §5) */
    PR2 = PR(SLICE_PERIOD);
    IPC1bits.T2IP0 = IPC9bits.C2IP0 = 1; /* 4 becomes 1 */
    IPC1bits.T2IP2 = IPC9bits.C2IP2 = 0;
    T2CON = 0x8010; /* on, 1:8 */
    T1CON = 0x8000; /* on, 1:1 */
    IEC0bits.T1IE = 1;
    IEC0bits.T2IE = 1;
    IEC2bits.C2IE = 1;
}

/* Frame of a yielded thread (switch.S) that returns into os_thread_start with W8 = entry, W9 = argument. */
bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    uint16 *frame = (uint16 *)(void *)stack;
    (void)bytes;
    *frame++ = (uint16)os_thread_start;
    *frame++ = 0;
    *frame++ = (uint16)entry;
    *frame++ = (uint16)arg;
    frame += 5; /* W10-W14 */
    *frame++ = (uint16)os_resume_yielded;
    process->sp = frame;
    process->limit = (uint16)process - HAL_STACK_GUARD - 2u; /* last writable word */
    return true;
}

HAL_OUTLINE void hal_stop(void)
{
    RCONbits.SWDTEN = 0;
    IEC0 = IEC1 = IEC2 = INTCON1 = 0; /* no interrupt wakes the CPU again: the robot stops, an emulated run ends */
    for (;;) {
        __asm__ volatile("pwrsav #1");
    }
}
