/* The options mutex, join and cleanup, also used by hostile programs. They have their own image, built
 * with -DSUITE_OF_OPTIONS, because a small robot cannot hold them together with the kernel's checks. */
#include "conformance.h"

#include <openswarm_cleanup.h>
#include <openswarm_join.h>
#include <openswarm_mutex.h>

#define FILE_LETTER 'o'

static sys_mutex mutex = SYS_MUTEX(3), second = SYS_MUTEX(5);
volatile uint16 rounds_spun;
static volatile bool held;
static volatile uint8 others;
static uint16 own_pid;

void spin_for_ever(void *unused)
{
    (void)unused;
    for (;;) {
        (void)Sys_Get_SystemTime(); /* on some hosts time advances in calls only */
        rounds_spun++;
    }
}

static void spend(uint16 ms)
{
    uint32 before = Sys_Get_SystemTime();
    for (uint16 i = 0; i < 60000 && Sys_Get_SystemTime() - before < ms; i++) { /* on some hosts sections stop time */
    }
}

static bool listen(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    return true;
}

/* ---- Mutex ------------------------------------------------------------------------------------------------------- */

static void lock_and_tell(void *letter)
{
    bool mine = Sys_Lock_Mutex(&mutex);
    note(mine ? *(const char *)letter : '?');
    Sys_Sleep(3);
    note(mine ? *(const char *)letter : '?');
    if (mine && !Sys_Unlock_Mutex(&mutex)) {
        note('!');
    }
}

static void mutexes_refuse_what_they_cannot_do(void)
{
    uint16 refused = Sys_Get_Statistics()->refused;
    CHECK(refused_as(Sys_Unlock_Mutex(&mutex), SYS_ERROR_PROCESS));
    CHECK(Sys_Lock_Mutex(&mutex) && refused_as(Sys_Lock_Mutex(&mutex), SYS_ERROR_PROCESS));
    Sys_Start_CriticalSection();
    CHECK(refused_as(Sys_Lock_Mutex(&second), SYS_ERROR_CONTEXT));
    CHECK(Sys_Unlock_Mutex(&mutex)); /* unlocking is permitted */
    Sys_End_CriticalSection();
    CHECK(Sys_Get_Statistics()->refused == refused + 1u && Sys_Lock_Mutex(&second) && Sys_Unlock_Mutex(&second));
}

static void a_mutex_excludes_and_goes_on_in_turn(void)
{
    static const char letters[] = "ab";
    forget();
    CHECK(Sys_Lock_Mutex(&mutex));
    CHECK(start(lock_and_tell, (void *)&letters[0], 0) != 0 && start(lock_and_tell, (void *)&letters[1], 0) != 0);
    Sys_Sleep(2);
    CHECK(noted("") && Sys_Unlock_Mutex(&mutex));
    Sys_Sleep(20);
    CHECK(noted("aabb") && Sys_Lock_MutexTimeout(&mutex, 1) && Sys_Unlock_Mutex(&mutex));
}

static void hold_for_ever(void *unused)
{
    (void)unused;
    note(Sys_Lock_Mutex(&mutex) && Sys_Lock_Mutex(&second) ? 'h' : '?');
    for (;;) {
        Sys_Sleep(1000);
    }
}

static void owners_and_waiters_die(void)
{
    static const char letters[] = "abc";
    forget();
    uint16 heap = heap_now();
    uint16 owner = start(hold_for_ever, NULL, 0);
    Sys_Sleep(1);
    uint16 a = start(lock_and_tell, (void *)&letters[0], 0), b = start(lock_and_tell, (void *)&letters[1], 0);
    Sys_Sleep(2);
    CHECK(refused_as(Sys_Lock_MutexTimeout(&mutex, 2), SYS_OK) && noted("h"));
    CHECK(Sys_Kill_Process(a) && Sys_Kill_Process(owner)); /* first a waiter, then the owner of two mutexes */
    CHECK(Sys_Lock_Mutex(&second) && Sys_Unlock_Mutex(&second));
    Sys_Sleep(10);
    CHECK(noted("hbb") && Sys_Get_ProcessState(b) == SYS_UNKNOWN);
    CHECK(Sys_Lock_MutexTimeout(&mutex, 1));
    a = start(lock_and_tell, (void *)&letters[2], 0);
    Sys_Sleep(2);
    Sys_Start_CriticalSection();
    CHECK(Sys_Unlock_Mutex(&mutex) && Sys_Kill_Process(a)); /* it owns the mutex and has not run since */
    Sys_End_CriticalSection();
    CHECK(noted("hbb") && Sys_Lock_MutexTimeout(&mutex, 1) && Sys_Unlock_Mutex(&mutex) && heap_now() == heap);
}

