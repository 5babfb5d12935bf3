/* Puts the kernel's data structures into the worst state for each measured call (bench/kernel/bounds.py). No
 * interrupt occurs, so that calls longer than a tick are measured correctly. Each scene has the worst heap tree for
 * its call: the pieces of a layout (layouts.h) are allocated one after the other, and then the holes are
 * freed. */
#include <openswarm.h>
#include <p30F6014A.h>

#include "kernel.h"
#include "layouts.h"

enum {
    FIRST = SYS_FIRST_USER_EVENT,
    BUCKETS = 8,
    WAITERS = 9,
    MESSAGES = 20,
    CROWD = 8,
    HANDLERS = 3,
    KEPT_BYTES = 6,
    NEAR = 5
};
/* Bucket 0 contains LATE (oldest), GATHERING, then the events of the crowd; FRESH is registered last. */
enum { TOKEN = FIRST + 1, LATE = FIRST + BUCKETS * 40, GATHERING = LATE + BUCKETS, FRESH = GATHERING + BUCKETS };

volatile uint16 scenes __attribute__((used)), failures __attribute__((used));

static uint16 waiting[WAITERS], victim_pid;
static volatile bool late, asleep;
static uint8 *pad;
static uint16 padding, pieces;
static struct {
    void *at;
    uint16 size; /* 0: not allocated by the test */
    bool is_hole;
} taken[PIECES];
static bool (*const volatile kill)(uint16 pid) = Sys_Kill_Process; /* volatile: prevents inlining */
static bool (*const volatile subscribe)(uint16 id, uint16 pid, sys_handler handler,
                                        sys_condition condition) = Sys_Subscribe_to_Event;
static bool (*const volatile unsubscribe)(uint16 id, uint16 pid, sys_handler handler) = Sys_Unsubscribe_Handler;
static bool (*const volatile send)(uint16 id, const void *data, uint16 size) = Sys_Send_Event;

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

/* Takes a message and never runs again. */
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

static bool third_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    return first_handler(pid, event, data);
}

static const sys_handler handlers[HANDLERS] = {first_handler, second_handler, third_handler};

static void until_blocked(uint16 pid)
{
    while (Sys_Get_ProcessState(pid) != SYS_BLOCKED) {
        Sys_Yield();
    }
}

static void until_all_wait(void)
{
    for (uint16 k = 0; k < WAITERS; k++) {
        until_blocked(waiting[k]);
    }
    until_blocked(victim_pid);
}

/* Returns the k-th event of the victim's subscriptions, in the order in which killing it frees them: by bucket, newest
 * first. */
static uint16 event_of(uint16 k)
{
    return (uint16)(FIRST + k % CROWD * BUCKETS + k / CROWD * 2);
}

static void subscribe_to_many(uint16 k)
{
    expect(subscribe(event_of(k), victim_pid, first_handler, NULL));
}

static void subscribe_to_late(uint16 k)
{
    expect(subscribe(LATE, victim_pid, handlers[k], NULL));
}

static void subscribe_to_gathering(uint16 k)
{
    expect(subscribe(GATHERING, victim_pid, handlers[k], NULL));
}

/* Here the measuring test sets the PID counter to 0, where the PIDs of all living threads are in use. */
__attribute__((noinline, used)) static void numbers_are_round(void)
{
    __asm__ volatile("");
}

static void take(uint16 size, bool is_hole)
{
    uint16 *at = heap_alloc(size);
    expect(at != NULL);
    at[size / 2 - 1] = NEAR; /* looks like the end of a hole, so heap_free must search the tree without success */
    taken[pieces].at = at;
    taken[pieces].size = size;
    taken[pieces++].is_hole = is_hole;
}

static void give(bool holes)
{
    for (uint16 k = 0; k < pieces; k++) {
        if (taken[k].is_hole == holes) {
            heap_free(taken[k].at, taken[k].size);
        }
    }
}

