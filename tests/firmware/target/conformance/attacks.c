/* Attacks: permitted or refused calls at the worst instant and in the worst number. Each of them has crashed a kernel,
 * this one or the original. docs/design/kernel-tests.md lists all attacks and those that need a certain CPU. */
#include "conformance.h"

#define FILE_LETTER 'a'

enum { PIDS = 1000, MESSAGES = 40 }; /* the tests let PIDs wrap */

static uint16 heard, disorder;
static bool in_order(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    disorder += data->value != heard;
    heard++;
    return true;
}

static bool listen(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    return true;
}

static volatile uint16 spins;
static void spin(void *unused)
{
    (void)unused;
    for (;;) {
        (void)Sys_Get_SystemTime(); /* on some hosts time advances in calls only */
        spins++;
    }
}

static void spend(uint16 ms)
{
    uint32 before = Sys_Get_SystemTime();
    for (uint16 i = 0; i < 60000 && Sys_Get_SystemTime() - before < ms; i++) {
    }
}

static bool others_run(void)
{
    uint16 pid = start(spin, NULL, 0);
    spins = 0;
    Sys_Sleep(30);
    return spins != 0 && Sys_Kill_Process(pid);
}

/* Floods the heap with events from a thread and from the clock interrupt: refused events are counted and reported,
 * accepted ones arrive in order, all memory is freed, and interrupts do not change a thread's last error. */
static void a_flood_is_refused(void)
{
    heard = disorder = 0;
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, in_order, NULL));
    CHECK(Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, listen, NULL));
    Sys_Yield();
    const sys_statistics *now = Sys_Get_Statistics();
    uint16 heap = now->heap_used, lost = now->events_lost, sent = 0, lost_at, lost_ticks;
    CHECK(lost == 0); /* so far the heap has had room for all messages */
    Sys_Start_CriticalSection();
    while (Sys_Send_IntEvent(E1, sent)) {
        sent++;
    }
    CHECK(sent > 20 && Sys_Get_LastError() == SYS_ERROR_MEMORY && Sys_Get_LostEvents(E1) == 1);
    CHECK(!Sys_Unregister_Event(E_NEVER));
    uint32 before = Sys_Get_SystemTime();
    spend(5);
    uint16 elapsed = (uint16)(Sys_Get_SystemTime() - before);
    CHECK(Sys_Get_LastError() == SYS_ERROR_EVENT);
    do {
        lost_at = now->events_lost;
        lost_ticks = Sys_Get_LostEvents(SYS_1ms_TIMER);
    } while (lost_at != now->events_lost);
    CHECK(lost_ticks + 1u >= elapsed && lost_at == lost_ticks + 1u);
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(Sys_Unsubscribe_Handler(SYS_1ms_TIMER, 0, listen));
    Sys_Yield();
    CHECK(heard == sent && disorder == 0 && heap_now() == heap - 8 * sizeof(void *) / 2);
    CHECK(Sys_Unregister_Event(E1));
}

static void idle(void *unused)
{
    (void)unused;
    for (;;) {
        Sys_Yield();
    }
}

static void pids_go_round(void)
{
    uint16 old = start(idle, NULL, 0), wrong = 0;
    for (uint16 i = 0; i < PIDS; i++) {
        uint16 pid = start(idle, NULL, 0);
        wrong += pid == 0 || pid == old || !Sys_Kill_Process(pid);
    }
    CHECK(wrong == 0 && Sys_Kill_Process(old));
}

static void every_event_number_is_good(void)
{
    static const uint16 numbers[] = {0, 0x8000, 0xFFFF};
    for (uint8 i = 0; i < 3; i++) {
        uint16 id = numbers[i];
        heard = disorder = 0;
        CHECK(!Sys_Send_IntEvent(id, 0) && !Sys_Unregister_Event(id) && !Sys_Unsubscribe_from_Event(id, 0));
        CHECK(!Sys_Subscribe_to_Event(id, 0, in_order, NULL) && Sys_Wait_for_Event(id) == NULL);
        CHECK(Sys_Get_LastError() == SYS_ERROR_EVENT);
        CHECK(Sys_Register_Event(id) && Sys_Subscribe_to_Event(id, 0, in_order, NULL) && Sys_Send_IntEvent(id, 0));
        Sys_Yield();
        CHECK(heard == 1 && disorder == 0 && Sys_Unregister_Event(id));
    }
}

