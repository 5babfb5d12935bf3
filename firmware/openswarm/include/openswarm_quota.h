/* SPDX-License-Identifier: MIT */
/* How many messages of an event may wait for delivery; linked where it is used. Contract lines: openswarm.h.
 *
 * A handler that takes longer than the time between two messages, or threads that keep it from running, let an event fill the
 * heap, and then everybody's messages are lost. A quota bounds one event's share:
 *
 *     static sys_quota ticks;
 *     Sys_Keep_Latest(&ticks, SYS_1ms_TIMER);       one message waits at most, with the newest payload
 *     Sys_Limit_Event(&commands, COMMAND, 8);       eight wait at most; what comes then is dropped
 *
 * It holds for all listeners of the event, which share its messages, until the event is unregistered or has another quota; the
 * same object may be used again. A message that is dropped is as one to which nobody listens: the call returns true. While a
 * message is being delivered the next may wait. */
#ifndef OPENSWARM_QUOTA_H
#define OPENSWARM_QUOTA_H

#include "openswarm.h"

#define SYS_LATEST_PAYLOAD 16 /* bytes; larger ones, and those of another size than the one that waits, are dropped */

/* The kernel's. It stays for ever: give it static memory. */
typedef struct sys_quota {
    struct sys_quota *next;
    uint16 event, most;
    uint16 dropped; /* messages; saturates */
} sys_quota;

/* MTH | no | 225 | 42 | EVENT, MEMORY, ARGUMENT: most is 0.  Takes 6 bytes of the heap, which also serve the event's next
 * quota.  Sending the event then takes 71 more, 72 if it is dropped, 83 if the payload of 2 bytes is replaced; 11 more per
 * message of any event that waits and 7 per newer quota. Other events of the same bucket (identifier modulo 8) that were registered before take 74 more. */
bool Sys_Limit_Event(sys_quota *quota, uint16 event, uint16 most);
/* As above, for a queue of one: the newest payload replaces the one that waits. */
bool Sys_Keep_Latest(sys_quota *quota, uint16 event);

#endif
