/* Runs one program of model/, which the test writes into `program`. The timers stand still: the clock ticks when the kernel
 * idles. The folder of each port has the rest of the machine. */
#include "../../model/interpreter.c"

volatile uint16 port_sizes[SIZES]; /* for the test */
volatile uint8 program[600];

void machine_init(void);

/* Programs for a robot call neither of these. */
void machine_interrupt_at_unlock(uint8 n, void (*wanted)(void))
{
    (void)n, (void)wanted;
}

void machine_fail(uint8 skip, uint8 count)
{
    (void)skip, (void)count;
}

HAL_OUTLINE void machine_ready(void) /* the test writes the program here */
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
