/* SPDX-License-Identifier: MIT */
/* Threads: creation, the ring of ready threads, the blocked list, the end.
 *
 * The ring is circular and singly linked; os_ring is the member before the running one. A slice ends by moving os_ring
 * by one member, and a thread that becomes ready enters at the end of the ring; both take constant time. */
#include "kernel.h"

LINKS_IN_RAM();

sys_pcb os_system;
sys_pcb *os_running = &os_system; /* also for a fault before Sys_Init_Kernel */
sys_pcb *os_ring;
sys_pcb *os_blocked;
HAL_ZEROS sys_process_config os_plain;

sys_pcb **process_scan;
os_teardown_function os_release_mutexes, os_release_joins, os_release_service, os_run_cleanups;
bool (*os_free_joinable)(sys_pcb *p);
sys_pcb *os_cleanup_host;
bool os_cleanup_host_ends;

static uint16 newest_pid;
volatile uint16 critical_depth;
static volatile hal_lock_state critical_before;
PRIVATE_VALUE(critical_depth, 0);
PRIVATE_VALUE(critical_before, 0);

/* ---- Ring and blocked list: slice locked ---------------------------------------------------------------------- */

static HAL_OUTLINE void ring_append(sys_pcb *p)
{
    if (os_ring == NULL) {
        p->next = p;
    } else {
        p->next = os_ring->next;
        os_ring->next = p;
    }
    os_ring = p;
    os_preempt();
}

LOOPS_OF(ring_remove, n);
static HAL_OUTLINE void ring_remove(const sys_pcb *p)
{
    sys_pcb *before = os_ring;
    while (before->next != p) {
        before = before->next;
    }
    before->next = p->next;
    if (os_ring == p) {
        os_ring = before != p ? before : NULL;
    }
    hal_barrier();
}

/* Returns the link of the blocked list that points to p. */
/* All threads woken together take at most n * n / 4 steps: each passes those that stay blocked in front of it. */
BOUNDS_AT("while (*link != p)", loop n, share event.c / wake_waiters n * n / 4);
static HAL_OUTLINE sys_pcb **link_to(const sys_pcb *p)
{
    sys_pcb **link = &os_blocked;
    while (*link != p) {
        link = &(*link)->next;
    }
    return link;
}

/* Takes p off the blocked list. m becomes its wait result if it waits for an event. */
static HAL_OUTLINE void unlink_blocked(sys_pcb *p, message *m)
{
    sys_pcb **link = link_to(p);
    HAL_STORE(*link, p->next);
    if (process_scan == &p->next) {
        process_scan = link;
    }
    if (p->event_or_slice.awaited != NULL) {
        p->wait.result = m; /* overwrites the condition */
    }
}

static void set_state(sys_pcb *p, uint8 state)
{
    p->status = (uint8)((p->status & ~(OS_STATE | OS_TIMED)) | state);
}

/* Moves the running thread from the ring to the end of the blocked list. */
static HAL_OUTLINE sys_pcb *ring_to_blocked(event *awaited)
{
    sys_pcb *self = os_running;
    critical_depth = 0;
    ring_remove(self);
    self->event_or_slice.awaited = awaited;
    set_state(self, SYS_BLOCKED);
    self->next = NULL;
    sys_pcb **end = link_to(NULL);
    hal_barrier();
    HAL_STORE(*end, self);
    return self;
}

void process_wake(sys_pcb *p, message *m)
{
    unlink_blocked(p, m);
    set_state(p, SYS_READY | OS_WOKEN);
    p->event_or_slice.awaited = NULL;
    p->time_or_error.error = SYS_OK;
    ring_append(p);
}

sys_pcb *process_next(const sys_pcb *p)
{
    if (p == NULL) {
        if (os_ring != NULL) {
            return os_ring;
        }
    } else if ((p->status & OS_OFF_RING) || p->next != os_ring) {
        return p->next;
    }
    return os_blocked;
}

/* Bound of searches for distinct PIDs: each ends at another position of the lists. */
BOUNDS_AT("} while (", loop n, share start n * (n + 1) / 2);
sys_pcb *process_find(uint16 pid)
{
    sys_pcb *p = NULL;
    do {
        p = process_next(p);
    } while (p != NULL && p->pid != pid);
    return p;
}

BOUNDS_AT("while (", loop n);
bool process_awaits(const event *object)
{
    const sys_pcb *p = os_blocked;
    while (p != NULL && p->event_or_slice.awaited != object) {
        p = p->next;
    }
    return p != NULL;
}

