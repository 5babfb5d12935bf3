/* Threads that overflow their stacks in different ways, beside two correct threads; `kind` selects the case. */
#include <openswarm.h>

#include <stdarg.h>

volatile uint16 kind __attribute__((used));
volatile uint16 before_pid __attribute__((used)), culprit_pid __attribute__((used)), after_pid __attribute__((used));
volatile uint16 rounds[2] __attribute__((used));
volatile uint16 ended __attribute__((used));
volatile uint16 sink;

extern void overflow_by_push(void), overflow_at_interrupt(void);

static void innocent_one(void)
{
    for (;;) {
        rounds[0]++;
        Sys_Yield();
    }
}

static void innocent_two(void)
{
    for (;;) {
        rounds[1]++;
        Sys_Yield();
    }
}

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

__attribute__((noinline)) static void large_frame(void)
{
    volatile uint8 bytes[200];
    fill(bytes, sizeof bytes);
}

__attribute__((noinline)) static uint16 sum(int count, ...)
{
    va_list list;
    uint16 total = 0;
    va_start(list, count);
    while (count-- > 0) {
        total = (uint16)(total + va_arg(list, unsigned));
    }
    va_end(list);
    return total;
}

static void kernel_call_without_room(void)
{
    volatile uint8 bytes[60]; /* leaves less stack than a kernel function needs, without an overflow */
    fill(bytes, sizeof bytes);
    Sys_Send_IntEvent(SYS_FIRST_USER_EVENT, bytes[0]);
}

static void culprit(void)
{
    Sys_Yield();
    switch (kind) {
    case 0:
        overflow_by_push();
        break;
    case 1:
        sink = chain(100);
        break;
    case 2:
        large_frame();
        break;
    case 3:
        sink = sum(40, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27,
                   28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39, 40);
        break;
    case 4:
        kernel_call_without_room();
        break;
    case 5:
        overflow_at_interrupt();
        break;
    default:
        innocent_one();
        break;
    }
}

static bool on_end(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    ended = data->value;
    return true;
}

static bool ignore(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid;
    (void)event;
    (void)data;
    return true;
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
    Sys_Register_Event(SYS_FIRST_USER_EVENT);
    Sys_Subscribe_to_Event(SYS_FIRST_USER_EVENT, 0, ignore, NULL);
    Sys_Subscribe_to_Event(SYS_EVENT_TERMINATION, 0, on_end, NULL);
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    before_pid = Sys_Start_Process(innocent_one);
    culprit_pid = Sys_Start_Process(culprit);
    after_pid = Sys_Start_Process(innocent_two);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
