/* dsPIC30F: the device is INT1. The test reads each record in machine_record(), and sets the clock's flag in hal_idle(). */
#include "../../../model/interpreter.h"

#include "hal_board.h"
#include "kernel.h"
#include "openswarm_interrupt.h"

static void (*isr)(void);

void machine_init(void);

HAL_OUTLINE void machine_record(const record *r)
{
    __asm__ volatile("" ::"r"(r) : "memory");
}

static void on_interrupt(void)
{
    isr();
}
SYS_INTERRUPT(INT1, 4, on_interrupt)

void machine_init(void)
{
    Sys_Enable_Interrupt(INT1);
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

void machine_interrupt(void (*wanted)(void))
{
    isr = wanted;
    Sys_Raise_Interrupt(INT1);
    __asm__ volatile("nop\n\tnop");
}