/* ---- Beginning -------------------------------------------------------------------------------------------------- */

void process_init(void)
{
    os_system.status = SYS_READY;
    hal_init(&os_system);
    ring_append(&os_system);
}

BOUNDS_AT("} while (", loop n + 1, one); /* n - 1 PIDs in use, OS_DRIVERS, and the result */
static uint16 unused_pid(void)
{
    do {
        newest_pid++;
    } while (newest_pid == OS_DRIVERS || process_find(newest_pid) != NULL); /* PID 0 is always in use */
    return newest_pid;
}

static void set_period(periodic *timing, const sys_process_config *config)
{
    timing->period = config->period_ms;
    timing->deadline = config->deadline_ms;
    timing->release = clock_now();
    timing->due = (uint16)(timing->release + timing->deadline);
}

static bool is_valid(const sys_process_config *c, uint16 stack)
{
    if ((c->flags & SYS_PERIODIC) && (c->period_ms > 0x7FFFu || c->deadline_ms - 1u >= c->period_ms)) {
        return false;
    }
    return stack >= SYS_MINIMUM_STACK && (stack & (HEAP_STEP - 1u)) == 0 && stack <= 0x7FFFu &&
           (c->flags & ~(SYS_DSP | SYS_PERIODIC | OS_JOINABLE)) == 0;
}

static HAL_OUTLINE uint16 start(const sys_process_config *config, void (*entry)(void *))
{
    uint16 stack = config->stack != 0 ? config->stack : SYS_DEFAULT_STACK;
    uint16 extra = (config->flags & SYS_PERIODIC) ? sizeof(periodic) : 0;
    uint16 size = (uint16)(extra + stack + sizeof(sys_pcb));
    uint16 pid = 0;
    sys_error error = SYS_ERROR_ARGUMENT;
    if (os_enter() != SYS_OK) {
        return 0;
    }
    if (entry != NULL && is_valid(config, stack)) {
        uint8 *block = heap_alloc(size);
        heap_coalesce();
        error = SYS_ERROR_MEMORY;
        if (block != NULL) {
            sys_pcb *p = (sys_pcb *)(void *)(block + extra + stack);
            stack_paint(block + extra, p);
            if (hal_stack_init(p, block + extra, stack, entry, config->arg)) {
                error = SYS_OK;
                pid = unused_pid();
                p->pid = pid;
                p->status = (uint8)config->flags; /* with state SYS_NEW, which is 0 */
                p->priority = config->priority;
                p->block = block;
                p->time_or_error.error = SYS_OK;
                p->wait.result = NULL;
                p->event_or_slice.awaited = NULL;
                if (extra != 0) {
                    set_period(process_periodic(p), config);
                }
                ring_append(p);
            } else {
                heap_free(block, size);
            }
        }
    }
    (void)os_leave(error);
    return pid;
}

union callable { /* calls a thread function without argument as one with an argument */
    sys_function plain;
    void (*with_argument)(void *);
};

uint16 Sys_Start_Process(sys_function f)
{
    return start(&os_plain, ((union callable){f}).with_argument);
}

uint16 Sys_Start_ProcessWith(const sys_process_config *config)
{
    return start(config, config->entry);
}

/* ---- Blocking --------------------------------------------------------------------------------------------------- */

void process_block(event *awaited, uint16 ms)
{
    sys_pcb *self = ring_to_blocked(awaited);
    if (ms != 0) {
        clock_set_wake(self, ms);
    }
    hal_block();
}

void Sys_Sleep(uint16 ms)
{
    if (ms == 0) {
        Sys_Yield();
    } else if (os_enter_blocking() == SYS_OK) {
        process_block(NULL, ms);
    }
}

static sys_pcb *retire_running(void)
{
    (void)ring_to_blocked(NULL);
    return os_schedule();
}

void Sys_Run_SystemThread(void)
{
    if (os_running != &os_system) {
        (void)os_refuse();
    } else if (os_enter_blocking() == SYS_OK) {
        hal_abandon(retire_running);
    }
}

/* ---- Critical sections ------------------------------------------------------------------------------------------ */

HAL_OUTLINE void section_open(void)
{
    hal_lock_state before = hal_lock_slice();
    uint16 depth = critical_depth;
    critical_depth = (uint16)(depth + 1u);
    if (depth == 0) {
        critical_before = before;
    }
}

