/* Threads: creation, the ring of ready threads, the blocked list, the end.
 *
 * The ring is circular and singly linked; os_ring is the member before the running one. Turning it by one member ends a
 * slice, and a thread that becomes ready enters behind everyone else, all in O(1). */
#include "kernel.h"

sys_pcb os_system;
sys_pcb *os_running;
sys_pcb *os_ring;
sys_pcb *os_blocked;

static uint16 newest_pid;
static sys_pcb *scan_current, *scan_following; /* moved by unlink_blocked() */
static uint16 critical_depth;
static hal_lock_state critical_before;

/* ---- Ring and blocked list: slice locked ---------------------------------------------------------------------- */

static void ring_append(sys_pcb *p)
{
    if (os_ring == NULL) {
        p->next = p;
    } else {
        p->next = os_ring->next;
        os_ring->next = p;
    }
    os_ring = p;
    if (os_eager) {
        hal_slice_force();
    }
}

static void ring_remove(const sys_pcb *p)
{
    sys_pcb *before = os_ring;
    while (before->next != p) {
        before = before->next;
    }
    before->next = p->next;
    if (before == p) {
        os_ring = NULL;
    } else if (os_ring == p) {
        os_ring = before;
    }
    hal_barrier();
}

static void append_blocked(sys_pcb *p)
{
    sys_pcb **link = &os_blocked;
    while (*link != NULL) {
        link = &(*link)->next;
    }
    p->status = (uint8)((p->status & ~OS_STATE) | SYS_BLOCKED);
    p->next = NULL;
    hal_barrier();
    *link = p;
}

static void unlink_blocked(sys_pcb *p)
{
    sys_pcb **link = &os_blocked;
    while (*link != p) {
        link = &(*link)->next;
    }
    *link = p->next;
    hal_barrier();
    if (scan_following == p) {
        scan_following = p->next;
    }
    if (scan_current == p) {
        scan_current = NULL;
    }
}

void process_make_ready(sys_pcb *p)
{
    unlink_blocked(p);
    p->status = (uint8)((p->status & ~(OS_STATE | OS_TIMED)) | SYS_READY);
    ring_append(p);
}

sys_pcb *process_scan_next(void)
{
    scan_current = scan_following;
    if (scan_current != NULL) {
        scan_following = scan_current->next;
    }
    return scan_current;
}

sys_pcb *process_scan_blocked(void)
{
    scan_following = os_blocked;
    return process_scan_next();
}

bool process_scan_holds(const sys_pcb *p)
{
    return scan_current == p;
}

sys_pcb *process_find(uint16 pid)
{
    sys_pcb *p = os_ring;
    if (p != NULL) {
        do {
            if (p->pid == pid) {
                return p;
            }
            p = p->next;
        } while (p != os_ring);
    }
    for (p = os_blocked; p != NULL && p->pid != pid;) {
        p = p->next;
    }
    return p;
}

/* ---- Beginning -------------------------------------------------------------------------------------------------- */

void process_init(void)
{
    os_blocked = NULL;
    os_ring = NULL;
    newest_pid = 0;
    critical_depth = 0;
    scan_current = NULL;
    scan_following = NULL;
    os_running = &os_system;
    os_system.status = SYS_READY;
    os_system.priority = 0;
    os_system.block = NULL;
    os_system.wait.result = NULL;
    os_system.pid = 0;
    hal_init(&os_system);
    ring_append(&os_system);
}

static uint16 unused_pid(void)
{
    do {
        newest_pid++;
    } while (newest_pid == 0 || process_find(newest_pid) != NULL);
    return newest_pid;
}

periodic *process_periodic(const sys_pcb *p)
{
    return (p->status & SYS_PERIODIC) ? (periodic *)p->block : NULL;
}

static void set_period(sys_pcb *p, const sys_process_config *config)
{
    periodic *timing = process_periodic(p);
    if (timing != NULL) {
        timing->period = config->period_ms;
        timing->deadline = config->deadline_ms;
        timing->release = clock_now();
        timing->due = (uint16)(timing->release + timing->deadline);
    }
}

static bool is_valid(const sys_process_config *c, uint16 stack)
{
    bool timing = !(c->flags & SYS_PERIODIC) ||
                  (c->period_ms > 0 && c->period_ms <= 0x7FFFu && c->deadline_ms > 0 && c->deadline_ms <= c->period_ms);
    return c->entry != NULL && stack >= SYS_MINIMUM_STACK && stack % HEAP_STEP == 0 && stack <= 0x7FFFu && timing &&
           (c->flags & (uint16)~(SYS_DSP | SYS_PERIODIC)) == 0;
}

