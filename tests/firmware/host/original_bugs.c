/* Weaknesses of the original system (openswarm-original.md §7), one named test for each. Those that only exist on the
 * chip (register save areas, DSP state, stack limits) are tested in tests/firmware/kernel/test_kernel_on_target.py
 * under the same numbers. */
#include "test.h"

static int calls;
static uint16 seen[16];

static bool count_and_keep(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    if (calls < 16) {
        seen[calls] = data->value;
    }
    calls++;
    return true;
}

static int evaluations;
static bool third_time(sys_event_data *data)
{
    (void)data;
    return ++evaluations == 3;
}

static int woken;
static sys_event_data result_seen;
static void wait_third(void)
{
    sys_event_data *data = Sys_Wait_for_Condition(E1, third_time);
    CHECK(data != NULL);
    result_seen = *data;
    woken++;
    Sys_Clear_EventData(&data);
    CHECK(data == NULL);
}

TEST(bug_01_a_false_condition_is_evaluated_once_per_event, "§7.1: the condition loop re-evaluated until true")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Start_Process(wait_third);
    Sys_Yield();
    for (uint16 i = 1; i <= 3; i++) {
        CHECK_EQ(woken, 0);
        Sys_Send_IntEvent(E1, (uint16)(10 * i));
        Sys_Yield();
        CHECK_EQ(evaluations, i);
    }
    Sys_Yield();
    CHECK_EQ(woken, 1);
    CHECK_EQ(result_seen.value, 30);
}

TEST(bug_02_the_waiter_gets_the_data_it_was_woken_for, "§7.2: wake-up freed the node it stood on; Wait returned 0")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    evaluations = 2;
    Sys_Start_Process(wait_third);
    Sys_Yield();
    Sys_Send_Event(E1, "abcdef", 6);
    Sys_Yield();
    Sys_Yield();
    CHECK_EQ(woken, 1);
    CHECK_EQ(result_seen.size, 6);
    CHECK_EQ(result_seen.value, 'a' | 'b' << 8);
    CHECK_EQ(heap_now(), before);
}

static void note_a(void) { for (;;) { note('a'); Sys_Yield(); } }
static void wait_e1(void)
{
    sys_event_data *data = Sys_Wait_for_Event(E1);
    note('w');
    Sys_Clear_EventData(&data);
}

TEST(bug_03_a_blocked_thread_is_never_switched_to, "§7.3: round robin followed a link into the blocked list")
{
    boot();
    Sys_Register_Event(E1);
    uint16 a = Sys_Start_Process(note_a);
    uint16 w = Sys_Start_Process(wait_e1);
    for (int i = 0; i < 20; i++) {
        Sys_Yield();
    }
    CHECK(strchr(trace, 'w') == NULL);
    CHECK_EQ(Sys_Get_ProcessState(w), SYS_BLOCKED);
    CHECK_EQ(Sys_Get_ProcessState(a), SYS_READY);
}

static void end_at_once(void) { note('e'); }

TEST(bug_04_lists_survive_removal_of_every_position, "§7.4: removing the last element wrote through NULL")
{
    boot();
    for (unsigned order = 0; order < 6; order++) {
        static const uint8 permutations[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
        uint16 id[3] = {E1, E2, E3}, pid[3];
        uint16 before = heap_now();
        for (int i = 0; i < 3; i++) {
            CHECK(Sys_Register_Event(id[i]));
            pid[i] = Sys_Start_Process(note_a);
            for (int k = 0; k < 3; k++) {
                CHECK(i < k || Sys_Subscribe_to_Event(id[k], pid[i], count_and_keep, NULL));
            }
        }
        for (int i = 0; i < 3; i++) {
            uint8 victim = permutations[order][i];
            CHECK(Sys_Kill_Process(pid[victim]));
            CHECK(Sys_Unregister_Event(id[victim]));
            CHECK(!Sys_IsEventRegistered(id[victim]));
            CHECK(lists_are_well_formed());
        }
        CHECK_EQ(heap_now(), before);
    }
}

TEST(bug_05_killing_ends_every_subscription_and_returns, "§7.5: Unsubscribe_Process looped for ever")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    uint16 pid = Sys_Start_Process(note_a);
    Sys_Subscribe_to_Event(E1, pid, count_and_keep, NULL);
    Sys_Subscribe_to_Event(E2, pid, count_and_keep, NULL);
    Sys_Send_IntEvent(E1, 1);
    CHECK(Sys_Kill_Process(pid));
    Sys_Send_IntEvent(E2, 2);
    Sys_Yield();
    CHECK_EQ(calls, 0);
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_UNKNOWN);
    CHECK(!Sys_Kill_Process(pid));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_PROCESS);
}

