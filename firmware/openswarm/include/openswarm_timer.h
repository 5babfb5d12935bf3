/* SPDX-License-Identifier: MIT */
/* Software timers, which send events. Linked only where used. Contract lines: openswarm.h.
 *
 *     static sys_timer blink, give_up;
 *     Sys_Start_Timer(&blink, BLINK, 0, 500, 500);        in 500 ms, then every 500 ms
 *     Sys_Start_Timer(&give_up, GIVE_UP, 0, 3000, 0);     once
 *
 * A timer sends its event between two threads, after the messages that wait there; it does not drift. If the kernel is
 * held back for more than a period, the missed periods are skipped. The event need not be registered yet when the timer
 * starts. A running timer costs nothing until it is due; sending takes 417 cycles. */
#ifndef OPENSWARM_TIMER_H
#define OPENSWARM_TIMER_H

#include "openswarm.h"

/* Private to the kernel, in static memory. */
typedef struct sys_timer {
    struct sys_timer *next;
    uint16 event, value;
    uint16 due, period;
} sys_timer;

/* MTH | no | 165; 180 with two running | 42 | ARGUMENT: first_ms not 1..32767, or period_ms not 0..32767.  Sends the
 * event with the value after first_ms and then every period_ms; period 0 = once. Restarts a running timer. */
bool Sys_Start_Timer(sys_timer *timer, uint16 event, uint16 value, uint16 first_ms, uint16 period_ms);
/* MTH | no | 89, 10 more per newer timer | 24 | PROCESS: it does not run.  The event of a timer that was due may still
 * wait in the queue. */
bool Sys_Stop_Timer(sys_timer *timer);

#endif