static void end_inside(void *itself)
{
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    note('i');
    if (itself != NULL) {
        (void)Sys_Kill_Process(Sys_Get_ProcessID());
    }
}

static bool begin_only(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    Sys_Start_CriticalSection();
    return false;
}

static bool end_only(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    Sys_End_CriticalSection();
    return false;
}

static void once(void *unused)
{
    (void)unused;
    note('o');
}

static void sections_without_their_other_half(void)
{
    static uint8 any;
    forget();
    CHECK(start(end_inside, NULL, 0) != 0 && start(end_inside, &any, 0) != 0);
    Sys_Sleep(1);
    CHECK(noted("ii") && others_run());
    Sys_End_CriticalSection();
    Sys_End_CriticalSection();
    CHECK(start(once, NULL, 0) != 0);
    Sys_Start_CriticalSection();
    Sys_Yield();
    CHECK(noted("ii")); /* a single section is enough to exclude the other thread */
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(noted("iio"));
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, begin_only, NULL) && Sys_Send_IntEvent(E1, 0));
    Sys_Sleep(1); /* this thread is the next to run after the handler */
    CHECK(others_run());
    CHECK(Sys_Subscribe_to_Event(E1, 0, end_only, NULL) && Sys_Send_IntEvent(E1, 0));
    Sys_Yield();
    CHECK(others_run() && Sys_Unregister_Event(E1));
}

static bool ping(uint16 pid, uint16 event, sys_event_data *data);
static bool pong(uint16 pid, uint16 event, sys_event_data *data)
{
    heard++;
    (void)data;
    return Sys_Unsubscribe_Handler(event, pid, ping) && Sys_Subscribe_to_Event(event, pid, ping, NULL);
}
static bool ping(uint16 pid, uint16 event, sys_event_data *data)
{
    heard++;
    (void)data;
    return Sys_Unsubscribe_Handler(event, pid, pong) && Sys_Subscribe_to_Event(event, pid, pong, NULL);
}

static void handlers_that_subscribe_each_other_again(void)
{
    heard = 0;
    CHECK(Sys_Register_Event(E1));
    CHECK(Sys_Subscribe_to_Event(E1, 0, ping, NULL) && Sys_Subscribe_to_Event(E1, 0, pong, NULL));
    for (uint8 i = 1; i <= 3; i++) {
        CHECK(Sys_Send_IntEvent(E1, 0));
        Sys_Yield();
        CHECK(heard == i); /* a handler that subscribes again gets the next message */
    }
    CHECK(Sys_Unregister_Event(E1));
}

static uint16 victims[3];
static uint8 chosen;
static bool kill_chosen(sys_event_data *data)
{
    (void)data;
    return Sys_Kill_Process(victims[chosen]);
}
static bool kill_in_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    (void)kill_chosen(data);
    return false;
}

static void a_condition_that_kills_its_owner(void)
{
    heard = 0;
    chosen = 0;
    uint16 heap = heap_now();
    CHECK(Sys_Register_Event(E1));
    victims[0] = start(spin, NULL, 0);
    CHECK(Sys_Subscribe_to_Event(E1, victims[0], in_order, kill_chosen) && Sys_Send_IntEvent(E1, 0));
    Sys_Yield();
    CHECK(heard == 0 && Sys_Get_ProcessState(victims[0]) == SYS_UNKNOWN);
    CHECK(Sys_Unregister_Event(E1) && heap_now() == heap);
}

static void hold_a_result(void *unused)
{
    (void)unused;
    const sys_event_data *data = Sys_Wait_for_Event(E1);
    note(data != NULL && data->value == 0x77 ? 'h' : '?');
    Sys_Sleep(2);
    note(data != NULL && data->value == 0x77 ? 'h' : '?');
}