static void kill_self(void)
{
    note('k');
    Sys_Kill_Process(Sys_Get_ProcessID());
    note('!');
}

TEST(bug_06_killing_oneself_saves_nothing_into_another_thread, "§7.6: the dying context landed in the predecessor's PCB")
{
    boot();
    uint16 before = heap_now();
    uint16 a = Sys_Start_Process(note_a);
    for (int i = 0; i < 5; i++) {
        uint16 k = Sys_Start_Process(kill_self);
        Sys_Yield();
        Sys_Yield();
        CHECK_EQ(Sys_Get_ProcessState(k), SYS_UNKNOWN);
    }
    CHECK(strchr(trace, '!') == NULL);
    CHECK_EQ(Sys_Get_ProcessState(a), SYS_READY);
    Sys_Kill_Process(a);
    CHECK_EQ(heap_now(), before);
}

TEST(bug_08_unregister_and_unsubscribe_free_exactly_their_own, "§7.8: the previous event's subscribers were freed")
{
    boot();
    uint16 before = heap_now();
    Sys_Register_Event(E1);
    Sys_Register_Event(E2);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, NULL);
    Sys_Subscribe_to_Event(E2, 0, count_and_keep, NULL);
    CHECK(Sys_Unregister_Event(E2));
    Sys_Send_IntEvent(E1, 7);
    Sys_Yield();
    CHECK_EQ(calls, 1);
    CHECK(Sys_Unsubscribe_from_Event(E1, 0));
    CHECK(!Sys_Unsubscribe_from_Event(E1, 0));
    CHECK(!Sys_Unsubscribe_from_Event(E_NEVER, 0));
    CHECK_EQ(Sys_Get_LastError(), SYS_ERROR_EVENT);
    CHECK(Sys_Unregister_Event(E1));
    CHECK(!Sys_Unregister_Event(E1));
    CHECK_EQ(heap_now(), before);
}

static bool never(sys_event_data *data)
{
    (void)data;
    return false;
}
static bool data_is_there(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid, (void)id;
    CHECK(data != NULL && data->payload != NULL);
    calls++;
    return true;
}

TEST(bug_09_a_handler_never_gets_null_data, "§7.9: called with NULL when a condition failed or an ID occurred twice")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, never);
    Sys_Subscribe_to_Event(E1, 0, data_is_there, NULL);
    Sys_Send_IntEvent(E1, 1);
    Sys_Send_IntEvent(E1, 2);
    Sys_Send_Event(E1, NULL, 0);
    Sys_Yield();
    CHECK_EQ(calls, 3);
}

TEST(bug_10_clearing_event_data_reads_nothing_after_free, "§7.10; the address sanitizer watches")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Start_Process(wait_e1);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    Sys_Yield();
    CHECK(strchr(trace, 'w') != NULL);
    sys_event_data *none = NULL;
    Sys_Clear_EventData(&none);
    Sys_Clear_EventData(NULL);
}

TEST(bug_11_waiting_leaves_subscriptions_alone, "§7.11: Wait unlinked an own subscription with the same condition")
{
    boot();
    Sys_Register_Event(E1);
    uint16 w = Sys_Start_Process(wait_e1);
    Sys_Subscribe_to_Event(E1, w, count_and_keep, NULL);
    Sys_Subscribe_to_Event(E1, 0, data_is_there, NULL);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    CHECK_EQ(calls, 2);
    Sys_Yield();
    Sys_Send_IntEvent(E1, 2);
    Sys_Yield();
    CHECK_EQ(calls, 3); /* thread w has ended in the meantime, and so has its subscription */
}