HAL_OUTLINE void section_close(void)
{
    hal_lock_state before = critical_before;
    uint16 depth = critical_depth;
    if (depth != 0) {
        critical_depth = (uint16)(depth - 1u);
        if (depth == 1) {
            hal_unlock(before);
        }
    }
}

/* In an ISR neither has an effect: it would change the nesting of the interrupted thread or handler. */
void Sys_Start_CriticalSection(void)
{
    if (!hal_in_isr()) {
        section_open();
    }
}

void Sys_End_CriticalSection(void)
{
    if (!hal_in_isr()) {
        section_close();
    }
}

void section_start(void)
{
    critical_before = HAL_THREAD_LEVEL;
    if (critical_depth == 0) {
        hal_unlock(HAL_THREAD_LEVEL);
    }
}

void os_call_in_section(void (*run)(void *), void *arg)
{
    enum { NESTING_OFFSET = 0x4000 }; /* more sections than run() can end */
    section_open();
    uint16 depth = critical_depth;
    critical_depth = (uint16)(depth + NESTING_OFFSET);
    run(arg);
    critical_depth = depth;
    section_close();
}

sys_error os_enter(void)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    section_open();
    return SYS_OK;
}

sys_error os_enter_blocking(void)
{
    return hal_in_thread() ? os_enter() : os_refuse();
}

bool os_leave(sys_error error)
{
    section_close();
    return error == SYS_OK || os_fail(error);
}

/* ---- End -------------------------------------------------------------------------------------------------------- */

/* Teardown, last step: frees the memory of a thread that is on no list and has no cleanups. */
void process_free(sys_pcb *p)
{
    uint16 pid = p->pid;
    if (os_free_joinable == NULL || !os_free_joinable(p)) {
        hal_stack_release(p);
        heap_free(p->block, (uint16)((uint8 *)(p + 1) - p->block));
    }
    event_announce(SYS_EVENT_TERMINATION, pid);
}

/* Ends thread p. Slice locked; no code runs on p's stack. The order is fixed, whichever option was used first: p leaves
 * every list of the kernel, its cleanups run, its memory is freed. */
static HAL_OUTLINE void end_thread(sys_pcb *p)
{
    if (p->status & OS_OFF_RING) {
        unlink_blocked(p, NULL);
    } else {
        ring_remove(p);
    }
    set_state(p, SYS_ZOMBIE);
    event_drop_subscriptions(p->pid);
    event_release_result(p);
    if (os_running == p) {
        HAL_STORE(os_running, &os_system);
    }
    if (os_release_mutexes != NULL) {
        os_release_mutexes(p);
    }
    if (os_release_joins != NULL) {
        os_release_joins(p);
    }
    if (os_release_service != NULL) {
        os_release_service(p);
    }
    if (os_run_cleanups != NULL) {
        os_run_cleanups(p);
    } else {
        process_free(p);
    }
}

sys_pcb *process_end_running(void)
{
    critical_depth = 0;
    end_thread(os_running); /* perhaps already blocked: its stack may overflow while it blocks */
    return os_schedule();
}

void os_thread_returned(void)
{
    section_open();
    hal_abandon(process_end_running);
}

bool Sys_Kill_Process(uint16 pid)
{
    sys_error error = SYS_ERROR_PROCESS;
    if (os_enter() != SYS_OK) {
        return false;
    }
    if (pid != 0) {
        sys_pcb *p = process_find(pid);
        if (p != NULL) {
            if (p == os_running && !os_in_kernel) {
                os_thread_returned();
            }
            if (p == os_cleanup_host) {
                os_cleanup_host_ends = true; /* a cleanup runs on its stack */
            } else {
                end_thread(p);
            }
            error = SYS_OK;
        }
    }
    return os_leave(error);
}

/* ---- Questions -------------------------------------------------------------------------------------------------- */

uint16 Sys_Get_ProcessID(void)
{
    return os_running->pid;
}

sys_state Sys_Get_ProcessState(uint16 pid)
{
    sys_state state = SYS_UNKNOWN;
    if (os_enter() != SYS_OK) {
        return state;
    }
    const sys_pcb *p = process_find(pid);
    if (p != NULL) {
        state = (p == os_running && !os_in_kernel) ? SYS_RUNNING : (sys_state)(p->status & OS_STATE);
    }
    section_close();
    return state;
}
