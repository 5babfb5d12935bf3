/* SPDX-License-Identifier: MIT */
/* Software timers (openswarm_timer.h). They share the alarm of the threads' time-outs. */
#include "kernel.h"
#include "openswarm_timer.h"

enum { LONGEST = 32767 }; /* ms: a timer is due if the time passed it by no more */

static sys_timer *timers; /* running ones; slice locked */

/* Takes a timer off the list; false: it does not run. Slice locked. */
BOUNDS_AT("for (", loop r);
static bool stop(const sys_timer *t)
{
    for (sys_timer **link = &timers; *link != NULL; link = &(*link)->next) {
        if (*link == t) {
            *link = t->next;
            return true;
        }
    }
    return false;
}

/* Kernel stack: sends the events of the timers that are due. */
BOUNDS_AT("for (", loop r, one);
static void expire(void)
{
    uint16 now = clock_now();
    for (sys_timer **link = &timers; *link != NULL;) {
        sys_timer *t = *link;
        uint16 late = (uint16)(now - t->due);
        if (late <= LONGEST) {
            event_announce(t->event, t->value);
            if (t->period == 0) {
                *link = t->next;
                continue;
            }
            t->due = (uint16)(t->due + t->period);
            if (late >= t->period) {
                t->due = (uint16)(t->due + late / t->period * t->period);
            }
        }
        clock_set_alarm(t->due);
        link = &t->next;
    }
}

bool Sys_Start_Timer(sys_timer *t, uint16 event, uint16 value, uint16 first_ms, uint16 period_ms)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (first_ms == 0 || first_ms > LONGEST || period_ms > LONGEST) {
        return os_leave(SYS_ERROR_ARGUMENT);
    }
    (void)stop(t);
    os_expire_timers = expire;
    *t = (sys_timer){NULL, event, value, clock_set_alarm_in(first_ms), period_ms};
    t->next = timers;
    timers = t;
    return os_leave(SYS_OK);
}

bool Sys_Stop_Timer(sys_timer *t)
{
    if (os_enter() != SYS_OK) {
        return false;
    }
    return os_leave(stop(t) ? SYS_OK : SYS_ERROR_PROCESS);
}
