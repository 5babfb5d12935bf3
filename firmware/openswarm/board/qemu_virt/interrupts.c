/* SPDX-License-Identifier: MIT */
/* Platform-level interrupt controller (PLIC), context 0: machine mode of the only hart. */
#include "interrupts.h"

#include "kernel.h"

#define PLIC_PRIORITY(source) REGISTER(PLIC_BASE + 4 * (source)) /* 0: never */
#define PLIC_ENABLE REGISTER(PLIC_BASE + 0x2000)
#define PLIC_CLAIM REGISTER(PLIC_BASE + 0x200004) /* read: source that is pending, or 0; write: it is served */

static void (*isrs[SOURCES])(void);

void interrupts_connect(uint32_t source, void (*isr)(void))
{
    isrs[source] = isr;
    PLIC_PRIORITY(source) = 1;
    PLIC_ENABLE |= 1u << source;
}

HAL_USED void board_interrupt(void)
{
    uint32_t source;
    while ((source = PLIC_CLAIM) != 0) {
        isrs[source]();
        PLIC_CLAIM = source;
    }
}
