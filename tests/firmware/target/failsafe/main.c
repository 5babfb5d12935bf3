/* A robot that drives until a fault of a chosen kind. After a reset it holds the cause in `cause` and stops at `again`. */
#include <openswarm.h>
#include <openswarm_reset.h>

enum { TRAP, ASSERTION, OVERFLOW, SECTION, HANDLER, NO_FAULT };

volatile uint16 kind __attribute__((used));
sys_reset_cause cause __attribute__((used));
static volatile uint16 depth;

__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

__attribute__((noinline, used)) void fault(void)
{
    __asm__ volatile("nop" ::: "memory");
}

__attribute__((noinline)) static uint16 recurse(uint16 n)
{
    volatile uint16 room[4];
    room[0] = n;
    return n == 0 ? depth : (uint16)(recurse((uint16)(n - 1u)) + room[0]);
}

static void hang(void)
{
    for (;;) {
        __asm__ volatile("nop" ::: "memory");
    }
}

static bool hang_in_handler(uint16 pid, uint16 event, sys_event_data *data)
{
    (void)pid, (void)event, (void)data;
    fault();
    hang();
    return true;
}

static void drive(void)
{
    Sys_Send_IntEvent(SYS_LEFTMOTOR_SPEED, 100);
    Sys_Send_IntEvent(SYS_RIGHTMOTOR_SPEED, 100);
    Sys_Sleep(20);
    switch (kind) {
    case TRAP:
        fault();
        *(volatile uint16 *)0x9001 = 1; /* an odd address */
        break;
    case ASSERTION:
        fault();
        SYS_ASSERT(depth != 0);
        break;
    case OVERFLOW:
        fault();
        depth = recurse(100);
        break;
    case SECTION:
        Sys_Start_CriticalSection();
        fault();
        hang();
        break;
    case HANDLER:
        (void)Sys_Subscribe_to_Event(SYS_1ms_TIMER, 0, hang_in_handler, NULL);
        break;
    default:
        fault();
        break;
    }
}

int main(void)
{
    Sys_Init_Kernel();
    cause = *Sys_Get_ResetCause();
    begin();
    SYS_ASSERT(Sys_Start_HardwareWatchdog());
    Sys_Start_Process(drive);
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
