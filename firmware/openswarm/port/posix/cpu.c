/* SPDX-License-Identifier: MIT */
/* POSIX port of hal_cpu.h. Every thread, and the kernel stack, is a fiber; the level is a variable. Interrupts set
 * pending flags and are taken on arrival or in hal_unlock(), once the level is low enough. */
#include "fiber.h"
#include "host.h"
#include "kernel.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

enum { THREAD, SLICE, DEVICE, DEVICES_WAITING = 8, SLICE_MS = 10 };

typedef struct {
    fiber *fiber;
    void (*entry)(void *);
    void *arg;
} context; /* sys_pcb.sp points to it */

static volatile sig_atomic_t level;
static volatile sig_atomic_t slice_over, slice_forced;
static volatile sig_atomic_t slice_ms; /* elapsed ms of the slice */
static volatile sig_atomic_t ticks_pending;
static void (*volatile waiting[DEVICES_WAITING])(void);
static volatile unsigned first_waiting, last_waiting;

static bool virtual_time;
static uint32_t idles;
static void (*idle_hook)(uint32_t);
static unsigned long unlocks, unlock_target, allocations, allocation_target;
static void (*unlock_hook)(void);

static fiber *kernel;
static hal_pick kernel_pick;
static context main_context;

/* ---- Levels and interrupts -------------------------------------------------------------------------------------- */

static hal_lock_state raise_to(int wanted)
{
    int before = level;
    if (before < wanted) {
        level = wanted;
    }
    hal_barrier();
    return before;
}

hal_lock_state hal_lock_slice(void)
{
    return raise_to(SLICE);
}

hal_lock_state hal_lock_devices(void)
{
    return raise_to(DEVICE);
}

static void take_devices(void)
{
    level = DEVICE;
    for (;;) {
        if (ticks_pending > 0) {
            __atomic_fetch_sub(&ticks_pending, 1, __ATOMIC_SEQ_CST); /* a signal may add one meanwhile */
            os_clock_tick();
        } else if (first_waiting != last_waiting) {
            void (*isr)(void) = waiting[first_waiting % DEVICES_WAITING];
            first_waiting++;
            isr();
        } else {
            return;
        }
    }
}

static void end_slice(void);

static void take_interrupts(void)
{
    while ((level < DEVICE && (ticks_pending > 0 || first_waiting != last_waiting)) ||
           (level < SLICE && (slice_over || slice_forced))) {
        int before = level;
        if (ticks_pending > 0 || first_waiting != last_waiting) {
            take_devices();
            level = before;
        } else {
            end_slice();
        }
    }
}

void hal_unlock(hal_lock_state before)
{
    hal_barrier();
    level = before;
    take_interrupts();
    if (++unlocks == unlock_target && unlock_hook != NULL) {
        unlock_hook();
    }
}

bool hal_in_thread(void)
{
    return level == THREAD;
}

bool hal_in_isr(void)
{
    return level >= DEVICE;
}

void hal_slice_restart(uint16_t spent)
{
    slice_over = 0;
    slice_ms = spent;
}

uint16_t hal_slice_spent(void)
{
    return (uint16_t)slice_ms;
}

bool hal_slice_is_over(void)
{
    return slice_over;
}

void hal_slice_force(void)
{
    slice_forced = 1;
    take_interrupts(); /* at thread level, as an interrupt controller does */
}

void hal_slice_unforce(void)
{
    slice_forced = 0;
}

static void on_alarm(int signal)
{
    (void)signal;
    __atomic_fetch_add(&ticks_pending, 1, __ATOMIC_SEQ_CST);
    if (++slice_ms >= SLICE_MS) {
        slice_over = 1;
    }
    take_interrupts();
}

/* ---- Contexts --------------------------------------------------------------------------------------------------- */

static void kernel_loop(void)
{
    fiber_arrived(kernel, main_context.fiber);
    for (;;) {
        const sys_pcb *next = kernel_pick();
        fiber_switch(kernel, ((context *)next->sp)->fiber);
    }
}

