/* The application of test_gate.py, which plants regressions and harmless changes in it: a ferry with crates. */
#include <openswarm.h>
#include <openswarm_cleanup.h>
#include <openswarm_interrupt.h>
#include <openswarm_io.h>
#include <openswarm_mutex.h>

enum { EVENT_LOAD = SYS_FIRST_USER_EVENT, EVENT_DONE, CRATES = 3 };

static volatile uint16 total, bells, done;
static volatile uint16 deck[16];
static const uint16 weights[16] = {3, 1, 4, 1, 5, 9, 2, 6, 5, 3, 5, 8, 9, 7, 9, 3};
static sys_mutex ramp = SYS_MUTEX(0);
static sys_cleanup tidy[3];

/* Returns the weight of a crate. */
__attribute__((noinline)) static uint16 weigh(uint16 crate)
{
    uint16 weight = weights[crate % 16];
    return weight;
}

static bool on_load(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    total += weigh(data->value);
    return true;
}

static bool on_done(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event;
    for (uint16 i = 0; i < 4; i++) {
        deck[i] = data->value;
    }
    return true;
}

static void on_bell(void)
{
    bells++;
}
SYS_INTERRUPT(INT1, 4, on_bell)

static void nothing(void *unused)
{
    (void)unused;
}

static void loader(void *unused)
{
    (void)unused;
    for (uint16 crate = 0;; crate++) {
        for (uint16 i = 0; i < CRATES; i++) {
            Sys_Send_IntEvent(EVENT_LOAD, crate + i);
        }
        Sys_Lock_Mutex(&ramp);
        Sys_Unlock_Mutex(&ramp);
        Sys_Raise_Interrupt(INT1);
        Sys_Sleep(3);
    }
}

static void unloader(void *unused)
{
    (void)unused;
    Sys_Push_Cleanup(&tidy[0], nothing, NULL);
    for (;;) {
        Sys_Start_CriticalSection();
        total = 0;
        Sys_End_CriticalSection();
        Sys_Send_Event(EVENT_DONE, (const void *)deck, 8);
        Sys_Sleep(7);
    }
}

static void keeper(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(EVENT_DONE);
        done += data->value;
        Sys_Clear_EventData(&data);
    }
}

static const sys_process_config of_loader = {.entry = loader, .stack = 160};
static const sys_process_config of_unloader = {.entry = unloader, .stack = 144};
static const sys_process_config of_keeper = {.entry = keeper, .stack = 128};

int main(void)
{
    Sys_Init_Kernel();
    Sys_Register_Event(EVENT_LOAD);
    Sys_Register_Event(EVENT_DONE);
    Sys_Subscribe_to_Event(EVENT_LOAD, 0, on_load, NULL);
    Sys_Subscribe_to_Event(EVENT_DONE, 0, on_done, NULL);
    Sys_Start_ProcessWith(&of_loader);
    Sys_Start_ProcessWith(&of_unloader);
    Sys_Start_ProcessWith(&of_keeper);
    Sys_Enable_Interrupt(INT1);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
}
