/* SPDX-License-Identifier: MIT */
/* Events that neighbours share, by number; linked where it is used, with DEVICES := infrared. Contract lines: openswarm.h.
 *
 *     SYS_ASSERT(Sys_Start_Infrared());
 *     SYS_ASSERT(Sys_Register_Event(ALARM) && Sys_Share_Event(ALARM, 2));
 *
 * From now on an ALARM that anybody sends on this robot is sent on robots that share it as well, up to two hops away, and theirs
 * is sent here; whoever sends and subscribes goes on as before. Each arrives once at most, however many neighbours tell it; a frame
 * that is lost is lost (openswarm_infrared.h). Robots pass on events they do not share themselves.
 */
#ifndef OPENSWARM_REMOTE_H
#define OPENSWARM_REMOTE_H

#include "openswarm_infrared.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    SYS_REMOTE_BYTES = 8,         /* of payload; events with more stay on their robot */
    SYS_REMOTE_LAST_EVENT = 8191, /* the largest number that can be shared */
    SYS_REMOTE_HOPS = 7
};
#ifndef SYS_REMOTE_EVENTS
#define SYS_REMOTE_EVENTS 8 /* that a robot shares */
#endif
#ifndef SYS_REMOTE_MEMORY
#define SYS_REMOTE_MEMORY 12 /* arrivals of the last SYS_NEIGHBOUR_LIFETIME, by which a second one is known; 1 to 255 */
#endif

/* MTH | no | as Sys_Subscribe_to_Event | 44 | EVENT, MEMORY, ARGUMENT, BUSY.  hops 1 to SYS_REMOTE_HOPS; again changes them.
 * BUSY: SYS_REMOTE_EVENTS are shared. Sharing is a subscription of the system thread: it ends with
 * Sys_Unsubscribe_from_Event(event, 0), as the event's other handlers there do. */
bool Sys_Share_Event(uint16 event, uint8 hops);

typedef struct {
    uint16 shared;     /* sent to neighbours */
    uint16 arrived;    /* for the first time */
    uint16 duplicates; /* again, or the own */
    uint16 passed_on;  /* for others */
    uint16 too_long;   /* more than SYS_REMOTE_BYTES */
} sys_remote_statistics; /* they saturate */
const sys_remote_statistics *Sys_Get_RemoteStatistics(void); /* MTHI */

#ifdef __cplusplus
}
#endif

#endif
