/* SPDX-License-Identifier: MIT */
/* Services: threads that are watched, and started anew when they end; linked where it is used. Contract lines: openswarm.h.
 *
 *     static const sys_process_config driver = {.entry = drive};
 *     static sys_service wheels = {.config = &driver, .limit_ms = 200, .restarts = 3};
 *     Sys_Start_Service(&wheels);
 *
 * A service that ends, whatever ends it, is started anew within a slice, as often as restarts says. One that does not call
 * Sys_Feed_Watchdog for more than limit_ms is killed first. It is looked after by a handler of the 1 ms event, which also costs its
 * message: 385 cycles a ms. What keeps handlers from running, a critical section or a handler without end, is beyond it. */
#ifndef OPENSWARM_SERVICE_H
#define OPENSWARM_SERVICE_H

#include "openswarm.h"

enum { SYS_ALWAYS = 0xFF };

/* It stays for ever: give it static memory. */
typedef struct sys_service {
    struct sys_service *next;         /* the kernel's, as pid, fed and bitten */
    const sys_process_config *config; /* must not change either */
    uint16 limit_ms;                  /* between two feedings, up to 32767; 0 = not watched */
    uint8 restarts;                   /* that are left; SYS_ALWAYS: without end */
    uint16 pid, fed;                  /* pid 0: it has ended */
    uint16 bitten;                    /* times it was killed for not feeding; saturates */
} sys_service;

/* MTH | no | 342 more than Sys_Start_ProcessWith | 48 | MEMORY, PROCESS: it
 * lives.  Starts the thread, and watches over it from now on. One that has ended for good may be started again. */
bool Sys_Start_Service(sys_service *service);
/* T | no | 85, 8 more per service that began later | 22 | PROCESS: the caller is no service.  It is alive. */
bool Sys_Feed_Watchdog(void);

#endif
