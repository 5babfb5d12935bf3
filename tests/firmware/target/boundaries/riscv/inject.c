/* The real-time clock's alarm, an otherwise unused interrupt. The harness requests it from outside: the CPU, stopped at a
 * boundary, executes one store of an alarm that is past. */
#include "../boundaries.h"
#include "interrupts.h"
#include "registers.h"

#define RTC_IRQ_ENABLED REGISTER(0x00101010)
#define RTC_CLEAR_INTERRUPT REGISTER(0x0010101C)

/* The harness executes only the first instruction (firmware/tools/simulated/qemu.py). */
__attribute__((naked, noinline, used)) static void inject_store(volatile uint32_t *address, uint32_t value)
{
    (void)address, (void)value;
    __asm__ volatile("sw a1, 0(a0)\n\tret");
}

static void alarm(void)
{
    RTC_CLEAR_INTERRUPT = 1;
    boundaries_isr();
}

void inject_init(void)
{
    interrupts_connect(SOURCE_RTC, alarm);
    inject_store(&RTC_IRQ_ENABLED, 1);
}
