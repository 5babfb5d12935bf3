/* SPDX-License-Identifier: MIT */
/* Events shared between neighbours, by number. Linked only where used, with DEVICES := infrared. Contract lines:
 * openswarm.h.
 *
 *     SYS_ASSERT(Sys_Start_Infrared());
 *     SYS_ASSERT(Sys_Register_Event(ALARM) && Sys_Share_Event(ALARM, 2));
 *
 * An ALARM sent on this robot is then also sent on robots up to two hops away that share it, and theirs is sent
 * here. Senders and subscribers need no change. Each event arrives at most once, however many neighbours forward it;
 * a lost frame is not repeated (openswarm_infrared.h). Robots forward events that they do not share themselves.
 */
#ifndef OPENSWARM_REMOTE_H
#define OPENSWARM_REMOTE_H

#include "openswarm_infrared.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SYS_REMOTE_BYTES = 8,         /* of payload; events with more stay on their robot */
    SYS_REMOTE_LAST_EVENT = 8191, /* largest event number that can be shared */
    SYS_REMOTE_HOPS = 7
};
#ifndef SYS_REMOTE_EVENTS
#define SYS_REMOTE_EVENTS 8 /* maximum number of events a robot shares */
#endif
#ifndef SYS_REMOTE_MEMORY
#define SYS_REMOTE_MEMORY 32 /* robots of origin heard within SYS_NEIGHBOUR_LIFETIME, at most; Kilobot: 16 */
#endif

/* MTH | no | 2120 + 405 b + 2 g; at most 460 more while memory is short | 40 | EVENT, MEMORY, ARGUMENT, BUSY.  Shares
 * an event over 1 to SYS_REMOTE_HOPS hops; a second call changes the hops. BUSY: SYS_REMOTE_EVENTS are shared. Sharing
 * takes 6 bytes of the heap and ends when the event is unregistered. Neighbours get every event that is sent, also one
 * that a quota drops or replaces on this robot. */
bool Sys_Share_Event(uint16 event, uint8 hops);

typedef struct {
    uint16 shared;     /* sent to neighbours */
    uint16 arrived;    /* received for the first time */
    uint16 duplicates; /* received again, or this robot's own */
    uint16 passed_on;  /* forwarded for other robots */
    uint16 refused;    /* not delivered: SYS_REMOTE_MEMORY other robots were heard lately */
    uint16 too_long;   /* not sent: payload above SYS_REMOTE_BYTES */
} sys_remote_statistics; /* counters saturate */
/* MTHI | no | 4 | 4 | none. */
const sys_remote_statistics *Sys_Get_RemoteStatistics(void);

#ifdef __cplusplus
}
#endif

#endif
