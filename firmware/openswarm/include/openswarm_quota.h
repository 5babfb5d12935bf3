/* SPDX-License-Identifier: MIT */
/* Limits of queued messages per event. Linked only where used. Contract lines: openswarm.h.
 *
 * If a handler takes longer than the time between two messages, or threads keep it from running, one event fills the
 * heap and messages of all events are lost. A quota bounds one event's share:
 *
 *     static sys_quota ticks;
 *     Sys_Keep_Latest(&ticks, SYS_1ms_TIMER);       at most one message waits, with the newest payload
 *     Sys_Limit_Event(&commands, COMMAND, 8);       at most eight wait; further messages are dropped
 *
 * A quota applies to the event's messages, which all listeners share, until the event is unregistered or gets
 * another quota; the object may then be used again. Sending a message that is dropped returns true, as without
 * listeners. While a message is being delivered, the next one may wait. */
#ifndef OPENSWARM_QUOTA_H
#define OPENSWARM_QUOTA_H

#include "openswarm.h"

#define SYS_LATEST_PAYLOAD 16 /* bytes; larger payloads, and those of another size than the waiting one, are dropped */

/* Private to the kernel, in static memory. */
typedef struct sys_quota {
    struct sys_quota *next;
    uint16 event, most;
    uint16 dropped; /* messages; saturates */
} sys_quota;

/* MTH | no | 237 | 48 | EVENT, MEMORY, ARGUMENT: most is 0.  Takes 6 bytes of the heap, which also serve the event's
 * next quota.  Sending the event then takes 107 Tcy more, 106 if it is dropped, 121 if the payload of 2 bytes is
 * replaced; 9 more per waiting message of any event and 7 per newer quota. Other events of the same bucket
 * (identifier modulo 8) that were registered before take 84 more. */
bool Sys_Limit_Event(sys_quota *quota, uint16 event, uint16 most);
/* The same for a queue of one: the newest payload replaces the waiting one. */
bool Sys_Keep_Latest(sys_quota *quota, uint16 event);

#endif