/* Locks when both other threads exist; they wait for the lock, because a busy host may delay any of them. */
static void low(void *unused)
{
    (void)unused;
    while (others < 2) {
        Sys_Sleep(1);
    }
    bool mine = Sys_Lock_Mutex(&mutex);
    note(mine ? '(' : '?');
    held = true;
    spend(8);
    note(')');
    (void)Sys_Unlock_Mutex(&mutex);
}

static void until_held(void)
{
    Sys_Start_CriticalSection();
    others++;
    Sys_End_CriticalSection();
    while (!held) {
        Sys_Sleep(1);
    }
}

static void middle(void *unused)
{
    (void)unused;
    until_held();
    spend(60);
    note('m');
}

static void high(void *unused)
{
    (void)unused;
    until_held();
    note(Sys_Lock_Mutex(&mutex) ? 'H' : '?');
    (void)Sys_Unlock_Mutex(&mutex);
}

static void a_ceiling_bounds_inversion(void)
{
    forget();
    Sys_Set_Scheduler(&sys_fixed_priority);
    others = 0, held = false;
    CHECK(start(low, NULL, 1) != 0 && start(middle, NULL, 2) != 0 && start(high, NULL, 3) != 0);
    for (uint16 i = 0; i < 2000 && !noted("()Hm"); i++) {
        Sys_Sleep(1);
    }
    CHECK(noted("()Hm"));
    sys_process_config above = {lock_and_tell, NULL, 0, 4, 0, 0, 0};
    above.arg = &above;
    forget();
    CHECK(Sys_Start_ProcessWith(&above) != 0);
    Sys_Sleep(10);
    CHECK(noted("??")); /* the priority is above the ceiling */
    Sys_Set_Scheduler(&sys_round_robin);
}

/* Sets each scheduler while a mutex has an owner and a waiter. */
static void schedulers_change_under_a_mutex(void)
{
    static const sys_scheduler *const all[] = {&sys_fixed_priority, &sys_woken_first, &sys_earliest_deadline, &sys_round_robin};
    static const char letters[] = "ab";
    for (uint8 i = 0; i < 4; i++) {
        forget();
        CHECK(Sys_Lock_Mutex(&mutex));
        CHECK(start(lock_and_tell, (void *)&letters[0], 1) != 0);
        Sys_Sleep(2);
        Sys_Set_Scheduler(all[i]);
        CHECK(start(lock_and_tell, (void *)&letters[1], 2) != 0);
        Sys_Sleep(2);
        CHECK(Sys_Unlock_Mutex(&mutex));
        Sys_Sleep(12);
        CHECK(noted("bbaa"));
        CHECK(Sys_Lock_MutexTimeout(&mutex, 1) && Sys_Unlock_Mutex(&mutex));
    }
}

/* Join and cleanup: waiting for the end of a thread, and functions that the kernel calls at the end of a
 * thread. */

static void brief(void *unused)
{
    (void)unused;
    Sys_Sleep(2);
    note('e');
}

static uint16 start_joinable(void (*entry)(void *))
{
    sys_process_config config = {entry, NULL, 0, 0, 0, 0, 0};
    return Sys_Start_Joinable(&config);
}

static void join_it(void *pid)
{
    note(Sys_Join(*(const uint16 *)pid) ? 'j' : '?');
}

static void zombies_wait_to_be_joined(void)
{
    uint16 heap = heap_now();
    forget();
    uint16 pid = start_joinable(brief);
    Sys_Sleep(5);
    CHECK(Sys_Get_ProcessState(pid) == SYS_ZOMBIE && heap_now() > heap && Sys_Get_UnusedStack(pid) == 0);
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, pid, listen, NULL)); /* a zombie's subscription ends with the zombie */
    CHECK(Sys_Join(pid) && Sys_Get_ProcessState(pid) == SYS_UNKNOWN);
    Sys_Yield();
    CHECK(heap_now() == heap && refused_as(Sys_Join(pid), SYS_ERROR_PROCESS) && refused_as(Sys_Join(0), SYS_ERROR_PROCESS));
    pid = start_joinable(brief);
    CHECK(Sys_Join(pid) && Sys_Get_ProcessState(pid) == SYS_UNKNOWN && noted("ee"));
    pid = start_joinable(brief);
    Sys_Sleep(5);
    CHECK(Sys_Kill_Process(pid) && Sys_Get_ProcessState(pid) == SYS_UNKNOWN);
    Sys_Yield();
    CHECK(heap_now() == heap);
}

