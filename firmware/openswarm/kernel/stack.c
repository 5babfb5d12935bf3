/* SPDX-License-Identifier: MIT */
/* Unused stack: stacks are painted before their first use; the paint left at the far end was never used.
 *
 * Stacks grow upwards, away from the start of their block, unless the port defines HAL_STACK_GROWS_DOWN. */
#include "kernel.h"

enum { PAINT = 0xA5 };

LOOPS_OF(stack_paint, k / 2 - 1);
HAL_OUTLINE void stack_paint(void *begin, const void *end)
{
    volatile uint16 *word = begin; /* volatile: else the compiler calls memset, which is larger */
    do {
        *word++ = PAINT * 0x101u;
    } while (word != end);
}

/* Returns the painted bytes at the far end of a stack. */
BOUNDS_AT("p[-1] == PAINT", loop u);
static uint16 unused(const uint8 *stack, uint16 bytes)
{
#ifdef HAL_STACK_GROWS_DOWN
    const uint8 *p = stack;
    while (p != stack + bytes && *p == PAINT) {
        p++;
    }
    return (uint16)(p - stack);
#else
    const uint8 *p = stack + bytes;
    while (p != stack && p[-1] == PAINT) {
        p--;
    }
    return (uint16)(stack + bytes - p);
#endif
}

/* The guard at the end of a thread's stack does not count: it belongs to the port. */
uint16 Sys_Get_UnusedStack(uint16 pid)
{
    uint16 bytes = 0;
    if (os_enter() != SYS_OK) {
        return 0;
    }
    const sys_pcb *p = process_find(pid);
    if (p != NULL && p->block != NULL) {
        const uint8 *stack = p->block + ((p->status & SYS_PERIODIC) ? sizeof(periodic) : 0);
#ifdef HAL_STACK_GROWS_DOWN
        stack += HAL_STACK_GUARD;
        bytes = unused(stack, (uint16)((const uint8 *)p - stack));
#else
        bytes = unused(stack, (uint16)((const uint8 *)p - stack - HAL_STACK_GUARD));
#endif
    }
    section_close();
    return bytes;
}

uint16 Sys_Get_UnusedKernelStack(void)
{
    return unused(os_memory.bytes, SYS_KERNEL_STACK - HAL_KERNEL_STACK_GUARD);
}

bool kernel_stack_is_intact(void)
{
#ifdef HAL_STACK_GROWS_DOWN
    return os_memory.bytes[0] == PAINT;
#else
    return os_memory.bytes[SYS_KERNEL_STACK - 1] == PAINT;
#endif
}
