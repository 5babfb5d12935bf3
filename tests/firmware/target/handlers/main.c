/* Overflows of the kernel stack by handlers, conditions, interrupts and schedulers; `kind` selects the case. */
#include <openswarm.h>
#include <openswarm_scheduler.h>

#include <p30F6014A.h>
#include <stdio.h>

enum { HEARD = SYS_FIRST_USER_EVENT, FORMATTED, RECURSIVE, LARGE, FULL, CONDITION, INTERRUPT, SCHEDULER };

volatile uint16 kind __attribute__((used)), rounds __attribute__((used));
volatile uint16 sink;
static volatile double number = 1.5;

__attribute__((noinline)) static uint16 chain(uint16 depth)
{
    return (uint16)(depth == 0 ? sink : chain((uint16)(depth - 1)) + sink);
}

__attribute__((noinline)) static void fill(volatile uint8 *bytes, uint16 size)
{
    for (uint16 i = 0; i < size; i++) {
        bytes[i] = 0xEE;
    }
}

__attribute__((noinline)) static void formats(void)
{
    static char text[16];
    snprintf(text, sizeof text, "%f", number);
}

__attribute__((noinline)) static void large_frame(void)
{
    volatile uint8 bytes[300];
    fill(bytes, sizeof bytes);
}

__attribute__((noinline)) static void calls_without_room(void)
{
    volatile uint8 bytes[128]; /* leaves less stack than a kernel call needs, without an overflow */
    fill(bytes, sizeof bytes);
    Sys_Send_IntEvent(HEARD, bytes[0]);
}

static bool deep_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    switch (kind) {
    case FORMATTED:
        formats();
        break;
    case RECURSIVE:
        sink = chain(100);
        break;
    case LARGE:
        large_frame();
        break;
    case FULL:
        calls_without_room();
        break;
    default:
        break;
    }
    return true;
}

static bool deep_condition(sys_event_data *data)
{
    (void)data;
    sink = kind == CONDITION ? chain(100) : 0;
    return true;
}

__attribute__((used)) void deep_isr(void)
{
    IFS1bits.INT1IF = 0;
    sink = chain(100);
}

static sys_pcb *deep_pick(sys_pcb *first)
{
    sink = chain(100);
    return first;
}

static void worker(void)
{
    static const sys_scheduler deep = {deep_pick, false};
    for (;;) {
        rounds++;
        Sys_Send_IntEvent(HEARD, rounds);
        if (rounds == 10) {
            if (kind == INTERRUPT) {
                IFS1bits.INT1IF = 1;
            } else if (kind == SCHEDULER) {
                Sys_Set_Scheduler(&deep);
            }
            Sys_Subscribe_to_Event(HEARD, 0, deep_handler, deep_condition);
        }
        Sys_Yield();
    }
}

/* Breakpoint of the test, which sets `kind` here. */
__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

int main(void)
{
    Sys_Init_Kernel();
    begin();
    Sys_Register_Event(HEARD);
    Sys_Start_Process(worker);
    Sys_Start_Process(worker);
    IPC4bits.INT1IP = 4;
    IEC1bits.INT1IE = 1;
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
