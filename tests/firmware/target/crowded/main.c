/* Histories that make the kernel's calls long: every thread waits for one event, whose queue is full and whose bucket has
 * newer events, one thread has all subscriptions, and the heap is full of holes. Nothing interrupts, so that calls longer
 * than a tick are measured as they are (bench/bounds.py). */
#include <openswarm.h>
#include <p30F6014A.h>

#include "kernel.h"

enum { FIRST = SYS_FIRST_USER_EVENT, EXTRA = 8, WAITERS = 9, MESSAGES = 20, PIECES = 24, BUCKETS = 8 };
enum { GATHERING = FIRST + BUCKETS * 3 };

volatile uint16 scenes __attribute__((used)), failures __attribute__((used));

static uint16 waiting[WAITERS];
static bool (*const volatile kill)(uint16 pid) = Sys_Kill_Process; /* a call, not a copy of its code */

static void expect(bool holds)
{
    failures += !holds;
}

static void waiter(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(GATHERING);
        Sys_Clear_EventData(&data);
        Sys_Yield();
    }
}

static bool first_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    return pid == 0 || event == 0 || data != NULL;
}

static bool second_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    return first_handler(pid, event, data);
}

static const sys_process_config crowd = {waiter, NULL, 128, 0, 0, 0, 0};

/* Three of the buckets get three events each; GATHERING comes first, so the others are newer. */
static uint16 extra(uint16 k)
{
    return (uint16)(FIRST + k % 3 + BUCKETS * (k / 3));
}

static bool all_wait(void)
{
    for (uint16 k = 0; k < WAITERS; k++) {
        if (Sys_Get_ProcessState(waiting[k]) != SYS_BLOCKED) {
            return false;
        }
    }
    return true;
}

static void scene(void)
{
    static const uint8 sizes[] = {40, 12, 24, 8, 18, 6, 14, 10};
    void *pieces[PIECES];
    uint16 k;
    expect(Sys_Register_Event(GATHERING));
    while (!all_wait()) {
        Sys_Yield();
    }
    for (k = 0; k < PIECES; k++) {
        pieces[k] = heap_take(sizes[k % sizeof sizes]);
        expect(pieces[k] != NULL);
    }
    uint16 victim = Sys_Start_ProcessWith(&crowd);
    expect(victim != 0);
    for (k = 0; k < PIECES; k += 2) {
        heap_give(pieces[k], sizes[k % sizeof sizes]);
    }
    for (k = 0; k < EXTRA; k++) {
        expect(Sys_Register_Event(extra(k)));
        expect(Sys_Subscribe_to_Event(extra(k), victim, first_handler, NULL));
        expect(Sys_Subscribe_to_Event(extra(k), victim, second_handler, NULL));
    }
    for (k = 0; k < MESSAGES; k++) {
        expect(Sys_Send_IntEvent(GATHERING, k));
    }
    expect(Sys_Subscribe_to_Event(GATHERING, victim, first_handler, NULL));
    expect(Sys_Subscribe_to_Event(GATHERING, victim, second_handler, NULL));
    expect(Sys_Unregister_Event(GATHERING));
    expect(kill(victim));
    for (k = 0; k < EXTRA; k++) {
        expect(Sys_Unregister_Event(extra(k)));
    }
    for (k = 1; k < PIECES; k += 2) {
        heap_give(pieces[k], sizes[k % sizeof sizes]);
    }
    Sys_Yield();
    scenes++;
}

static void driver(void *unused)
{
    (void)unused;
    IEC0 = IEC1 = IEC2 = 0;
    for (;;) {
        scene();
    }
}

int main(void)
{
    static const sys_process_config config = {driver, NULL, 400, 0, 0, 0, 0};
    Sys_Init_Kernel();
    for (uint16 k = 0; k < WAITERS; k++) {
        waiting[k] = Sys_Start_ProcessWith(&crowd);
    }
    Sys_Start_ProcessWith(&config);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
