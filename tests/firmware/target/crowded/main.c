/* The kernel's structures at their worst for its calls, built on purpose; nothing interrupts, so that calls longer than a
 * tick are measured as they are (bench/bounds.py). A scene's heap, behind everything that stays:
 *
 *      T                                                                                     T + 0x7E
 *      | hole 6 | kept 6 | hole 8 | kept 6 | hole 10 | ... | hole 18 | kept 6 |  the root  | subscriptions ... |
 *
 * All holes lie in the half of the heap from T on, the smaller the nearer, so that the tree is one path: taking out its
 * root pulls up all others, and putting it in pushes them down again. The victim's subscriptions come in the order in
 * which killing it gives them back, each to the end of the root. */
#include <openswarm.h>
#include <p30F6014A.h>

#include "kernel.h"

enum { FIRST = SYS_FIRST_USER_EVENT, BUCKETS = 8, WAITERS = 9, MESSAGES = 20, LEVELS = 7, KEPT = 6, SMALLEST = 6, ROOT = 60 };
enum { T = 0x1000, EVENTS = 11 };
/* In bucket 0 the oldest event is LATE, then comes GATHERING, then the others; FRESH is registered last. */
enum { LATE = FIRST + BUCKETS * 8, GATHERING = LATE + BUCKETS, TOKEN = FIRST + 1, FRESH = LATE + 2 * BUCKETS };

volatile uint16 scenes __attribute__((used)), failures __attribute__((used));

static uint16 waiting[WAITERS];
static volatile bool late, asleep;
static bool (*const volatile kill)(uint16 pid) = Sys_Kill_Process; /* calls, not copies of their code */
static bool (*const volatile subscribe)(uint16 id, uint16 pid, sys_handler handler, sys_condition condition) =
    Sys_Subscribe_to_Event;
static bool (*const volatile unsubscribe)(uint16 id, uint16 pid, sys_handler handler) = Sys_Unsubscribe_Handler;

static void expect(bool holds)
{
    failures += !holds;
}

static void waiter(void *last)
{
    for (;;) {
        uint16 event = last != NULL && late ? LATE : GATHERING;
        sys_event_data *data = Sys_Wait_for_Event(event);
        Sys_Clear_EventData(&data);
        Sys_Yield();
    }
}

/* Keeps a message and is the last on the list of those that do not run. */
static void victim(void *unused)
{
    (void)unused;
    sys_event_data *data = Sys_Wait_for_Event(TOKEN);
    asleep = data != NULL;
    for (;;) {
        Sys_Sleep(30000);
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

static void until_all_wait(uint16 pid)
{
    for (uint16 k = 0; k < WAITERS; k++) {
        while (Sys_Get_ProcessState(waiting[k]) != SYS_BLOCKED) {
            Sys_Yield();
        }
    }
    while (pid != 0 && Sys_Get_ProcessState(pid) != SYS_BLOCKED) {
        Sys_Yield();
    }
}

/* Events that the victim subscribes to: four of bucket 0, the rest of bucket 2. */
static uint16 other(uint16 k)
{
    return (uint16)(k < 4 ? FIRST + BUCKETS * k : FIRST + 2 + BUCKETS * k);
}

static void *taken(uint16 size)
{
    void *piece = heap_take(size);
    expect(piece != NULL);
    return piece;
}

static void scene(void)
{
    static const sys_process_config sleeper = {victim, NULL, 128, 0, 0, 0, 0};
    void *holes[LEVELS], *kept[LEVELS], *root;
    uint16 k;
    late = true;
    asleep = false;
    expect(Sys_Register_Event(LATE) && Sys_Register_Event(GATHERING) && Sys_Register_Event(TOKEN));
    until_all_wait(0);
    uint16 pid = Sys_Start_ProcessWith(&sleeper);
    for (k = 0; k < EVENTS; k++) {
        expect(Sys_Register_Event(other(k)));
    }
    until_all_wait(pid);
    uint8 *pad = taken(2);
    uint16 padding = (uint16)(os_memory.bytes + T - pad);
    expect(padding < 0x1000 && heap_take(padding - 2u) != NULL);
    for (k = 0; k < LEVELS; k++) {
        holes[k] = taken(SMALLEST + 2u * k);
        kept[k] = taken(KEPT);
    }
    root = taken(ROOT);
    expect(subscribe(GATHERING, pid, first_handler, NULL));
    expect(subscribe(GATHERING, pid, second_handler, NULL));
    for (k = 4; k-- > 0;) { /* as killing meets them: the newest of a bucket first */
        expect(subscribe(other(k), pid, first_handler, NULL) && subscribe(other(k), pid, second_handler, NULL));
    }
    for (k = EVENTS; k-- > 4;) {
        expect(subscribe(other(k), pid, first_handler, NULL) && subscribe(other(k), pid, second_handler, NULL));
    }
    expect(Sys_Send_IntEvent(TOKEN, 1));
    while (!asleep) {
        Sys_Yield();
    }
    until_all_wait(pid);
    for (k = 0; k < LEVELS; k++) {
        heap_give(holes[k], SMALLEST + 2u * k);
    }
    heap_give(root, ROOT);

    expect(Sys_Send_IntEvent(LATE, 1));
    late = false;
    until_all_wait(0);
    expect(Sys_Register_Event(FRESH));
    expect(Sys_Unregister_Event(FRESH));
    expect(subscribe(LATE, pid, first_handler, NULL));
    expect(unsubscribe(LATE, pid, first_handler));
    expect(subscribe(GATHERING, waiting[0], first_handler, NULL));
    for (k = 0; k < MESSAGES; k++) {
        expect(Sys_Send_IntEvent(GATHERING, k));
    }
    expect(Sys_Unregister_Event(GATHERING));
    expect(kill(pid));

    for (k = 0; k < EVENTS; k++) {
        expect(Sys_Unregister_Event(other(k)));
    }
    expect(Sys_Unregister_Event(LATE) && Sys_Unregister_Event(TOKEN));
    for (k = 0; k < LEVELS; k++) {
        heap_give(kept[k], KEPT);
    }
    heap_give(pad, padding);
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
        sys_process_config crowd = {waiter, k == WAITERS - 1 ? waiting : NULL, 128, 0, 0, 0, 0};
        waiting[k] = Sys_Start_ProcessWith(&crowd);
    }
    Sys_Start_ProcessWith(&config);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