uint16 Sys_Start_ProcessWith(const sys_process_config *config)
{
    uint16 stack = config->stack != 0 ? config->stack : SYS_DEFAULT_STACK;
    uint16 extra = (config->flags & SYS_PERIODIC) ? sizeof(periodic) : 0;
    uint16 pid = 0;
    if (hal_in_isr()) {
        os_refuse();
        return 0;
    }
    if (!is_valid(config, stack)) {
        os_fail(SYS_ERROR_ARGUMENT);
        return 0;
    }
    hal_lock_state lock = os_lock_slice();
    uint16 size = (uint16)(extra + stack + sizeof(sys_pcb));
    uint8 *block = heap_take(size);
    if (block != NULL) {
        sys_pcb *p = (sys_pcb *)(block + extra + stack);
        p->status = (uint8)config->flags; /* and SYS_NEW */
        p->priority = config->priority;
        p->block = block;
        p->wait.result = NULL;
        p->awaited = NULL;
        stack_paint(block + extra, stack);
        if (hal_stack_init(p, block + extra, stack, config->entry, config->arg)) {
            set_period(p, config);
            pid = unused_pid();
            p->pid = pid;
            ring_append(p);
        } else {
            heap_give(block, size);
        }
    }
    if (pid == 0) {
        os_fail(SYS_ERROR_MEMORY);
    }
    hal_unlock(lock);
    return pid;
}

union callable { /* a thread function without argument, in the place of one with */
    sys_function plain;
    void (*with_argument)(void *);
};

uint16 Sys_Start_Process(sys_function f)
{
    sys_process_config config = {0};
    config.entry = ((union callable){f}).with_argument;
    return Sys_Start_ProcessWith(&config);
}

/* ---- Blocking --------------------------------------------------------------------------------------------------- */

void process_block(event *awaited, uint16 ms)
{
    sys_pcb *self = os_running;
    ring_remove(self);
    self->awaited = awaited;
    append_blocked(self);
    if (ms != 0) {
        clock_set_wake(self, ms);
    }
    hal_switch(os_schedule);
}

void Sys_Sleep(uint16 ms)
{
    if (ms == 0) {
        Sys_Yield();
    } else if (!hal_in_thread()) {
        os_refuse();
    } else {
        (void)os_lock_slice();
        process_block(NULL, ms);
    }
}

static sys_pcb *retire_running(void)
{
    ring_remove(os_running);
    os_running->awaited = NULL;
    append_blocked(os_running);
    return os_schedule();
}

void Sys_Run_SystemThread(void)
{
    if (os_running == &os_system && hal_in_thread()) {
        (void)os_lock_slice();
        hal_abandon(retire_running);
    }
    os_refuse();
}

void Sys_Start_CriticalSection(void)
{
    hal_lock_state before = os_lock_slice();
    if (critical_depth++ == 0) { /* an ISR in between leaves the depth as it was */
        critical_before = before;
    }
}

void Sys_End_CriticalSection(void)
{
    if (critical_depth != 0 && --critical_depth == 0) {
        hal_unlock(critical_before);
    }
}

/* ---- End -------------------------------------------------------------------------------------------------------- */

/* Slice locked; p is neither on the ring nor blocked, and nothing runs on its stack. */
static void bury(sys_pcb *p)
{
    p->status = (uint8)((p->status & ~OS_STATE) | SYS_ZOMBIE);
    event_drop_subscriptions(p->pid);
    if (p->wait.result != NULL) {
        event_release(p->wait.result);
    }
    if (os_running == p) {
        os_running = &os_system;
    }
    hal_stack_release(p);
    heap_give(p->block, (uint16)((uint8 *)p - p->block + (ptrdiff_t)sizeof *p));
}

static void take_off(sys_pcb *p)
{
    if ((p->status & OS_STATE) == SYS_BLOCKED) {
        unlink_blocked(p);
        if (p->awaited != NULL) {
            p->wait.result = NULL; /* it was the condition */
        }
    } else {
        ring_remove(p);
    }
}

sys_pcb *process_end_running(void)
{
    sys_pcb *p = os_running;
    critical_depth = 0;
    take_off(p); /* it may have overflown its stack on the way to sleep */
    bury(p);
    return os_schedule();
}

void os_thread_returned(void)
{
    (void)os_lock_slice();
    hal_abandon(process_end_running);
}

bool Sys_Kill_Process(uint16 pid)
{
    if (hal_in_isr()) {
        return os_refuse();
    }
    hal_lock_state lock = os_lock_slice();
    if (!os_delivering && pid == os_running->pid && pid != 0) {
        hal_abandon(process_end_running);
    }
    sys_pcb *p = pid != 0 ? process_find(pid) : NULL;
    if (p != NULL) {
        take_off(p);
        bury(p);
    }
    hal_unlock(lock);
    return p != NULL || os_fail(SYS_ERROR_PROCESS);
}

/* ---- Questions -------------------------------------------------------------------------------------------------- */

uint16 Sys_Get_ProcessID(void)
{
    return os_running->pid;
}

sys_state Sys_Get_ProcessState(uint16 pid)
{
    sys_state state = SYS_UNKNOWN;
    hal_lock_state lock = os_lock_slice();
    const sys_pcb *p = process_find(pid);
    if (p != NULL) {
        state = (p == os_running && !os_delivering) ? SYS_RUNNING : (sys_state)(p->status & OS_STATE);
    }
    hal_unlock(lock);
    return state;
}
