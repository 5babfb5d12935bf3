/* Measures the kernel's options: the host runs one call per scene between two symbols (README.md). */
#include "hal_compiler.h"
#include "options.h"

#include <openswarm_cleanup.h>
#include <openswarm_join.h>
#include <openswarm_mutex.h>
#include <openswarm_quota.h>
#include <openswarm_service.h>

volatile uint16 options_wanted __attribute__((used));

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }

STOP(options_begin)
STOP(options_ready)
STOP(options_done)
STOP(options_woken)

__attribute__((noinline, used)) void options_spin(void)
{
    for (;;) {
        __asm__ volatile("nop" ::: "memory");
    }
}

/* One object of each kind, found by its name: its size is measured. */
sys_mutex options_mutex __attribute__((used)) = SYS_MUTEX(3);
sys_cleanup options_cleanup __attribute__((used));
sys_quota options_quota __attribute__((used));

sys_service options_service __attribute__((used)) = {.config = &options_spinner, .limit_ms = 30000, .restarts = SYS_ALWAYS};

static sys_mutex other_mutex = SYS_MUTEX(3);
static sys_cleanup other_cleanups[2];
static sys_quota other_quota;
static sys_service other_services[2] = {{.config = &options_spinner, .restarts = SYS_ALWAYS}, {.config = &options_spinner, .restarts = SYS_ALWAYS}};

/* Calls go through these pointers, so that the compiler inlines no function, as in a program with many calls. */
static bool (*volatile lock)(sys_mutex *) = Sys_Lock_Mutex;
static bool (*volatile unlock)(sys_mutex *) = Sys_Unlock_Mutex;
static uint16 (*volatile start)(const sys_process_config *) = Sys_Start_ProcessWith;
static uint16 (*volatile start_joinable)(const sys_process_config *) = Sys_Start_Joinable;
static bool (*volatile join)(uint16) = Sys_Join;
static bool (*volatile push)(sys_cleanup *, void (*)(void *), void *) = Sys_Push_Cleanup;
static bool (*volatile pop)(bool) = Sys_Pop_Cleanup;
static bool (*volatile limit)(sys_quota *, uint16, uint16) = Sys_Limit_Event;
static bool (*volatile keep_latest)(sys_quota *, uint16) = Sys_Keep_Latest;
static bool (*volatile send)(uint16, const void *, uint16) = Sys_Send_Event;
static bool (*volatile start_service)(sys_service *) = Sys_Start_Service;
static bool (*volatile feed)(void) = Sys_Feed_Watchdog;

static const uint16 value = 7;

void options_settle(void)
{
    Sys_Sleep(2);
}

void options_settle_under_round_robin(void)
{
    options_settle();
    Sys_Set_Scheduler(&sys_round_robin);
}

/* ---- The other threads ------------------------------------------------------------------------------------------- */

static void spin(void *unused)
{
    (void)unused;
    options_spin();
}

static void own(void *mutex)
{
    (void)lock(mutex);
    Sys_Sleep(60000);
}

static void wait_for_mutex(void *unused)
{
    (void)unused;
    (void)lock(&options_mutex);
    options_woken();
    (void)unlock(&options_mutex);
    for (;;) {
        Sys_Sleep(60000);
    }
}

static void end_soon(void *ms)
{
    Sys_Sleep(*(const uint16 *)ms);
}

TARGETS_OF(process.c / os_call_in_section, clean);
static void clean(void *unused)
{
    (void)unused;
    options_woken();
}

static void end_cleaned(void *ms)
{
    (void)push(&options_cleanup, clean, NULL);
    Sys_Sleep(*(const uint16 *)ms);
}

static void push_and_rest(void *cleanup)
{
    (void)push(cleanup, clean, NULL);
    for (;;) {
        Sys_Sleep(60000);
    }
}

static const uint16 soon = 1, later = 5;
const sys_process_config options_spinner = {spin, NULL, 0, 0, 0, 0, 0};
static const sys_process_config owner = {own, &options_mutex, 0, 3, 0, 0, 0};
static const sys_process_config other_owner = {own, &other_mutex, 0, 3, 0, 0, 0};
static const sys_process_config waiter = {wait_for_mutex, NULL, 0, 3, 0, 0, 0};
static const sys_process_config brief = {end_soon, (void *)&soon, 0, 3, 0, 0, 0};
static const sys_process_config lasting = {end_soon, (void *)&later, 0, 3, 0, 0, 0};
static const sys_process_config cleaned = {end_cleaned, (void *)&later, 0, 3, 0, 0, 0};

static bool listen(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    return true;
}

/* ---- Scenes ------------------------------------------------------------------------------------------------------ */

static void wait_for_end(const sys_process_config *config, bool joined)
{
    uint16 pid = joined ? start_joinable(config) : start(config);
    if (joined) {
        (void)join(pid);
        options_woken();
    } else {
        options_settle();
        options_spin();
    }
}

static void with_mutex(uint16 scene)
{
    if (scene == LOCK_TAKEN) {
        (void)start(&owner);
        (void)start(&options_spinner);
        options_settle();
    } else if (scene != LOCK && scene != LOCK_SECOND) {
        (void)lock(&options_mutex);
    }
    if (scene == LOCK_SECOND || scene == UNLOCK_SECOND || scene == UNLOCK_SECOND_ONE_WAITS) {
        (void)start(&other_owner);
    }
    uint16 waiters = scene == UNLOCK_TWO_WAIT ? 2
                     : scene == UNLOCK_ONE_WAITS || scene == UNLOCK_SECOND_ONE_WAITS || scene == UNLOCK_TO_BETTER;
    while (waiters-- != 0) {
        (void)start(&waiter);
    }
    options_settle();
    if (scene != UNLOCK_PRIORITIES && scene != UNLOCK_TO_BETTER) {
        Sys_Set_Scheduler(&sys_round_robin);
    }
    options_ready();
    (void)(scene >= UNLOCK ? unlock : lock)(&options_mutex);
}

