/* SPDX-License-Identifier: MIT */
/* Clock of the e-puck2, set from the reset handler, and the mode of its pins. */
#include "kernel.h"
#include "pins.h"
#include "stm32f407.h"

enum { PATIENCE = 100000 };

static bool wait_for(uint32_t flag)
{
    for (uint32_t i = 0; i < PATIENCE; i++) {
        if (RCC_CR & flag) {
            return true;
        }
    }
    return false;
}

/* 24 MHz crystal, / 24 * 336 / 2 = 168 MHz; APB1 42 MHz, its timers 84. QEMU runs at 168 MHz by itself and models
 * neither crystal nor PLL: their flags are never set, so the wait is bounded. */
HAL_USED void board_clock(void)
{
    RCC_CR |= RCC_CR_HSEON;
    if (!wait_for(RCC_CR_HSERDY)) {
        return;
    }
    RCC_PLLCFGR = 24u | 336u << 6 | 0u << 16 | RCC_PLLCFGR_HSE | 7u << 24;
    RCC_CR |= RCC_CR_PLLON;
    if (!wait_for(RCC_CR_PLLRDY)) {
        return;
    }
    FLASH_ACR = FLASH_ACR_5_WAITS_AND_CACHES;
    RCC_CFGR = RCC_CFGR_APB1_BY_4 | RCC_CFGR_APB2_BY_2 | RCC_CFGR_PLL;
}

void pins_set_mode(uint32_t port, uint32_t pins, uint32_t mode)
{
    uint32_t moder = GPIO_MODER(port);
    for (uint32_t pin = 0; pin < 16; pin++) {
        if (pins >> pin & 1u) {
            moder = (moder & ~(3u << 2 * pin)) | mode << 2 * pin;
        }
    }
    GPIO_MODER(port) = moder;
}
