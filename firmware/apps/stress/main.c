/* Starts and kills threads, registers and removes events, sends, waits and subscribes at random; reports every
 * second and checks, whenever everything is taken down, that the heap is as it was. README.md. */
#include <openswarm.h>
#include <openswarm_io.h>

#include <stdio.h>
#include <string.h>

enum { THREADS = 6, EVENTS = 8, FIRST = SYS_FIRST_USER_EVENT, ACTIONS_PER_ROUND = 200, LINE = 48 };

static uint16 pids[THREADS];
static uint16 empty_heap;
static uint32 handled, waited, refused;

/* 16-bit Galois LFSR, maximal length (taps 0xB400). The same numbers on every port. */
static uint16 lfsr = 0xACE1u;
static uint16 pick(uint16 below)
{
    lfsr = (uint16)(lfsr >> 1 ^ ((lfsr & 1u) ? 0xB400u : 0u));
    return (uint16)(lfsr % below);
}

static bool count(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    handled++;
    return data->value % 16 != 0; /* now and then a handler unsubscribes itself */
}

static bool odd(sys_event_data *data)
{
    return data->value % 2 != 0;
}

static void guest(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_ConditionTimeout((uint16)(FIRST + Sys_Get_ProcessID() % EVENTS), odd, 20);
        if (data == NULL && Sys_Get_LastError() == SYS_ERROR_EVENT) {
            Sys_Sleep(1);
        }
        waited += data != NULL;
        Sys_Clear_EventData(&data);
    }
}

static void short_lived(void)
{
    Sys_Sleep(2);
}

static void act(void)
{
    static const uint8 bytes[24];
    uint16 slot = pick(THREADS), event = (uint16)(FIRST + pick(EVENTS)), value = pick(1000);
    bool done = true;
    switch (pick(10)) {
    case 0:
        if (pids[slot] == 0) {
            pids[slot] = Sys_Start_Process(value % 4 == 0 ? short_lived : guest);
            done = pids[slot] != 0;
        }
        break;
    case 1:
        if (pids[slot] != 0) {
            Sys_Kill_Process(pids[slot]); /* it may have ended by itself */
            pids[slot] = 0;
        }
        break;
    case 2:
        done = Sys_Register_Event(event);
        break;
    case 3:
        done = value % 8 != 0 || Sys_Unregister_Event(event);
        break;
    case 4:
        done = Sys_Subscribe_to_Event(event, pids[slot], count, value % 2 ? odd : NULL);
        break;
    case 5:
        done = Sys_Unsubscribe_from_Event(event, pids[slot]);
        break;
    case 6:
        done = Sys_Send_Event(event, bytes, value % sizeof bytes);
        break;
    default:
        done = Sys_Send_IntEvent(event, value);
        break;
    }
    refused += !done;
}

static void take_down(void)
{
    for (uint16 i = 0; i < THREADS; i++) {
        if (pids[i] != 0) {
            Sys_Kill_Process(pids[i]);
            pids[i] = 0;
        }
    }
    for (uint16 e = 0; e < EVENTS; e++) {
        Sys_Unregister_Event((uint16)(FIRST + e));
    }
    Sys_Sleep(5); /* queued messages are delivered or dropped; short threads end */
    SYS_ASSERT(Sys_Get_Statistics()->heap_used == empty_heap);
}

static void say(const char *format, uint32 a, uint32 b)
{
    char line[LINE];
    snprintf(line, sizeof line, format, (unsigned long)a, (unsigned long)b);
    Sys_Send_Event(SYS_SEND_UART1, line, (uint16)strlen(line));
    Sys_Sleep(10); /* the line is sent before the next one needs the buffer */
}

static void report(void)
{
    const sys_statistics *s = Sys_Get_Statistics();
    say("%lu ms: %lu handled\r\n", Sys_Get_SystemTime(), handled);
    say("  %lu waited, %lu refused\r\n", waited, refused);
    say("  heap %lu, peak %lu\r\n", s->heap_used, s->heap_peak);
    say("  %lu lost, kernel stack left %lu\r\n", s->events_lost, Sys_Get_UnusedKernelStack());
}

static void driver(void *unused)
{
    uint32 next_report = 1000;
    (void)unused;
    for (;;) {
        for (uint16 i = 0; i < ACTIONS_PER_ROUND; i++) {
            act();
            if (pick(4) == 0) {
                Sys_Sleep(1);
            }
        }
        take_down();
        if (Sys_Get_SystemTime() >= next_report) {
            report();
            next_report += 1000;
        }
    }
}

int main(void)
{
    static const sys_process_config config = {driver, NULL, SYS_DEFAULT_STACK * 3, 0, 0, 0, 0};
    Sys_Init_Kernel();
    Sys_Start_ProcessWith(&config);
    empty_heap = Sys_Get_Statistics()->heap_used;
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
