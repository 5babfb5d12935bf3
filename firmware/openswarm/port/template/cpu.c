/* SPDX-License-Identifier: MIT */
/* Template of a port: the smallest implementation of hal/hal_cpu.h, on POSIX contexts instead of a CPU.
 *
 * A real port replaces, in this order: levels (interrupt mask), clock and slice timer, first frame, switch, idle.
 * There is no asynchronous interrupt here: time passes when a lock is released at thread level, UNLOCKS_PER_MS of
 * them make 1 ms. */
#include "kernel.h"

#include <stdlib.h>
#include <ucontext.h>

enum { THREAD, SLICE, DEVICE, STACK_BYTES = 256 * 1024, UNLOCKS_PER_MS = 50, MS_PER_SLICE = 10 };

typedef struct {
    ucontext_t registers; /* replace: remove; registers are on the thread's stack, and sp points to them */
    void *stack;
    void (*entry)(void *);
    void *arg;
} context;

static int level;
static bool started, slice_forced;
static unsigned unlocks, ms_of_slice;
static ucontext_t kernel;
static context main_context;
static hal_pick kernel_pick;

static void save_and(hal_pick pick);

static sys_pcb *end_slice(void)
{
    return os_slice_end(os_running);
}

static sys_pcb *yield(void)
{
    return os_yield(os_running);
}

/* ---- Levels: replace by your interrupt mask. slice < device < interrupts that must never wait for the kernel
 * ----------------- */

static hal_lock_state raise_to(int wanted)
{
    int before = level;
    if (level < wanted) {
        level = wanted;
    }
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

/* Replace: your 1 ms timer's ISR. */
static void clock_interrupt(void)
{
    int before = raise_to(DEVICE);
    os_clock_tick();
    level = before;
    ms_of_slice++; /* replace: a second timer, restarted by hal_slice_restart() */
}

void hal_unlock(hal_lock_state before)
{
    level = before;
    if (!started || level != THREAD) {
        return;
    }
    if (++unlocks % UNLOCKS_PER_MS == 0) {
        clock_interrupt();
    }
    if (slice_forced || hal_slice_is_over()) { /* replace: the slice timer's ISR saves the thread's registers and does the same */
        level = SLICE;
        save_and(end_slice);
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
    ms_of_slice = spent;
}

uint16_t hal_slice_spent(void)
{
    return (uint16_t)ms_of_slice;
}

bool hal_slice_is_over(void)
{
    return ms_of_slice >= MS_PER_SLICE;
}

void hal_slice_force(void)
{
    slice_forced = true;
}

void hal_slice_unforce(void)
{
    slice_forced = false;
}

/* ---- Contexts: replace by frames on the threads' own stacks and a dozen lines of assembly
 * ------------------------------ */

static void kernel_loop(void)
{
    for (;;) {
        const sys_pcb *next = kernel_pick();
        swapcontext(&kernel, &((context *)next->sp)->registers);
    }
}

static void thread_main(void)
{
    const context *self = os_running->sp;
    os_running->status |= SYS_READY;
    hal_unlock(THREAD);
    self->entry(self->arg);
    os_thread_returned();
}

static void *prepare(ucontext_t *registers, void (*entry)(void))
{
    void *stack = malloc(STACK_BYTES);
    if (stack != NULL) {
        getcontext(registers);
        registers->uc_stack.ss_sp = stack;
        registers->uc_stack.ss_size = STACK_BYTES;
        registers->uc_link = NULL;
        makecontext(registers, entry, 0);
    }
    return stack;
}

void hal_init(sys_pcb *process)
{
    process->sp = &main_context;
    process->limit = NULL;
    level = SLICE;
    if (prepare(&kernel, kernel_loop) == NULL) {
        abort();
    }
}

void hal_start(void)
{
    started = true; /* replace: start both timers, enable interrupts */
}

bool hal_stack_init(sys_pcb *process, uint8_t *stack, uint16_t bytes, void (*entry)(void *), void *arg)
{
    context *c = malloc(sizeof *c);
    (void)stack;
    (void)bytes;
    if (c == NULL) {
        return false;
    }
    c->entry = entry;
    c->arg = arg;
    c->stack = prepare(&c->registers, thread_main);
    process->sp = c;
    process->limit = NULL;
    if (c->stack == NULL) {
        free(c);
        return false;
    }
    return true;
}

void hal_stack_release(sys_pcb *process)
{
    context *c = process->sp;
    free(c->stack);
    free(c);
}

static void save_and(hal_pick pick)
{
    context *self = os_running->sp;
    kernel_pick = pick;
    swapcontext(&self->registers, &kernel);
    level = THREAD;
}

void hal_yield(void)
{
    level = SLICE;
    save_and(yield);
}

void hal_block(void)
{
    save_and(os_schedule);
}

void hal_abandon(hal_pick pick)
{
    kernel_pick = pick;
    setcontext(&kernel);
    abort();
}

/* Replace: mask all interrupts, test, sleep so that a masked interrupt ends the sleep, unmask. */
void hal_idle(const volatile uint16_t *pending)
{
    if ((*pending & OS_WORK) == 0) {
        clock_interrupt();
    }
}

void hal_stop(void)
{
    exit(EXIT_FAILURE);
}