/* Kills the first, the middle or the last waiter while the message is delivered, or while the waiter owns it. */
static void waiters_and_holders_die(void)
{
    static char all[] = "hhhh";
    for (uint8 i = 0; i < 6; i++) {
        bool holding = i >= 3;
        chosen = (uint8)(i % 3);
        forget();
        uint16 heap = heap_now();
        CHECK(Sys_Register_Event(E1));
        for (uint8 k = 0; k < 3; k++) {
            victims[k] = start(hold_a_result, NULL, 0);
        }
        CHECK(victims[2] != 0);
        Sys_Sleep(1);
        CHECK(holding || Sys_Subscribe_to_Event(E1, 0, kill_in_handler, NULL));
        CHECK(Sys_Send_IntEvent(E1, 0x77));
        Sys_Sleep(1);
        CHECK(!holding || Sys_Kill_Process(victims[chosen]));
        Sys_Sleep(10);
        CHECK(holding ? noted("hhhhh") : noted(all));
        CHECK(Sys_Unregister_Event(E1) && heap_now() == heap);
    }
}

/* Returns the number of threads that memory allows; they never run. */
static uint16 capacity(void)
{
    uint16 count = 0, first, pid;
    Sys_Start_CriticalSection();
    first = pid = start(spin, NULL, 0);
    while (pid != 0 && count < 60) {
        count++;
        pid = start(spin, NULL, 0);
    }
    while (Sys_Kill_Process(pid != 0 ? pid : first)) {
        first += pid == 0;
        pid = 0;
    }
    Sys_End_CriticalSection();
    Sys_Yield();
    return count;
}

static void an_event_registered_in_a_burst(void)
{
    uint16 heap = heap_now();
    CHECK(Sys_Register_Event(E1) && Sys_Subscribe_to_Event(E1, 0, listen, NULL));
    uint16 before = capacity(), sent = 0;
    Sys_Start_CriticalSection();
    while (sent < 40 && Sys_Send_IntEvent(E1, 0)) {
        sent++;
    }
    CHECK(Sys_Register_Event(E2) || Sys_Get_LastError() == SYS_ERROR_MEMORY);
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(before > 2 && capacity() + 1u >= before);
    (void)Sys_Unregister_Event(E2);
    CHECK(Sys_Unregister_Event(E1) && heap_now() == heap);
}

/* Two endless jobs beyond their deadlines must not starve the threads under round robin. */
static void late_jobs_starve_no_thread(void)
{
    sys_process_config config = {spin, NULL, 0, 0, SYS_PERIODIC, 20, 3};
    Sys_Set_Scheduler(&sys_earliest_deadline);
    uint16 a = Sys_Start_ProcessWith(&config), b = Sys_Start_ProcessWith(&config);
    uint32 begin = Sys_Get_SystemTime();
    CHECK(a != 0 && b != 0);
    for (uint8 i = 0; i < 5; i++) {
        Sys_Sleep(5);
    }
    CHECK(others_run());
    CHECK(Sys_Get_SystemTime() - begin < 400);
    Sys_Set_Scheduler(&sys_round_robin);
    CHECK(Sys_Kill_Process(a) && Sys_Kill_Process(b));
}

static void no_scheduler(void)
{
    CHECK(!Sys_Set_Scheduler(NULL) && Sys_Get_LastError() == SYS_ERROR_ARGUMENT);
    Sys_Yield();
    CHECK(others_run());
}

/* Messages longer than the transmit buffer: a robot writes faster than its line transmits, a host may not. */
static void long_messages(void)
{
    uint8 text[65];
    uint16 written = 0;
    for (uint8 i = 0; i < sizeof text; i++) {
        text[i] = '.';
    }
    heard = 0;
    CHECK(Sys_Subscribe_to_Event(SYS_UART1_READY, 0, in_order, NULL));
    while (written < MESSAGES && Sys_Write_UART1(text, sizeof text)) {
        written++;
    }
    bool is_full = written < MESSAGES;
    CHECK(written != 0 && (!is_full || Sys_Get_LastError() == SYS_ERROR_BUSY));
    Sys_Sleep(is_full ? 300 : 1);
    CHECK(!is_full || (heard == 1 && Sys_Write_UART1(text, sizeof text)));
    CHECK(Sys_Unsubscribe_Handler(SYS_UART1_READY, 0, in_order));
    Sys_Sleep(30);
}

void check_attacks(void)
{
    a_flood_is_refused();
    pids_go_round();
    every_event_number_is_good();
    sections_without_their_other_half();
    handlers_that_subscribe_each_other_again();
    a_condition_that_kills_its_owner();
    waiters_and_holders_die();
    an_event_registered_in_a_burst();
    late_jobs_starve_no_thread();
    no_scheduler();
    long_messages();
}
