/* SPDX-License-Identifier: MIT */
/* Selector: a position is accepted after DEBOUNCE_MS of equal readings (openswarm-original.md §5.7: 25 ms). */
#include "hal_cpu.h"
#include "io.h"

enum { DEBOUNCE_MS = 25, NONE = 0xFF };

static sys_selector_processor processor;
static uint8 accepted, candidate, equal_ms;

static bool pass_unchanged(uint8 *position)
{
    (void)position;
    return true;
}

void selector_init(void)
{
    processor = pass_unchanged;
    candidate = NONE;
    hal_selector_init();
    accepted = hal_selector_read();
    (void)Sys_Register_Event(SYS_IO_SELECTOR);
}

BOUNDS_AT("processor(&position)", calls sys_selector_processor);
void selector_tick(void)
{
    uint8 position = hal_selector_read();
    if (position != candidate) {
        candidate = position;
        equal_ms = 0;
    }
    if (equal_ms < DEBOUNCE_MS) {
        equal_ms++;
    } else if (position != accepted) {
        accepted = position;
        if (processor(&position)) {
            (void)Sys_Send_Event(SYS_IO_SELECTOR, &position, sizeof position);
        }
    }
}

sys_selector_processor Sys_Set_SelectorProcessor(sys_selector_processor wanted)
{
    sys_selector_processor before = processor;
    HAL_STORE(processor, wanted != NULL ? wanted : pass_unchanged);
    return before;
}

uint8 Sys_Get_Selector(void)
{
    return accepted;
}