static void with_end(uint16 scene)
{
    uint16 pid = scene == JOIN_ZOMBIE ? start_joinable(&brief) : scene == JOIN_LIVING ? start(&options_spinner) : 0;
    if (scene < END) {
        options_settle_under_round_robin();
    }
    options_ready();
    if (scene == START) {
        (void)start(&options_spinner);
    } else if (scene == START_JOINABLE) {
        (void)start_joinable(&options_spinner);
    } else if (scene == END || scene == END_JOINED) {
        wait_for_end(&lasting, scene == END_JOINED);
    } else {
        (void)join(pid);
    }
}

static void with_cleanup(uint16 scene)
{
    static sys_process_config others = {push_and_rest, NULL, 0, 3, 0, 0, 0};
    if (scene > PUSH_BEHIND_TWO) {
        (void)push(&options_cleanup, clean, NULL);
    }
    for (uint16 i = 0; i < 2 && (scene == PUSH_BEHIND_TWO || scene == POP_BEHIND_TWO); i++) {
        others.arg = &other_cleanups[i];
        (void)start(&others);
    }
    options_settle_under_round_robin();
    options_ready();
    if (scene <= PUSH_BEHIND_TWO) {
        (void)push(&options_cleanup, clean, NULL);
    } else {
        (void)pop(scene == POP_AND_RUN);
    }
}

static void with_quota(uint16 scene)
{
    (void)Sys_Register_Event(OPTIONS_NEIGHBOUR);
    (void)Sys_Register_Event(OPTIONS_EVENT);
    (void)Sys_Register_Event(OPTIONS_ELSEWHERE);
    uint16 event = scene == SEND_NEIGHBOUR ? OPTIONS_NEIGHBOUR : scene == SEND_ELSEWHERE ? OPTIONS_ELSEWHERE : OPTIONS_EVENT;
    uint16 waiting = scene == SEND_LIMITED_BEHIND_FOUR ? 4 : scene == SEND_DROPPED || scene == SEND_REPLACED;
    (void)Sys_Subscribe_to_Event(event, 0, listen, NULL);
    if (scene == SEND_REPLACED) {
        (void)keep_latest(&options_quota, OPTIONS_EVENT);
    } else if (scene > SEND) {
        (void)limit(&options_quota, OPTIONS_EVENT, scene == SEND_DROPPED ? 1 : 8);
    }
    if (scene == SEND_SECOND_QUOTA) {
        (void)limit(&other_quota, OPTIONS_ELSEWHERE, 8);
    }
    options_settle_under_round_robin();
    Sys_Start_CriticalSection(); /* nothing is delivered */
    while (waiting-- != 0) {
        (void)send(event, &value, sizeof value);
    }
    options_ready();
    if (scene == LIMIT) {
        (void)limit(&options_quota, OPTIONS_EVENT, 8);
    } else {
        (void)send(event, &value, sizeof value);
    }
}

static void served(void *behind)
{
    for (uint16 i = 0; i < 2 && behind != NULL; i++) {
        (void)start_service(&other_services[i]);
    }
    options_settle_under_round_robin();
    options_ready();
    (void)feed();
    options_done();
    for (;;) {
        Sys_Sleep(60000);
    }
}

static void with_service(uint16 scene)
{
    static sys_process_config config = {served, NULL, 0, 3, 0, 0, 0};
    static const sys_process_config resting = {push_and_rest, &other_cleanups[0], 0, 3, 0, 0, 0};
    if (scene == TICK || scene == TICK_SERVICE) {
        options_service.config = &resting;
        if (scene == TICK_SERVICE) {
            (void)start_service(&options_service);
        }
        options_settle();
        options_ready();
        Sys_Sleep(60000);
    } else if (scene == START_SERVICE) {
        options_settle_under_round_robin();
        options_ready();
        (void)start_service(&options_service);
    } else {
        config.arg = scene == FEED_BEHIND_TWO ? &config : NULL;
        options_service.config = &config;
        (void)start_service(&options_service);
        Sys_Sleep(60000);
    }
}

static void measured(void *unused)
{
    uint16 scene = options_wanted;
    (void)unused;
    if (scene <= UNLOCK_TO_BETTER) {
        with_mutex(scene);
    } else if (scene <= END_JOINED) {
        with_end(scene);
    } else if (scene == END_CLEANED) {
        options_ready();
        wait_for_end(&cleaned, false);
    } else if (scene < LIMIT) {
        with_cleanup(scene);
    } else if (scene < START_SERVICE) {
        with_quota(scene);
    } else if (scene < TAKE) {
        with_service(scene);
    } else {
        options_waits(scene);
    }
    options_done();
    Sys_Set_Scheduler(&sys_woken_first); /* linked, so that its bytes are counted */
    for (;;) {
        Sys_Sleep(60000);
    }
}

int main(void)
{
    static const sys_process_config config = {measured, NULL, 0, 2, 0, 0, 0};
    Sys_Init_Kernel();
    options_begin();
    Sys_Set_Scheduler(&sys_fixed_priority);
    (void)start(&config);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
