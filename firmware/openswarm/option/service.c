/* SPDX-License-Identifier: MIT */
/* Services: threads with a watchdog and automatic restart (openswarm_service.h). */
#include "kernel.h"
#include "openswarm_service.h"

static sys_service *services; /* slice locked */

/* Teardown of a thread: supervise() restarts its service. */
BOUNDS_AT("for (", loop v, one);
static void release_service(sys_pcb *p)
{
    for (sys_service *s = services; s != NULL; s = s->next) {
        if (s->pid == p->pid) {
            s->pid = 0;
        }
    }
}

static void start(sys_service *s)
{
    s->pid = Sys_Start_ProcessWith(s->config);
    s->fed = clock_now();
}

/* Kills services whose watchdog has expired and restarts ended ones. No handler: a full heap loses its event. */
BOUNDS_AT("for (", loop v, one);
static void supervise(void)
{
    uint16 now = clock_now();
    for (sys_service *s = services; s != NULL; s = s->next) {
        if (s->pid != 0 && s->limit_ms != 0 && (sint16)(now - s->fed - s->limit_ms) > 0) {
            (void)Sys_Kill_Process(s->pid);
            os_count(&s->bitten);
        }
        if (s->pid == 0 && s->restarts != 0) {
            sys_error error = (sys_error)Sys_Get_LastError();
            start(s);
            (void)os_fail(error); /* a restart that fails is no error of a handler */
            if (s->pid != 0 && s->restarts != SYS_ALWAYS) {
                s->restarts--;
            }
        }
    }
}

BOUNDS_AT("while (known", loop v);
bool Sys_Start_Service(sys_service *s)
{
    sys_error error = SYS_OK;
    if (os_enter() != SYS_OK) {
        return false;
    }
    sys_service *known = services;
    while (known != NULL && known != s) {
        known = known->next;
    }
    if (known != NULL && s->pid != 0) {
        return os_leave(SYS_ERROR_PROCESS);
    }
    os_release_service = release_service;
    os_watch = supervise;
    s->pid = 0;
    start(s);
    if (s->pid == 0) {
        error = (sys_error)Sys_Get_LastError();
    } else if (known == NULL) {
        s->next = services;
        services = s;
    }
    return os_leave(error);
}

BOUNDS_AT("for (", loop v, one);
bool Sys_Feed_Watchdog(void)
{
    sys_error error = SYS_ERROR_PROCESS;
    if (os_enter() != SYS_OK) {
        return false;
    }
    for (sys_service *s = services; s != NULL; s = s->next) {
        if (s->pid == os_running->pid && s->pid != 0 && !os_in_kernel) { /* 0: an ended service */
            s->fed = clock_now();
            error = SYS_OK;
        }
    }
    return os_leave(error);
}
