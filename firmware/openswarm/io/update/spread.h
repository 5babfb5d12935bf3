/* SPDX-License-Identifier: MIT */
/* Spreading of programs from robot to robot in messages of eight bytes, over any transport (infra-red:
 * openswarm_infrared.h). A robot with a program advertises it, rarely if all agree (Trickle, RFC 6206). A robot that
 * lacks it requests the missing parts of one row; the request has one bit per part. A robot with the row sends these
 * parts to all robots in sight. docs/design/update.md has the messages.
 *
 *     Sys_Start_Spreading(number);                  after Sys_Start_Update; number: random seed, differs between robots
 *     Sys_Spread(now, message)                      every SYS_SPREAD_TICK ms; true: send these eight bytes
 *     Sys_Hear_Update(now, message)                 for each message whose first byte has SYS_SPREAD_KIND set
 *     Sys_Offer_Activation(version)                 on one robot: all robots with the whole version follow
 *
 * A host with a program (`openswarm flash`) is a neighbour at the other end of a UART. Sys_Frame_Rx and
 * Sys_Spread_Tx are the UART's processors. Received messages go to Sys_Hear_Update, and messages of Sys_Spread also
 * go to the UART.
 */
#ifndef OPENSWARM_SPREAD_H
#define OPENSWARM_SPREAD_H

#include "openswarm_io.h"
#include "update.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_SPREAD_BYTES = 8, SYS_SPREAD_KIND = 0x80, SYS_SPREAD_TICK = 120 /* ms; an infra-red frame takes 105 */ };

void Sys_Start_Spreading(uint16 number);
/* now: ms of a monotonic clock, the same for both calls. The caller sends a message before it calls Sys_Spread
 * again. */
bool Sys_Spread(uint32 now, uint8 *message);
void Sys_Hear_Update(uint32 now, const uint8 *message);
/* Activates a version here and on neighbours. false: not stored whole here, or only neighbours could activate it. */
bool Sys_Offer_Activation(uint16 version);
/* Version of the newest whole program of this robot, or 0, and whether it is activated. */
uint16 Sys_Get_StoredVersion(bool *is_active);
/* Tx-processor: sends a message of Sys_Spread as a byte 0 and a frame (Sys_Frame_Tx), and all others, such as text,
 * unchanged. */
bool Sys_Spread_Tx(const uint8 *message, uint16 size, sys_put put);

#ifdef __cplusplus
}
#endif

#endif