TEST(bug_11b_removing_one_handler_compares_each_element, "§7.11b: the head's handler was compared instead")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, NULL);
    CHECK(!Sys_Unsubscribe_Handler(E1, 0, data_is_there));
    Sys_Subscribe_to_Event(E1, 0, data_is_there, NULL);
    CHECK(Sys_Unsubscribe_Handler(E1, 0, data_is_there));
    Sys_Send_IntEvent(E1, 5);
    Sys_Yield();
    CHECK_EQ(calls, 1);
    CHECK_EQ(seen[0], 5);
}

TEST(bug_12_sending_does_not_end_a_critical_section_nor_lose_its_tick, "§7.12")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, NULL);
    Sys_Start_Process(note_a);
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    host_slice();
    Sys_Send_IntEvent(E1, 1);
    host_tick();
    Sys_End_CriticalSection();
    CHECK_EQ(calls, 0);
    CHECK_EQ(trace[0], '\0');
    Sys_End_CriticalSection(); /* the tick that occurred in the section is handled here */
    CHECK_EQ(calls, 1);
    CHECK_EQ(trace[0], 'a');
}

static void send_from_isr(void)
{
    CHECK(Sys_Send_IntEvent(E1, 3));
}
static void interrupt_now(void)
{
    host_device(send_from_isr);
}

TEST(bug_13_events_from_threads_and_interrupts_mix_at_every_point, "§7.13: event lists were shared without locks")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, NULL);
    Sys_Send_IntEvent(E1, 1); /* allocates the message, which a free list supplies from now on */
    Sys_Yield();
    unsigned long start = host_unlocks();
    Sys_Send_IntEvent(E1, 1);
    Sys_Yield();
    unsigned long points = host_unlocks() - start;
    CHECK(points >= 4);
    for (unsigned long n = 1; n <= points; n++) {
        calls = 0;
        uint16 before = heap_now();
        host_at_unlock(n, interrupt_now);
        Sys_Send_IntEvent(E1, 1);
        Sys_Yield();
        Sys_Yield();
        host_at_unlock(0, NULL);
        CHECK_EQ(calls, 2);
        CHECK_EQ(seen[0] + seen[1], 4);
        CHECK_EQ(heap_now(), before);
    }
}

static void in_critical_section(void)
{
    Sys_Start_CriticalSection();
    Sys_Start_CriticalSection();
    note('c');
    /* ends within the section: the kernel ends the thread's sections */
}

TEST(bug_14_nesting_does_not_leak_between_contexts, "§7.14: one global nesting counter was shared by all contexts")
{
    boot();
    Sys_Start_Process(in_critical_section);
    Sys_Yield();
    CHECK_EQ(trace[0], 'c');
    Sys_Start_CriticalSection();
    Sys_End_CriticalSection();
    Sys_Start_Process(note_a);
    host_slice();
    CHECK_EQ(trace[1], 'a');
}

TEST(bug_15_system_time_has_32_bits_and_counts_each_tick, "§7.15: 1.1 ms ticks and a 16-bit uint32")
{
    boot();
    CHECK_EQ(sizeof(uint32), 4);
    for (long i = 0; i < MANY_TICKS; i++) {
        host_tick();
    }
    CHECK(Sys_Get_SystemTime() >= MANY_TICKS && Sys_Get_SystemTime() < MANY_TICKS + 5000); /* robot: real time */
}

TEST(bug_17_the_newest_motor_speed_of_a_slot_wins, "§7.17: motor handlers used the oldest value")
{
    boot();
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 10);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 20);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, (uint16)-30);
    Sys_Yield();
    CHECK_EQ(host_left(), 20);
    CHECK_EQ(host_right(), -30);
}