static void build(const layout *l, void (*subscribe_kth)(uint16 k))
{
    pad = heap_alloc(2);
    padding = (uint16)(os_memory.bytes + l->begin - pad);
    expect(pad != NULL && padding < 0x1000 && heap_alloc(padding - 2u) == pad + 2);
    pieces = 0;
    for (const signed char *piece = l->pieces; *piece != END; piece++) {
        if (*piece == EVENT) {
            expect(Sys_Register_Event(GATHERING));
        } else if (*piece < 0) {
            subscribe_kth((uint16)(-1 - *piece));
        } else if (*piece == KEPT) {
            take(KEPT_BYTES, false);
        } else {
            take((uint16)*piece, true);
        }
    }
}

/* Creates all structures except the holes; the thread that waits for LATE becomes the last one on the blocked list. */
static void set(const layout *l, void (*subscribe_kth)(uint16 k), bool is_event_in_layout, uint16 events)
{
    static const sys_process_config sleeper = {victim, NULL, 400, 0, 0, 0, 0};
    late = true;
    asleep = false;
    expect(Sys_Register_Event(LATE) && Sys_Register_Event(TOKEN));
    expect(is_event_in_layout || Sys_Register_Event(GATHERING));
    numbers_are_round();
    victim_pid = Sys_Start_ProcessWith(&sleeper);
    until_blocked(victim_pid);
    for (uint16 k = events; k-- > 0;) {
        expect(Sys_Register_Event(event_of(k)));
    }
    build(l, subscribe_kth);
    for (uint16 k = 0; events == 0 && k < CROWD; k++) {
        expect(Sys_Register_Event(event_of(k)));
    }
    expect(Sys_Send_IntEvent(TOKEN, 1));
    while (!asleep) {
        Sys_Yield();
    }
    until_all_wait();
}

static void move_late_waiter(void)
{
    expect(Sys_Send_IntEvent(LATE, 1));
    Sys_Yield();
    until_all_wait();
}

static void clear(uint16 events)
{
    (void)kill(victim_pid);
    for (uint16 k = 0; k < (events != 0 ? events : CROWD); k++) {
        expect(Sys_Unregister_Event(event_of(k)));
    }
    expect(Sys_Unregister_Event(LATE) && Sys_Unregister_Event(TOKEN));
    (void)Sys_Unregister_Event(GATHERING);
    give(false);
    heap_free(pad, padding);
    Sys_Yield();
    scenes++;
}

static void scene_of_keeping(void)
{
    uint16 last = waiting[WAITERS - 1];
    set(&chain, NULL, false, 0);
    move_late_waiter();
    expect(subscribe(LATE, last, first_handler, NULL) && subscribe(LATE, last, second_handler, NULL));
    give(true);
    expect(Sys_Get_ProcessState(0xFFFF) == SYS_UNKNOWN);
    expect(Sys_Register_Event(FRESH));
    expect(Sys_Unregister_Event(FRESH));
    expect(subscribe(LATE, last, third_handler, NULL));
    clear(0);
}

static void scene_of_unsubscribing(void)
{
    set(&three_given_back, subscribe_to_late, false, 0);
    give(true);
    expect(unsubscribe(LATE, victim_pid, NULL));
    clear(0);
}

static void scene_of_unregistering(void)
{
    static const struct {
        uint16 first, second;
    } words = {0, 0};
    set(&three_and_event_given_back, subscribe_to_gathering, true, 0);
    move_late_waiter();
    move_late_waiter(); /* now it is the last one of the list */
    give(true);
    expect(send(LATE, (const uint8 *)&words + 1, 2));
    late = false;
    Sys_Yield();
    until_all_wait();
    for (uint16 k = 0; k < MESSAGES; k++) {
        expect(Sys_Send_IntEvent(GATHERING, k));
    }
    expect(Sys_Unregister_Event(GATHERING));
    clear(0);
}

static void scene_of_killing(void)
{
    set(&many_given_back, subscribe_to_many, false, SUBSCRIPTIONS);
    give(true);
    expect(kill(victim_pid));
    clear(SUBSCRIPTIONS);
}

static void driver(void *unused)
{
    (void)unused;
    IEC0 = IEC1 = IEC2 = 0;
    for (;;) {
        scene_of_killing();
        scene_of_keeping();
        scene_of_unsubscribing();
        scene_of_unregistering();
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
