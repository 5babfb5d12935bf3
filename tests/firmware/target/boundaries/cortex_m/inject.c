/* EXTI0, an otherwise unused interrupt: a vector table in RAM routes it to the test. The harness sets it pending from
 * outside: the CPU, stopped at a boundary, executes one store. */
#include "../boundaries.h"
#include "registers.h"

enum { EXTI0 = 6, VECTORS = 16 + 82, DEVICE = 0x50 };
#define SCB_VTOR REGISTER(0xE000ED08)

/* The harness executes only the first instruction (firmware/tools/simulated/qemu.py). */
__attribute__((naked, noinline)) static void inject_store(volatile uint32_t *address, uint32_t value)
{
    (void)address, (void)value;
    __asm__ volatile("str r1, [r0]\n\tbx lr");
}

void inject_init(void)
{
    static uint32_t table[VECTORS] __attribute__((aligned(512)));
    const uint32_t *flash = (const uint32_t *)SCB_VTOR;
    for (uint16 i = 0; i < VECTORS; i++) {
        table[i] = flash[i];
    }
    table[16 + EXTI0] = (uint32_t)boundaries_isr;
    SCB_VTOR = (uint32_t)table;
    NVIC_IPR(EXTI0) = DEVICE;
    inject_store(&NVIC_ISER(EXTI0), NVIC_BIT(EXTI0));
}
