/* SPDX-License-Identifier: MIT */
/* Hardware watchdog (openswarm_reset.h). The kernel stack restarts it after each tick of the clock; it expires if
 * a context delays the kernel stack for too long. */
#include "hal_reset.h"
#include "kernel.h"
#include "openswarm_reset.h"

#ifdef HAL_WATCHDOG_MS
TARGETS_OF(scheduler.c / work, feed);
static void feed(void)
{
    hal_watchdog_clear();
}

bool Sys_Start_HardwareWatchdog(void)
{
    if (Sys_Get_ResetCause()->reset == SYS_RESET_WATCHDOG) {
        Sys_Assertion_Failed("watchdog reset", HAL_WATCHDOG_MS);
    }
    HAL_STORE(os_feed, feed);
    hal_watchdog_start();
    return true;
}
#else
bool Sys_Start_HardwareWatchdog(void)
{
    return os_fail(SYS_ERROR_ARGUMENT);
}
#endif
