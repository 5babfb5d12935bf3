/* Variables that a measuring program on the host sets, and its breakpoints. README.md lists the scenes. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include <openswarm.h>

enum { OPTIONS_EVENT = SYS_FIRST_USER_EVENT, OPTIONS_ELSEWHERE, OPTIONS_NEIGHBOUR = SYS_FIRST_USER_EVENT + 8 };

/* emu/kernel_metrics/suite/options.py has the same names in the same order. */
enum {
    LOCK, LOCK_SECOND, LOCK_TAKEN, UNLOCK, UNLOCK_SECOND, UNLOCK_ONE_WAITS, UNLOCK_TWO_WAIT,
    UNLOCK_SECOND_ONE_WAITS, UNLOCK_PRIORITIES, UNLOCK_TO_BETTER, START, START_JOINABLE, JOIN_ZOMBIE, JOIN_LIVING, END, END_JOINED,
    PUSH, PUSH_BEHIND_TWO, POP, POP_AND_RUN, POP_BEHIND_TWO, END_CLEANED,
    LIMIT, SEND, SEND_LIMITED, SEND_LIMITED_BEHIND_FOUR, SEND_DROPPED, SEND_REPLACED, SEND_SECOND_QUOTA, SEND_NEIGHBOUR,
    SEND_ELSEWHERE,
    START_SERVICE, FEED, FEED_BEHIND_TWO, TICK, TICK_SERVICE,
    TAKE, TAKE_NONE, SIGNAL, SIGNAL_ONE_WAITS, TAKE_BITS, TAKE_NO_BITS, NOTIFY, NOTIFY_ONE_WAITS,
    START_TIMER, START_TIMER_BESIDE_TWO, STOP_TIMER, STOP_TIMER_BEHIND_TWO, TICK_TIMER,
    RESET_CAUSE, START_WATCHDOG
};

extern volatile uint16 options_wanted;

void options_settle(void);                   /* waits until the next tick and the end of the slice are far */
void options_settle_under_round_robin(void); /* the same, then selects round robin, which is never eager */
void options_waits(uint16 scene);            /* waits.c: the scenes from TAKE on */
extern const sys_process_config options_spinner;

void options_begin(void); /* the measuring host stops here and sets options_wanted */
void options_ready(void); /* the host stops here: the measured call is next, and no interrupt is due */
void options_done(void);  /* the host stops here: the call has returned */
void options_woken(void); /* the host stops here: the call of the waiting thread has returned, too */
void options_spin(void);  /* entry of a thread that runs for ever */

#endif
