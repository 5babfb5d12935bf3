/* SPDX-License-Identifier: MIT */
/* Latched notifications of a thread: 16 bits and a value. Linked only where used. Contract lines: openswarm.h.
 *
 *     static sys_notification work;                 one per waiting thread
 *     Sys_Notify(&work, ITEM);                      a thread, a handler or an ISR
 *     ...
 *     if (Sys_Wait_for_Notification(&work, ITEM | STOP, 0) & STOP) {
 *
 * A bit stays set until the thread takes it, so no wake-up is lost between a check and the wait. Equal notifications
 * that the thread has not taken are one. */
#ifndef OPENSWARM_NOTIFICATION_H
#define OPENSWARM_NOTIFICATION_H

#include "openswarm.h"

/* In static memory. */
typedef struct sys_notification {
    volatile uint16 bits;  /* notified and not taken */
    volatile uint16 value; /* the newest one */
    uint16 awaited;        /* private to the kernel */
} sys_notification;

/* MTHI | no | 16; 372 until a waiting thread that the scheduler prefers runs | 4 | none.  Sets bits. The next thread
 * switch wakes the thread that waits for one of them; under an eager scheduler that switch follows at once. */
void Sys_Notify(sys_notification *notification, uint16 bits);
/* The same; first replaces the value. */
void Sys_Notify_Value(sys_notification *notification, uint16 bits, uint16 value);
/* T | until one of the bits is set | 131; 260 to the next thread if it blocks | 48 | CONTEXT, ARGUMENT: no bit, BUSY:
 * another thread waits for this notification.  Takes those of the given bits that are set and returns them; 0: refused,
 * or with SYS_OK after ms milliseconds. ms 0 = no time-out. Frees the caller's uncleared wait result if it blocks. */
uint16 Sys_Wait_for_Notification(sys_notification *notification, uint16 bits, uint16 ms);

#endif