TEST(bug_18_memory_neither_fragments_nor_leaks_under_events, "§7.18: malloc in ISRs, tiny blocks")
{
    boot();
    Sys_Register_Event(E1);
    Sys_Subscribe_to_Event(E1, 0, count_and_keep, NULL);
    uint16 before = heap_now();
    uint8 bytes[SYS_SMALL_PAYLOAD] = {0};
    for (unsigned i = 0; i < 5000; i++) {
        for (uint16 d = 0; d < 5; d++) {
            CHECK(Sys_Send_Event(E1, bytes, (uint16)((i * 7 + d * 13) % sizeof bytes)));
        }
        Sys_Yield();
    }
    CHECK_EQ(calls, 25000);
    CHECK_EQ(heap_now(), before);
}

static void wait_and_note(void)
{
    sys_event_data *data = Sys_Wait_for_Event(E1);
    CHECK(data != NULL);
    CHECK_EQ(data->value, 42);
    note('w');
    Sys_Yield();
    CHECK_EQ(data->value, 42);
    Sys_Clear_EventData(&data);
}

TEST(bug_20_several_threads_wait_for_one_event, "§7.20: a second waiter overwrote the first")
{
    boot();
    Sys_Register_Event(E1);
    uint16 before = heap_now();
    for (int i = 0; i < 3; i++) {
        Sys_Start_Process(wait_and_note);
    }
    Sys_Yield();
    Sys_Send_IntEvent(E1, 42);
    for (int i = 0; i < 4; i++) {
        Sys_Yield();
    }
    CHECK(strcmp(trace, "www") == 0);
    CHECK_EQ(heap_now(), before);
}

TEST(bug_23_a_thread_function_may_return, "§7.23: returning popped garbage")
{
    boot();
    uint16 before = heap_now();
    uint16 pid = Sys_Start_Process(end_at_once);
    Sys_Yield();
    CHECK_EQ(trace[0], 'e');
    CHECK_EQ(Sys_Get_ProcessState(pid), SYS_UNKNOWN);
    CHECK_EQ(heap_now(), before);
}

static void raise_priority_note(void *c)
{
    note(*(const char *)c);
}

TEST(bug_23b_priorities_are_read, "§7.23: priorities were stored and ignored")
{
    boot();
    Sys_Set_Scheduler(&sys_fixed_priority);
    sys_process_config low = {raise_priority_note, "l", 0, 1, 0, 0, 0};
    sys_process_config high = {raise_priority_note, "h", 0, 9, 0, 0, 0};
    Sys_Start_CriticalSection();
    Sys_Start_ProcessWith(&low);
    Sys_Start_ProcessWith(&high);
    Sys_End_CriticalSection();
    Sys_Yield();
    CHECK(strcmp(trace, "hl") == 0);
}

TEST(bug_24_the_right_wheel_getter_returns_the_right_speed, "§7.24")
{
    boot();
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 11);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, 22);
    Sys_Yield();
    CHECK_EQ(Sys_Get_MotorSpeed_Left(), 11);
    CHECK_EQ(Sys_Get_MotorSpeed_Right(), 22);
}

static char uart_text[2][32];
static size_t uart_size[2];
static void capture(uint8 uart, uint8 byte)
{
    uart_text[uart][uart_size[uart]++] = (char)byte;
}

TEST(bug_24b_each_uart_sends_its_own_bytes, "§7.24: UART2 wrote the register of UART1")
{
    boot();
    host_uart_sink(capture);
    CHECK(Sys_Write_UART1("one", 3));
    CHECK(Sys_Write_UART2("two", 3));
    CHECK(strcmp(uart_text[0], "one") == 0 && strcmp(uart_text[1], "two") == 0);
}

TEST(bug_25_registering_twice_is_no_failure, "§7.25")
{
    boot();
    uint16 before = heap_now();
    CHECK(Sys_Register_Event(SYS_1ms_TIMER));
    CHECK_EQ(heap_now(), before);
}
