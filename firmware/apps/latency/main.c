/* Scenarios whose exact cycles are counted from outside, between symbols. README.md. */
#include "latency.h"

volatile latency_scenario latency_wanted __attribute__((used));

static const uint8 payload[24];

#define STOP(name)                                                    \
    __attribute__((noinline, used)) void name(void)                   \
    {                                                                 \
        __asm__ volatile("nop" ::: "memory");                         \
    }

STOP(latency_begin)
STOP(latency_ready)

/* Functions with symbols of their own, by which a host detects the first instruction of a handler or a woken thread. */
__attribute__((noinline, used)) bool latency_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    __asm__ volatile("nop" ::: "memory");
    return true;
}

static bool second(uint16 pid, uint16 event, sys_event_data *data)
{
    return latency_handler(pid, event, data);
}

static bool third(uint16 pid, uint16 event, sys_event_data *data)
{
    return latency_handler(pid, event, data);
}

static bool fourth(uint16 pid, uint16 event, sys_event_data *data)
{
    return latency_handler(pid, event, data);
}

static const sys_handler handlers[4] = {latency_handler, second, third, fourth};

__attribute__((noinline, used)) void latency_spin(void)
{
    for (;;) {
        __asm__ volatile("nop" ::: "memory");
    }
}

__attribute__((noinline, used)) void latency_yield(void)
{
    for (;;) {
        Sys_Yield();
        __asm__ volatile("nop" ::: "memory");
    }
}

__attribute__((noinline, used)) void latency_woken(void)
{
    __asm__ volatile("nop" ::: "memory");
}

static void wait(void)
{
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(LATENCY_WAITED);
        latency_woken();
        Sys_Clear_EventData(&data);
    }
}

/* The cost of sending is measured from the call of this function to its return. */
__attribute__((noinline, used)) bool latency_send(uint16 event)
{
    return Sys_Send_Event(event, payload, latency_wanted.payload);
}

static void send(void)
{
    for (;;) {
        latency_send(latency_wanted.sender == 1 ? LATENCY_EVENT : LATENCY_WAITED);
        Sys_Yield();
    }
}

void latency_isr(void) __attribute__((used));
void latency_isr(void)
{
    latency_send(LATENCY_EVENT);
}

int main(void)
{
    Sys_Init_Kernel();
    latency_begin();
    for (uint16 i = 0; i < latency_wanted.events; i++) {
        Sys_Register_Event(LATENCY_WAITED + 1 + i);
    }
    Sys_Register_Event(LATENCY_EVENT);
    Sys_Register_Event(LATENCY_WAITED);
    for (uint16 i = 0; i < latency_wanted.subscribers; i++) {
        Sys_Subscribe_to_Event(LATENCY_EVENT, 0, handlers[i], NULL);
    }
    for (uint16 i = 0; i < latency_wanted.waiters; i++) {
        Sys_Start_Process(wait);
    }
    for (uint16 i = 0; i < latency_wanted.threads; i++) {
        Sys_Start_Process(latency_spin);
    }
    for (uint16 i = 0; i < latency_wanted.yielders; i++) {
        Sys_Start_Process(latency_yield);
    }
    if (latency_wanted.sender != 0) {
        Sys_Start_Process(send);
    }
    Sys_Start_Kernel();
    latency_ready();
    Sys_Run_SystemThread();
    return 0;
}
