/* RISC-V: the device is the real-time clock's alarm (target/boundaries). */
#include "../../boundaries/riscv/inject.c"
#include "../in_qemu.h"

#define RTC_ALARM_LOW REGISTER(0x00101008)

static void mask_interrupts(void)
{
    (void)CSR_CLEAR(mstatus, MSTATUS_MIE);
}

/* The port computes the first tick from a time far in the future: only machine_tick() makes one due. */
void machine_start(void)
{
    board_start();
    REGISTER(CLINT_MTIME + 4) = 1u << 30;
    hal_start();
    REGISTER(CLINT_MTIME + 4) = 0;
    section_start();
}

void machine_tick(void)
{
    restore_slice();
    REGISTER(CLINT_MTIMECMP) = 0;
    REGISTER(CLINT_MTIMECMP + 4) = 0;
}

void machine_slice(void)
{
    cpu_slice_ms = 0;
    REGISTER(CLINT_MSIP) = 1;
}

void machine_interrupt(void (*wanted)(void))
{
    isr = wanted;
    RTC_ALARM_LOW = 0;
}
