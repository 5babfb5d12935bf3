/* Runs one program of model/ on the robot. The test writes it into `program` and reads each record in machine_record().
 * The timers stand still: the test lets the clock tick when the kernel idles. */
#include "../../model/interpreter.c"

#include "hal_board.h"
#include "openswarm_interrupt.h"

volatile uint16 port_sizes[SIZES]; /* for the test */
volatile uint8 program[600];
static void (*isr)(void);

HAL_OUTLINE void machine_record(const record *r)
{
    __asm__ volatile("" ::"r"(r) : "memory");
}

void machine_start(void)
{
    board_start();
    hal_start();
    T1CON = T2CON = 0;
    section_start();
}

void machine_tick(void)
{
    IFS0bits.T1IF = 1;
    __asm__ volatile("nop\n\tnop");
}

void machine_slice(void)
{
    IFS0bits.T2IF = 1;
    __asm__ volatile("nop\n\tnop");
}

static void on_interrupt(void)
{
    isr();
}
SYS_INTERRUPT(INT1, 4, on_interrupt)

void machine_interrupt(void (*wanted)(void))
{
    isr = wanted;
    Sys_Raise_Interrupt(INT1);
    __asm__ volatile("nop\n\tnop");
}

/* Programs for the robot call neither of these. */
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
    Sys_Enable_Interrupt(INT1);
    interpreter_load((const uint8 *)program);
    interpreter_main();
}
