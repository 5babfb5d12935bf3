/* SPDX-License-Identifier: MIT */
/* Programs that reach a robot while it runs and outlive its reset; linked where DEVICES names update. The firmware stays what
 * it is, and calls at most one such program: the newest that is whole, activated, and has started well or has tries left.
 *
 *     Sys_Start_Update();                        at start: calls the program, if there is one; then, once all is well,
 *     Sys_Confirm_Update();                      otherwise the one before is back after SYS_UPDATE_TRIES resets
 *
 *     Sys_Begin_Update(&facts); Sys_Put_UpdateRow(0, bytes); ... Sys_End_Update(); Sys_Activate_Update(version);
 *
 * Power may fail at any write: the next start finds the old or the new program. README.md tells why. On an e-puck each write
 * stops everything for 2 ms, interrupts too: motors should stand. Not for handlers, and by one thread at a time. */
#ifndef OPENSWARM_UPDATE_H
#define OPENSWARM_UPDATE_H

#include "openswarm.h"

#include "hal_update.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_UPDATE_TRIES = 3 }; /* starts without Sys_Confirm_Update */

typedef struct {
    uint16 version; /* above that of all that are stored */
    uint8 rows;     /* 1 to HAL_UPDATE_ROWS */
    uint32 crc;     /* CRC-32 (IEEE 802.3) of the rows' bytes, HAL_UPDATE_ROW each */
} sys_update;

/* The CRC register behind `count` more bytes. It begins with all ones, and sys_update.crc is its complement in the end. */
uint32 Sys_Add_UpdateCrc(uint32 crc, const uint8 *bytes, uint8 count);

/* Makes room for a program. false, and what was begun goes on: its facts are wrong, it is not newer than one that is whole,
 * the one that runs is not confirmed yet, or the store it would come to has not held what was written to it since the start. */
bool Sys_Begin_Update(const sys_update *facts);
/* Stores a row, in any order; one that is there already is left alone. false: no such row, or flash does not hold
 * it after three writes; then nothing is begun any more, and no more asked of that store until the next start. */
bool Sys_Put_UpdateRow(uint8 row, const uint8 *bytes);
/* Bit n: row n is not there yet; 0 when nothing was begun. */
uint32 Sys_Get_MissingRows(void);
/* false, and nothing is stored: a row is missing, or the CRC is wrong. */
bool Sys_End_Update(void);
/* The newest program that is whole: its facts, and whether it is activated. false: there is none. */
bool Sys_Get_StoredUpdate(sys_update *facts, bool *is_active);
/* Copies a row of the program that the last call before has told. */
void Sys_Get_UpdateRow(uint8 row, uint8 *bytes);
/* The program with this version is to run from the next start on. false: there is none that is whole, or its
 * flag sticks, which is not tried again until the next start. */
bool Sys_Activate_Update(uint16 version);
/* The version that the next start calls, or 0. One that did not start well is stored and activated, and not it. */
uint16 Sys_Get_NextVersion(void);
/* Puts the program that is to run where it belongs and calls it; where its tries cannot be counted, or its rows not written,
 * the one before. Its version, or 0: none was called. */
uint16 Sys_Start_Update(void);
/* The program that was called last works. false: none was, or its flag sticks, as above. */
bool Sys_Confirm_Update(void);

#ifdef __cplusplus
}
#endif

#endif
