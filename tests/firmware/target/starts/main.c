/* Sets a scheduler before or after threads exist and before or after Sys_Start_Kernel; the test selects the case. */
#include <openswarm.h>

enum { NEVER, FIRST, BEHIND_THREADS, AFTER_START };

volatile uint16 scheduler __attribute__((used)), moment __attribute__((used));
volatile uint16 rounds[2] __attribute__((used)), periods __attribute__((used)), spins __attribute__((used));

static void set_at(uint16 now)
{
    static const sys_scheduler *const all[] = {&sys_round_robin, &sys_fixed_priority, &sys_earliest_deadline, &sys_woken_first};
    if (moment == now) {
        (void)Sys_Set_Scheduler(all[scheduler]);
    }
}

static void sleeper(void *counter)
{
    for (;;) {
        ++*(volatile uint16 *)counter;
        Sys_Sleep(2);
    }
}

static void busy(void *unused) /* never yields */
{
    (void)unused;
    for (;;) {
        spins++;
    }
}

static void periodic(void *unused)
{
    (void)unused;
    for (;;) {
        periods++;
        (void)Sys_Wait_for_Period();
    }
}

/* Breakpoint of the test, which sets scheduler and instant here. */
__attribute__((noinline, used)) void begin(void)
{
    __asm__ volatile("nop" ::: "memory");
}

int main(void)
{
    static const sys_process_config threads[] = {
        {sleeper, (void *)&rounds[0], 0, 2, 0, 0, 0},
        {sleeper, (void *)&rounds[1], 0, 0, 0, 0, 0},
        {busy, NULL, 0, 1, 0, 0, 0},
        {periodic, NULL, 0, 3, SYS_PERIODIC, 5, 5},
    };
    Sys_Init_Kernel();
    begin();
    set_at(FIRST);
    for (uint16 i = 0; i < sizeof threads / sizeof *threads; i++) {
        (void)Sys_Start_ProcessWith(&threads[i]);
    }
    set_at(BEHIND_THREADS);
    Sys_Start_Kernel();
    set_at(AFTER_START);
    Sys_Run_SystemThread();
    return 0;
}
