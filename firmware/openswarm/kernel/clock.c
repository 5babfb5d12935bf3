/* SPDX-License-Identifier: MIT */
/* System time, the 1 ms event and time-outs.
 *
 * os_clock_tick() compares the time with one alarm per tick. Only when the alarm expires does the kernel stack scan the
 * blocked threads. Times are low words of the system time, ordered by their distance from base, the time of the last
 * scan. An alarm that is not later than base expires one wrap later and wakes no thread. */
#include "kernel.h"

LINKS_IN_RAM();

static volatile uint16 now_ms, wraps; /* low and high word of the system time */
static uint16 base;
static uint16 alarm;

uint32 Sys_Get_SystemTime(void)
{
    hal_lock_state lock = hal_lock_devices();
    uint32 now = (uint32)wraps << 16 | now_ms;
    hal_unlock(lock);
    return now;
}

uint16 clock_now(void)
{
    return HAL_LOAD(now_ms);
}

void os_clock_tick(void)
{
    uint16 now = (uint16)(now_ms + 1u);
    now_ms = now;
    if (now == 0) {
        wraps++;
    }
    if (now == alarm) {
        os_pending |= OS_ALARM;
    }
    if (os_watch != NULL || os_feed != NULL) {
        os_pending |= OS_WATCH;
    }
    if (OS_HAS_WORK) {
        os_preempt();
    }
    uint8 error = os_errors.isrs;
    (void)Sys_Send_IntEvent(SYS_1ms_TIMER, now);
    os_errors.isrs = error; /* a failure is no error of the application's ISRs */
    board_tick();
}

HAL_OUTLINE void clock_set_alarm(uint16 moment)
{
    uint16 distance = (uint16)(moment - base); /* at least 1 */
    hal_lock_state lock = hal_lock_devices();
    if ((uint16)(distance - 1u) < (uint16)(alarm - base - 1u)) {
        alarm = moment;
        if ((uint16)(now_ms - base) >= distance) { /* the tick overtook the caller */
            os_pending |= OS_ALARM;
        }
    }
    hal_unlock(lock);
}

/* Wakes the threads whose time-out has expired and sets the alarm to the next one. Slice locked. */
BOUNDS_AT("for (", loop n);
void clock_wake_due(void)
{
    uint16 now = clock_now();
    uint16 elapsed = (uint16)(now - base);
    sys_pcb *next;
    base = now;
    for (sys_pcb *p = os_blocked; p != NULL; p = next) {
        next = p->next;
        if (!(p->status & OS_TIMED)) {
            continue;
        }
        if ((uint16)(p->time_or_error.wake - now + elapsed) <= elapsed) {
            process_wake(p, NULL);
        } else {
            clock_set_alarm(p->time_or_error.wake);
        }
    }
}

void clock_set_wake(sys_pcb *process, uint16 ms)
{
    clock_wake_due(); /* sets base to the present time, so that a time-out may be 65,535 ms long */
    process->time_or_error.wake = (uint16)(base + ms);
    process->status |= OS_TIMED;
    clock_set_alarm(process->time_or_error.wake);
}

uint16 clock_set_alarm_in(uint16 ms) /* not a part of clock_set_wake(), which needs the stack */
{
    clock_wake_due();
    uint16 moment = (uint16)(base + ms);
    clock_set_alarm(moment);
    return moment;
}
