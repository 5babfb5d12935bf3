/* Runs one program of model/, which the test writes into `program`. The timers are stopped: the clock ticks when the
 * kernel idles. The folder of each port has the rest of the machine. */
#include "../../model/interpreter.c"

volatile uint16 port_sizes[SIZES]; /* for the test */
#ifndef PROGRAM_BYTES
#define PROGRAM_BYTES 600
#endif
volatile uint8 program[PROGRAM_BYTES];
static uint8 skipped_allocations, failing_allocations;
static uint8 unlocks_left; /* calls of hal_unlock() until isr_at_unlock runs; 0: it does not run */
static void (*isr_at_unlock)(void);

void machine_init(void);

bool machine_allocation_fails(void)
{
    if (skipped_allocations != 0) {
        skipped_allocations--;
        return false;
    }
    return failing_allocations != 0 && failing_allocations-- != 0;
}

void machine_fail(uint8 skip, uint8 count)
{
    skipped_allocations = skip;
    failing_allocations = count;
}

/* Instead of the port's hal_unlock() (within_calls.h). */
HAL_OUTLINE void machine_unlock(hal_lock_state before)
{
    (hal_unlock)(before);
    hal_lock_state lock = hal_lock_devices();
    bool is_last = unlocks_left != 0 && --unlocks_left == 0;
    (hal_unlock)(lock);
    if (is_last) {
        machine_interrupt(isr_at_unlock);
    }
}

void machine_interrupt_at_unlock(uint8 n, void (*isr)(void))
{
    isr_at_unlock = isr;
    unlocks_left = n;
}

__attribute__((noinline, used)) void machine_ready(void) /* the test writes the program here */
{
    __asm__ volatile("" ::: "memory");
}

int main(void)
{
    for (uint8 i = 0; i < SIZES; i++) {
        port_sizes[i] = interpreter_sizes[i];
    }
    machine_ready();
    machine_init();
    interpreter_load((const uint8 *)program);
    interpreter_main();
}
