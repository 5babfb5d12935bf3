/* SPDX-License-Identifier: MIT */
/* Remote control receiver on RF6/INT0, idle high (epuck.md §2): both edges, timed by the 1 ms clock T1. */
#include "hal_remote.h"
#include "kernel.h"
#include "openswarm_interrupt.h"

enum { MS_TCY = 14746 /* 14,745.6; no distance is longer than 2 ms */, JUST_BEGUN = MS_TCY / 2 };

/* The clock's interrupt has this level, too: its flag may be pending after TMR1 has restarted at 0. */
static uint32_t now(void)
{
    uint16_t ticks = TMR1, ms = clock_now();
    if (IFS0bits.T1IF && ticks < JUST_BEGUN) {
        ms++;
    }
    return (uint32_t)ms * MS_TCY + ticks;
}

static void edge(void)
{
    uint32_t ticks = now();
    bool falling = INTCON2bits.INT0EP;
    INTCON2bits.INT0EP = !falling;
    IFS0bits.INT0IF = 0; /* a change of polarity may set it */
    remote_edge(falling, ticks);
}
SYS_INTERRUPT(INT0, 4, edge)

void hal_remote_start(void)
{
    INTCON2bits.INT0EP = 1;
    Sys_Enable_Interrupt(INT0);
}
