/* ATmega328P: the device is INT0. The test reads each record in machine_record(), and sets the flags of clock, slice and
 * device at the functions that it stops at. */
#include "../../boundaries/avr/inject.c"
#include "../../../model/interpreter.h"

#include "hal_board.h"
#include "kernel.h"

#define STOP __attribute__((noinline, noclone, used, externally_visible))

static void (*isr)(void);

void machine_init(void);
void machine_clock_due(void);
void machine_slice_due(void);
void machine_device_due(void);
void __real_hal_idle(const volatile uint16_t *pending);
void __wrap_hal_idle(const volatile uint16_t *pending);

STOP void machine_record(const record *r)
{
    __asm__ volatile("" ::"r"(r) : "memory");
}

STOP void machine_clock_due(void)
{
    __asm__ volatile("nop\n\tnop" ::: "memory");
}

STOP void machine_slice_due(void)
{
    __asm__ volatile("nop\n\tnop" ::: "memory");
}

STOP void machine_device_due(void)
{
    __asm__ volatile("nop\n\tnop" ::: "memory");
}

void boundaries_isr(void)
{
    isr();
}

void machine_init(void)
{
    inject_init();
}

void machine_start(void)
{
    board_start();
    hal_start();
    TCCR0B = TCCR1B = 0; /* the timers stand still */
    section_start();
}

/* The clock's interrupt counts one tick per 1,000 counts of T1 after its compare register. */
void machine_tick(void)
{
    OCR1B = TCNT1;
    machine_clock_due();
}

void machine_slice(void)
{
    machine_slice_due();
}

void machine_interrupt(void (*wanted)(void))
{
    isr = wanted;
    machine_device_due();
}

__attribute__((used, externally_visible)) void __wrap_hal_idle(const volatile uint16_t *pending)
{
    if ((*pending & OS_WORK) == 0) {
        (void)hal_lock_devices(); /* until hal_idle() sleeps */
        machine_tick();
    }
    __real_hal_idle(pending);
}
