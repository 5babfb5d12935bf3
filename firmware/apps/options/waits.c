/* Scenes of the options that wait without losing a wake-up, of timers, and of reset causes. README.md. */
#include "options.h"

#include <openswarm_notification.h>
#include <openswarm_reset.h>
#include <openswarm_semaphore.h>
#include <openswarm_timer.h>

sys_semaphore options_semaphore __attribute__((used)) = SYS_SEMAPHORE(0);
sys_notification options_notification __attribute__((used));
sys_timer options_timer __attribute__((used));
static sys_timer other_timers[2];

/* Calls go through these pointers, so that the compiler inlines no function, as in a program with many calls. */
static bool (*volatile signal)(sys_semaphore *) = Sys_Signal_Semaphore;
static bool (*volatile take)(sys_semaphore *) = Sys_Wait_for_Semaphore;
static void (*volatile notify)(sys_notification *, uint16) = Sys_Notify;
static void (*volatile notify_value)(sys_notification *, uint16, uint16) = Sys_Notify_Value;
static uint16 (*volatile take_bits)(sys_notification *, uint16, uint16) = Sys_Wait_for_Notification;
static bool (*volatile start_timer)(sys_timer *, uint16, uint16, uint16, uint16) = Sys_Start_Timer;
static bool (*volatile stop_timer)(sys_timer *) = Sys_Stop_Timer;

static const sys_reset_cause *(*volatile reset_cause)(void) = Sys_Get_ResetCause;
static bool (*volatile start_watchdog)(void) = Sys_Start_HardwareWatchdog;

static void wait_for_post(void *bits)
{
    if (bits != NULL) {
        (void)take_bits(&options_notification, 1, 0);
    } else {
        (void)take(&options_semaphore);
    }
    options_woken();
    for (;;) {
        Sys_Sleep(60000);
    }
}

/* Starts the thread that waits, or the one that runs next. */
static void start_other(uint16 scene)
{
    static sys_process_config waiter = {wait_for_post, NULL, 0, 3, 0, 0, 0};
    if (scene == SIGNAL_ONE_WAITS || scene == NOTIFY_ONE_WAITS) {
        waiter.arg = scene == NOTIFY_ONE_WAITS ? &waiter : NULL;
        (void)Sys_Start_ProcessWith(&waiter);
    } else if (scene == TAKE_NONE || scene == TAKE_NO_BITS) {
        (void)Sys_Start_ProcessWith(&options_spinner);
    } else if (scene == TAKE || scene == TAKE_BITS) {
        (void)signal(&options_semaphore);
        notify_value(&options_notification, 1, 1);
    }
}

static void with_post(uint16 scene)
{
    start_other(scene);
    options_settle();
    if (scene != SIGNAL_ONE_WAITS && scene != NOTIFY_ONE_WAITS) {
        Sys_Set_Scheduler(&sys_round_robin);
    }
    options_ready();
    if (scene == TAKE || scene == TAKE_NONE) {
        (void)take(&options_semaphore);
    } else if (scene == TAKE_BITS || scene == TAKE_NO_BITS) {
        (void)take_bits(&options_notification, 1, 0);
    } else if (scene < TAKE_BITS) {
        (void)signal(&options_semaphore);
    } else {
        notify(&options_notification, 1);
    }
}

static void with_timer(uint16 scene)
{
    if (scene == STOP_TIMER || scene == STOP_TIMER_BEHIND_TWO) {
        (void)start_timer(&options_timer, OPTIONS_EVENT, 0, 30000, 0);
    }
    for (uint16 i = 0; i < 2 && (scene == START_TIMER_BESIDE_TWO || scene == STOP_TIMER_BEHIND_TWO); i++) {
        (void)start_timer(&other_timers[i], OPTIONS_EVENT, 0, 30000, 0);
    }
    if (scene == TICK_TIMER) {
        (void)Sys_Register_Event(OPTIONS_EVENT);
        (void)start_timer(&options_timer, OPTIONS_EVENT, 0, 1, 1);
        options_settle();
        options_ready();
        Sys_Sleep(60000);
    }
    options_settle_under_round_robin();
    options_ready();
    if (scene == STOP_TIMER || scene == STOP_TIMER_BEHIND_TWO) {
        (void)stop_timer(&options_timer);
    } else {
        (void)start_timer(&options_timer, OPTIONS_EVENT, 0, 30000, 0);
    }
}

void options_waits(uint16 scene)
{
    if (scene >= RESET_CAUSE) {
        options_settle_under_round_robin();
        options_ready();
        (void)(scene == RESET_CAUSE ? reset_cause() != NULL : start_watchdog());
    } else if (scene < START_TIMER) {
        with_post(scene);
    } else {
        with_timer(scene);
    }
}
