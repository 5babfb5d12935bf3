/* SPDX-License-Identifier: MIT */
/* Services: threads with a watchdog and automatic restart. Linked only where used. Contract lines: openswarm.h.
 *
 *     static const sys_process_config driver = {.entry = drive};
 *     static sys_service wheels = {.config = &driver, .limit_ms = 200, .restarts = 3};
 *     Sys_Start_Service(&wheels);
 *
 * A service that ends, for whatever reason, is restarted within a slice, up to `restarts` times. A service that does
 * not call Sys_Feed_Watchdog for more than limit_ms is killed first. The kernel supervises the services between two
 * threads, which takes 142 cycles a ms and no heap. A restart needs the memory of the thread that ended; it is
 * repeated every ms until that is free. An endless critical section or handler also stops this supervision. */
#ifndef OPENSWARM_SERVICE_H
#define OPENSWARM_SERVICE_H

#include "openswarm.h"

enum { SYS_ALWAYS = 0xFF };

/* In static memory. */
typedef struct sys_service {
    struct sys_service *next;         /* private to the kernel, as pid, fed and bitten */
    const sys_process_config *config; /* must not change */
    uint16 limit_ms;                  /* maximum time between two feeds, up to 32767; 0 = no watchdog */
    uint8 restarts;                   /* restarts left; SYS_ALWAYS: unlimited */
    uint16 pid, fed;                  /* pid 0: the service has ended */
    uint16 bitten;                    /* kills by the watchdog; saturates */
} sys_service;

/* MTH | no | 108 more than Sys_Start_ProcessWith | 48 | those of Sys_Start_ProcessWith, PROCESS: the service is
 * running.  Starts the thread and its supervision. A service without restarts left may be started again. */
bool Sys_Start_Service(sys_service *service);
/* MTH | no | 87, 10 more per service that began later | 22 | PROCESS: the caller is no service.  Resets the caller's
 * watchdog. */
bool Sys_Feed_Watchdog(void);

#endif
