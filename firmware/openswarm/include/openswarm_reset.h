/* SPDX-License-Identifier: MIT */
/* Cause of the last reset, the fault before it, and the hardware watchdog. Linked only where used. Contract lines:
 * openswarm.h.
 *
 *     Sys_Init_Kernel();
 *     if (Sys_Get_ResetCause()->fault != SYS_NO_FAULT) { ... log it, or stay still ... }
 *     SYS_ASSERT(Sys_Start_HardwareWatchdog());
 *
 * A fatal fault puts the board into the safe state: motors off, the LED pattern of a fault (e-puck: the ring; Kilobot:
 * red), a report on UART1. The system stops until a reset. The fault is kept in RAM over a reset, not over a loss of
 * power. */
#ifndef OPENSWARM_RESET_H
#define OPENSWARM_RESET_H

#include "openswarm.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    SYS_RESET_POWER, /* power-on, or a cause that the CPU does not report */
    SYS_RESET_BROWN_OUT,
    SYS_RESET_PIN,
    SYS_RESET_SOFTWARE,
    SYS_RESET_WATCHDOG,
    SYS_RESET_TRAP /* a trap conflict, an illegal opcode or an uninitialised pointer */
} sys_reset;

typedef enum {
    SYS_NO_FAULT,
    SYS_FAULT_OSCILLATOR,
    SYS_FAULT_ADDRESS,
    SYS_FAULT_MATH,
    SYS_FAULT_INTERRUPT, /* without a handler */
    SYS_FAULT_STACK,
    SYS_FAULT_ASSERTION
} sys_fault;

typedef struct {
    uint8 reset;        /* sys_reset */
    uint8 fault;        /* sys_fault that had stopped the system before the reset */
    uint16 pid;         /* the thread that ran; main and idle: 0 */
    uint16 place, page; /* low and high word of the program counter, 0 if unknown; assertion: the line, 0 */
} sys_reset_cause;

/* MTHI | no | 34 | 12 | none.  The first call after a reset reads and clears the CPU's flags. Faults are kept
 * from this call on. */
const sys_reset_cause *Sys_Get_ResetCause(void);

/* MT | no | 46 | 28 | ARGUMENT: this CPU has none that the kernel drives.  From now on a reset follows if no thread
 * switch is possible for about 128 ms: a critical section, a handler or an ISR does not end. (The period is that of the
 * image's configuration word. A boot loader that cannot write it keeps the e-puck's 16.4 s.) After such a reset the
 * call does not return: it puts the board into the safe state and stops the system, as a failed assertion does. */
bool Sys_Start_HardwareWatchdog(void);

#ifdef __cplusplus
}
#endif

#endif
