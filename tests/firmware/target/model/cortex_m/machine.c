/* Cortex-M: the device is EXTI0 (target/boundaries). */
#include "../../boundaries/cortex_m/inject.c"
#include "../in_qemu.h"

#define SCB_ICSR_PENDSTSET (1u << 26)

static void request(volatile uint32_t *address, uint32_t bit)
{
    *address = bit;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

static void mask_interrupts(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

void machine_start(void)
{
    board_start();
    hal_start();
    SYST_CSR = 2; /* stopped; its interrupt stays enabled */
    section_start();
}

void machine_tick(void)
{
    restore_slice();
    request(&SCB_ICSR, SCB_ICSR_PENDSTSET);
}

void machine_slice(void)
{
    cpu_slice_ms = 0;
    request(&SCB_ICSR, SCB_ICSR_PENDSVSET);
}

void machine_interrupt(void (*wanted)(void))
{
    isr = wanted;
    request(&NVIC_ISPR(EXTI0), NVIC_BIT(EXTI0));
}