static void joiners_die(void)
{
    uint16 heap = heap_now();
    forget();
    own_pid = start(spin_for_ever, NULL, 0);
    uint16 a = start(join_it, &own_pid, 0), b = start(join_it, &own_pid, 0);
    CHECK(own_pid != 0 && a != 0 && b != 0);
    Sys_Sleep(30);
    CHECK(Sys_Kill_Process(a) && Sys_Kill_Process(own_pid)); /* first one of two waiting threads, then the joined one */
    Sys_Sleep(2);
    CHECK(noted("j") && Sys_Get_ProcessState(b) == SYS_UNKNOWN && heap_now() == heap);
}

static sys_cleanup cleanups[3];
static void tell(void *letter)
{
    note(*(const char *)letter);
}

static void push_three(void *ms)
{
    static const char letters[] = "abc";
    for (uint8 i = 0; i < 3; i++) {
        note(Sys_Push_Cleanup(&cleanups[i], tell, (void *)&letters[i]) ? '+' : '?');
    }
    note(Sys_Pop_Cleanup(false) ? '-' : '?');
    Sys_Sleep(*(const uint16 *)ms);
}

static void cleanups_run_whatever_ends_the_thread(void)
{
    static const uint16 soon = 1, never = 60000;
    forget();
    CHECK(start(push_three, (void *)&soon, 0) != 0);
    Sys_Sleep(3);
    CHECK(noted("+++-ba"));
    forget();
    uint16 pid = start(push_three, (void *)&never, 0);
    Sys_Sleep(1);
    CHECK(Sys_Kill_Process(pid) && noted("+++-ba"));
    CHECK(refused_as(Sys_Pop_Cleanup(true), SYS_ERROR_PROCESS));
}

static void again(void *self)
{
    note(Sys_Push_Cleanup(self, again, self) ? '?' : 'r');
    Sys_Sleep(1);
    note(Sys_Lock_Mutex(&mutex) ? '?' : 'r');
    Sys_End_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Start_CriticalSection();
    (void)Sys_Kill_Process(own_pid);
}

static void push_again(void *ms)
{
    own_pid = Sys_Get_ProcessID();
    note(Sys_Push_Cleanup(&cleanups[0], again, &cleanups[0]) ? '+' : '?');
    note(refused_as(Sys_Push_Cleanup(&cleanups[0], again, NULL), SYS_ERROR_ARGUMENT) ? 'r' : '?');
    Sys_Sleep(*(const uint16 *)ms);
}

/* Cleanups that push themselves again, block, end sections of other code, or kill the ending thread. */
static void hostile_cleanups(void)
{
    static const uint16 soon = 1, never = 60000;
    uint16 heap = heap_now();
    for (uint8 i = 0; i < 2; i++) {
        forget();
        uint16 pid = start(push_again, (void *)(i == 0 ? &soon : &never), 0);
        uint16 other = start(spin_for_ever, NULL, 0);
        Sys_Sleep(12);
        rounds_spun = 0;
        Sys_Start_CriticalSection();
        CHECK(i == 0 || Sys_Kill_Process(pid));
        spend(12);
        CHECK(rounds_spun == 0); /* the critical section still exists */
        Sys_End_CriticalSection();
        Sys_Sleep(12);
        CHECK(noted("+rrr") && rounds_spun != 0 && Sys_Kill_Process(other));
        Sys_Yield();
        CHECK(heap_now() == heap);
    }
}

/* ---- Teardown: leave every list, run the cleanups, free the memory ---------------------------------------------------- */

static uint16 target_pid;
static sys_cleanup hostile[2];

static void kill_target(void *unused)
{
    (void)unused;
    note(Sys_Get_ProcessID() == own_pid ? 'i' : '?');
    note(Sys_Kill_Process(target_pid) ? 'k' : 'f');
}

static void kill_what_it_joins(void *unused)
{
    (void)unused;
    own_pid = Sys_Get_ProcessID();
    note(Sys_Push_Cleanup(&hostile[0], kill_target, NULL) ? '+' : '?');
    (void)Sys_Join(target_pid);
}

static void kill_whom_it_awaits(void *unused)
{
    (void)unused;
    own_pid = Sys_Get_ProcessID();
    note(Sys_Push_Cleanup(&hostile[0], kill_target, NULL) ? '+' : '?');
    (void)Sys_Lock_Mutex(&mutex);
}

static void cleanups_kill_what_their_thread_awaits(void)
{
    static void (*const targets[])(void *) = {spin_for_ever, hold_for_ever};
    static void (*const victims[])(void *) = {kill_what_it_joins, kill_whom_it_awaits};
    uint16 heap = heap_now();
    for (uint8 i = 0; i < 2; i++) {
        target_pid = start(targets[i], NULL, 0);
        Sys_Sleep(12);
        forget();
        uint16 victim = start(victims[i], NULL, 0);
        Sys_Sleep(25);
        CHECK(noted("+") && Sys_Kill_Process(victim) && noted("+ik"));
        CHECK(Sys_Get_ProcessState(target_pid) == SYS_UNKNOWN && Sys_Get_ProcessState(victim) == SYS_UNKNOWN);
        Sys_Sleep(12);
        CHECK(heap_now() == heap && Sys_Lock_MutexTimeout(&mutex, 1) && Sys_Unlock_Mutex(&mutex));
    }
}

