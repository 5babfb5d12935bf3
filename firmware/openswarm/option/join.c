/* SPDX-License-Identifier: MIT */
/* Waiting for the end of a thread, and threads that stay as zombies until somebody does (openswarm_join.h). */
#include "kernel.h"
#include "openswarm_join.h"

typedef struct joiner joiner;
struct joiner { /* on the stack of who waits */
    joiner *next;
    sys_pcb *thread;
    uint16 pid;
};

static joiner *joiners; /* slice locked */
static os_burial before;
static bool buries;

/* Wakes who waited for it; true if there was anybody. Who waits himself waits no more. */
static bool tell_joiners(const sys_pcb *gone)
{
    bool any = false;
    for (joiner **link = &joiners; *link != NULL;) {
        joiner *j = *link;
        if (j->thread != gone && j->pid != gone->pid) {
            link = &j->next;
        } else {
            *link = j->next;
            if (j->thread != gone) {
                process_wake(j->thread, NULL);
                any = true;
            }
        }
    }
    return any;
}

/* A zombie keeps its control block, behind all that are blocked. Whoever kills it again sets that free. */
static bool on_burial(sys_pcb *p)
{
    bool stays = before != NULL && before(p);
    bool is_zombie = p->block == NULL;
    if (is_zombie) {
        heap_give(p, sizeof *p);
        return true;
    }
    if (tell_joiners(p) || !(p->status & OS_JOINABLE) || stays) {
        return stays;
    }
    hal_stack_release(p);
    heap_give(p->block, (uint16)((uint8 *)p - p->block));
    p->block = NULL;
    p->on.awaited = NULL;
    p->next = NULL;
    sys_pcb **end = &os_blocked;
    while (*end != NULL) {
        end = &(*end)->next;
    }
    hal_barrier();
    HAL_STORE(*end, p);
    return true;
}

static void begin(void)
{
    Sys_Start_CriticalSection();
    if (!buries) {
        buries = true;
        before = os_at_burial;
        os_at_burial = on_burial;
    }
    Sys_End_CriticalSection();
}

uint16 Sys_Start_Joinable(const sys_process_config *config)
{
    sys_process_config joinable = *config;
    begin();
    joinable.flags |= OS_JOINABLE;
    return Sys_Start_ProcessWith(&joinable);
}

bool Sys_Join(uint16 pid)
{
    if (os_enter_blocking() != SYS_OK) {
        return false;
    }
    const sys_pcb *p = process_find(pid);
    if (p == NULL || p == &os_system || p == os_running) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    if ((p->status & OS_STATE) == SYS_ZOMBIE) {
        sys_pcb **link = &os_blocked;
        while (*link != p) {
            link = &(*link)->next;
        }
        HAL_STORE(*link, p->next);
        event_drop_subscriptions(pid); /* it may have been given some since its end */
        heap_give((void *)(uintptr_t)p, sizeof *p);
        return os_leave(SYS_OK);
    }
    begin();
    joiner waiting = {joiners, os_running, pid};
    joiners = &waiting;
    process_block(NULL, 0);
    return true;
}