static void thread_main(void)
{
    const context *self = os_running->sp;
    fiber_arrived(self->fiber, NULL);
    os_running->status |= SYS_READY;
    hal_unlock(THREAD);
    self->entry(self->arg);
    os_thread_returned();
}

void hal_init(sys_pcb *process)
{
    static fiber main_fiber;
    main_context.fiber = &main_fiber;
    process->sp = &main_context;
    process->limit = NULL;
    level = SLICE;
    kernel = fiber_new(HOST_STACK, kernel_loop);
}

void hal_start(void)
{
    if (!virtual_time) {
        struct sigaction action;
        struct itimerval every_ms = {{0, 1000}, {0, 1000}};
        memset(&action, 0, sizeof action);
        action.sa_handler = on_alarm;
        action.sa_flags = SA_NODEFER | SA_RESTART;
        sigaction(SIGALRM, &action, NULL);
        setitimer(ITIMER_REAL, &every_ms, NULL);
    }
}

bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    (void)stack, (void)bytes;
    context *c = malloc(sizeof *c);
    if (c == NULL) {
        return false;
    }
    c->fiber = fiber_new(HOST_STACK, thread_main);
    c->entry = entry;
    c->arg = arg;
    process->sp = c;
    process->limit = NULL;
    if (c->fiber == NULL) {
        free(c);
    }
    return c->fiber != NULL;
}

void hal_stack_release(sys_pcb *process)
{
    context *c = process->sp;
    fiber_free(c->fiber);
    free(c);
}

static sys_pcb *preempted(void)
{
    return os_slice_end(os_running);
}

static sys_pcb *yielded(void)
{
    return os_yield(os_running);
}

static void save_and(hal_pick pick)
{
    context *self = os_running->sp;
    kernel_pick = pick;
    fiber_switch(self->fiber, kernel);
    hal_unlock(THREAD);
}

static void end_slice(void)
{
    slice_forced = 0;
    level = SLICE;
    save_and(preempted);
}

void hal_yield(void)
{
    level = SLICE;
    save_and(yielded);
}

void hal_block(void)
{
    save_and(os_schedule);
}

void hal_abandon(hal_pick pick)
{
    kernel_pick = pick;
    fiber_leave(kernel);
}

void hal_idle(const volatile uint16_t *pending)
{
    if (idle_hook != NULL) {
        idle_hook(++idles);
    }
    if ((*pending & OS_WORK) == 0) {
        if (virtual_time) {
            __atomic_fetch_add(&ticks_pending, 1, __ATOMIC_SEQ_CST);
        } else {
            sigset_t alarm_only, before;
            sigemptyset(&alarm_only);
            sigaddset(&alarm_only, SIGALRM);
            sigprocmask(SIG_BLOCK, &alarm_only, &before);
            if ((*pending & OS_WORK) == 0 && ticks_pending == 0) {
                sigsuspend(&before);
            }
            sigprocmask(SIG_SETMASK, &before, NULL);
        }
    }
    take_interrupts();
}

void hal_stop(void)
{
    _exit(EXIT_FAILURE);
}

/* ---- For tests (host.h) ----------------------------------------------------------------------------------------- */

void host_use_virtual_time(void)
{
    virtual_time = true;
}

void host_at_idle(void (*hook)(uint32_t))
{
    idle_hook = hook;
}

void host_tick(void)
{
    __atomic_fetch_add(&ticks_pending, 1, __ATOMIC_SEQ_CST);
    slice_ms++;
    take_interrupts();
}

void host_slice(void)
{
    slice_over = 1;
    take_interrupts();
}

void host_device(void (*isr)(void))
{
    waiting[last_waiting % DEVICES_WAITING] = isr;
    last_waiting++;
    take_interrupts();
}

void host_at_unlock(unsigned long n, void (*hook)(void))
{
    unlock_target = n == 0 ? 0 : unlocks + n;
    unlock_hook = hook;
}

unsigned long host_unlocks(void)
{
    return unlocks;
}

void host_fail_allocation(unsigned long n)
{
    allocation_target = n == 0 ? 0 : allocations + n;
}

unsigned long host_allocations(void)
{
    return allocations;
}

bool host_allocation_fails(void)
{
    return ++allocations == allocation_target;
}
