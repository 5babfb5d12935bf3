/* Equal threads that never yield, beside a waiting one. The firmware counts turns; the test observes switches. */
#include <openswarm.h>

enum { SPINNERS = 8, SLICES, SLEEPER_WOKEN_FIRST, SLEEPER_ROUND_ROBIN };

volatile uint16 scene __attribute__((used));
volatile uint16 turns __attribute__((used)), rounds __attribute__((used)), slept_most __attribute__((used));
volatile uint16 spins[SPINNERS] __attribute__((used));
static const volatile uint16 *volatile latest;

static void spin(void *mine)
{
    for (;;) {
        ++*(volatile uint16 *)mine;
        if (latest != mine) {
            latest = mine;
            turns++;
        }
    }
}

static void wait_for_ticks(void *unused)
{
    (void)unused;
    for (;;) {
        sys_event_data *data = Sys_Wait_for_Event(SYS_1ms_TIMER);
        rounds++;
        Sys_Clear_EventData(&data);
    }
}

static void sleep_for_ticks(void *unused)
{
    (void)unused;
    for (;;) {
        uint16 before = (uint16)Sys_Get_SystemTime();
        Sys_Sleep(1);
        uint16 slept = (uint16)((uint16)Sys_Get_SystemTime() - before);
        if (slept > slept_most) {
            slept_most = slept;
        }
        rounds++;
    }
}

static void start(void (*entry)(void *), volatile uint16 *arg, uint8 priority)
{
    sys_process_config config = {entry, (void *)arg, 0, priority, 0, 0, 0};
    SYS_ASSERT(Sys_Start_ProcessWith(&config) != 0);
}

/* Breakpoint of the test, which sets `scene` here. */
__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

int main(void)
{
    Sys_Init_Kernel();
    begin();
    if (scene == SLICES) {
        Sys_Set_Scheduler(&sys_fixed_priority);
        start(wait_for_ticks, NULL, 1);
    } else {
        if (scene == SLEEPER_WOKEN_FIRST) {
            Sys_Set_Scheduler(&sys_woken_first);
        }
        start(sleep_for_ticks, NULL, 0);
    }
    for (uint16 i = 0; i < (scene == SLICES ? 2 : SPINNERS); i++) {
        start(spin, &spins[i], 0);
    }
    Sys_Start_Kernel();
    Sys_Run_SystemThread();
    return 0;
}
