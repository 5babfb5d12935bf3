/* CPUs in QEMU: records are kept in RAM until the test reads them in machine_done(). Linked with --wrap=hal_idle. */
#include "../../model/interpreter.h"

#include "hal_board.h"
#include "kernel.h"

volatile uint16 wanted_records, recorded; /* the test writes the first */
record records[MOST_RECORDS];
static uint16 idles;
static void (*isr)(void);

void machine_init(void);
void machine_done(void);
void __real_hal_idle(const volatile uint16_t *pending);
void __wrap_hal_idle(const volatile uint16_t *pending);

static void mask_interrupts(void); /* until hal_idle() ends; a masked interrupt still ends the sleep */

HAL_OUTLINE void machine_done(void)
{
    (void)hal_lock_devices();
    for (;;) {
        __asm__ volatile("" ::: "memory");
    }
}

void machine_record(const record *r)
{
    records[recorded] = *r;
    if (++recorded == wanted_records) {
        machine_done();
    }
}

/* Only machine_tick() advances the clock. If the CPU took that tick before it sleeps, and the kernel had no work then, no
 * other interrupt would end the sleep. */
void __wrap_hal_idle(const volatile uint16_t *pending)
{
    if (++idles == MOST_IDLES) {
        machine_done();
    }
    if ((*pending & OS_WORK) == 0) {
        mask_interrupts();
        machine_tick();
    }
    __real_hal_idle(pending);
}

void boundaries_isr(void)
{
    isr();
}

void machine_init(void)
{
    inject_init();
}

/* Restarts the slice at each tick, so that only machine_slice() ends it. */
static void restore_slice(void)
{
    if (!hal_slice_is_over()) {
        cpu_slice_ms = CPU_SLICE_MS;
    }
}
