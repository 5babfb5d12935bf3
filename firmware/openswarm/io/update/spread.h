/* SPDX-License-Identifier: MIT */
/* Updates from robot to robot in messages of eight bytes, over whatever carries them (by infra-red: openswarm_infrared.h).
 * Who has a program says so, seldom when all agree (Trickle, RFC 6206); who lacks it asks for a row, and for its parts by a bit
 * each; who has the row sends those, for all in sight. README.md has the messages.
 *
 *     Sys_Start_Spreading(number);                  after Sys_Start_Update; number: any, but not all alike
 *     Sys_Spread(now, message)                      every SYS_SPREAD_TICK ms; true: send these eight bytes
 *     Sys_Hear_Update(now, message)                 with each message of this kind (SYS_SPREAD_KIND set in its first byte)
 *     Sys_Offer_Activation(version)                 on one robot, when it is to be: all that have the version whole follow
 *
 * A host that brings a program (`openswarm flash`) is a neighbour at the end of a UART: Sys_Frame_Rx and Sys_Spread_Tx are its
 * processors, what it receives goes to Sys_Hear_Update, and what Sys_Spread gives to the UART as well.
 */
#ifndef OPENSWARM_SPREAD_H
#define OPENSWARM_SPREAD_H

#include "openswarm_io.h"
#include "update.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_SPREAD_BYTES = 8, SYS_SPREAD_KIND = 0x80, SYS_SPREAD_TICK = 120 /* ms: a frame of eight bytes by infra-red is 105 */ };

void Sys_Start_Spreading(uint16 number);
/* now: ms of any clock that does not jump, one for both. One message at a time: the caller sends it before it asks again. */
bool Sys_Spread(uint32 now, uint8 *message);
void Sys_Hear_Update(uint32 now, const uint8 *message);
/* false: there is no such program here that is whole; or its flag sticks, and only the others are told. */
bool Sys_Offer_Activation(uint16 version);
/* The newest program that is whole here, or 0, and whether it is activated. */
uint16 Sys_Get_StoredVersion(bool *is_active);
/* Tx-processor: messages of this kind are frames (Sys_Frame_Tx) behind a 0, all else is sent as it is, such as text. */
bool Sys_Spread_Tx(const uint8 *message, uint16 size, sys_put put);

#ifdef __cplusplus
}
#endif

#endif