static void use_what_is_the_killers(void *unused)
{
    (void)unused;
    note(Sys_Unlock_Mutex(&mutex) ? '?' : 'u');
    note(Sys_Pop_Cleanup(true) ? '?' : 'p');
}

static void push_that(void *unused)
{
    note(Sys_Push_Cleanup(&hostile[0], use_what_is_the_killers, NULL) ? '+' : '?');
    spin_for_ever(unused);
}

static void cleanups_own_nothing_of_the_killer(void)
{
    static const char letters[] = "x";
    forget();
    uint16 victim = start(push_that, NULL, 0);
    CHECK(Sys_Lock_Mutex(&mutex) && Sys_Push_Cleanup(&hostile[1], tell, (void *)&letters[0]));
    Sys_Sleep(12);
    CHECK(Sys_Kill_Process(victim) && noted("+up"));
    CHECK(Sys_Unlock_Mutex(&mutex) && Sys_Pop_Cleanup(true) && noted("+upx"));
    CHECK(refused_as(Sys_Push_Cleanup(&hostile[0], NULL, NULL), SYS_ERROR_ARGUMENT));
}

static void look_at_mutex(void *unused)
{
    (void)unused;
    note(mutex.owner == NULL ? 'n' : 'o');
}

static void own_and_look(void *mutex_first)
{
    bool locked = mutex_first != NULL && Sys_Lock_Mutex(&mutex);
    note(Sys_Push_Cleanup(&hostile[0], look_at_mutex, NULL) ? '+' : '?');
    note(locked || Sys_Lock_Mutex(&mutex) ? 'm' : '?');
    spin_for_ever(NULL);
}

static void a_mutex_is_released_before_cleanups_run(void)
{
    static uint8 any;
    for (uint8 i = 0; i < 2; i++) {
        forget();
        uint16 pid = start(own_and_look, i == 0 ? NULL : &any, 0);
        Sys_Sleep(12);
        CHECK(noted("+m") && Sys_Kill_Process(pid) && noted("+mn"));
    }
}

static void push_kill(void *unused)
{
    own_pid = Sys_Get_ProcessID();
    note(Sys_Push_Cleanup(&hostile[0], kill_target, NULL) ? '+' : '?');
    spin_for_ever(unused);
}

static void kill_and_be_killed(void *victim)
{
    static const char letters[] = "x";
    target_pid = Sys_Get_ProcessID();
    note(Sys_Push_Cleanup(&hostile[1], tell, (void *)&letters[0]) ? '+' : '?');
    note(Sys_Kill_Process(*(const uint16 *)victim) ? '?' : '!'); /* it does not return */
}

static void a_cleanup_kills_the_killer(void)
{
    uint16 heap = heap_now();
    forget();
    uint16 victim = start(push_kill, NULL, 0);
    Sys_Sleep(12);
    uint16 killer = start(kill_and_be_killed, &victim, 0);
    Sys_Sleep(25);
    CHECK(noted("++ikx") && Sys_Get_ProcessState(killer) == SYS_UNKNOWN && Sys_Get_ProcessState(victim) == SYS_UNKNOWN);
    CHECK(heap_now() == heap && Sys_Push_Cleanup(&hostile[0], kill_target, NULL) && Sys_Pop_Cleanup(false));
}

static uint16 partners[3];

static void join_partner(void *pid)
{
    Sys_Sleep(2);
    note(Sys_Join(*(const uint16 *)pid) ? 'j' : Sys_Get_LastError() == SYS_ERROR_PROCESS ? 'r' : '?');
}

static void threads_do_not_join_in_a_ring(void)
{
    forget();
    for (uint8 i = 0; i < 3; i++) {
        partners[i] = start(join_partner, &partners[(i + 1) % 3], 0);
    }
    Sys_Sleep(50);
    CHECK(noted("rjj"));
}

void check_options(void)
{
    mutexes_refuse_what_they_cannot_do();
    a_mutex_excludes_and_goes_on_in_turn();
    owners_and_waiters_die();
    a_ceiling_bounds_inversion();
    schedulers_change_under_a_mutex();
    zombies_wait_to_be_joined();
    joiners_die();
    cleanups_run_whatever_ends_the_thread();
    hostile_cleanups();
    cleanups_kill_what_their_thread_awaits();
    cleanups_own_nothing_of_the_killer();
    a_mutex_is_released_before_cleanups_run();
    a_cleanup_kills_the_killer();
    threads_do_not_join_in_a_ring();
}
