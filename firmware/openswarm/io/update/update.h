/* SPDX-License-Identifier: MIT */
/* Programs that a running robot receives and keeps across resets; linked where DEVICES names update. The firmware never
 * changes. It calls at most one such program: the newest that is whole, activated, and confirmed or with tries left.
 *
 *     Sys_Start_Update();                        at start: calls the program, if there is one
 *     Sys_Confirm_Update();                      once it works; else SYS_UPDATE_TRIES resets restore the previous one
 *
 *     Sys_Begin_Update(&facts); Sys_Put_UpdateRow(0, bytes); ... Sys_End_Update(); Sys_Activate_Update(version);
 *
 * Power may fail at any write: the next start finds the old or the new program (README.md). On an e-puck each write
 * stops the CPU for 2 ms, including interrupts; the motors should stand still. Not for handlers; one thread at a
 * time. */
#ifndef OPENSWARM_UPDATE_H
#define OPENSWARM_UPDATE_H

#include "openswarm.h"

#include "hal_update.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_UPDATE_TRIES = 3 }; /* starts without Sys_Confirm_Update */

/* Bytes of the caller's stack that a call may take. */
#ifdef SYS_UPDATE_AUTH
enum { SYS_UPDATE_STACK = 680 };
#else
enum { SYS_UPDATE_STACK = 400 };
#endif

typedef struct {
    uint16 version; /* greater than that of all stored programs */
    uint8 rows;     /* 1 to HAL_UPDATE_ROWS */
    uint32 crc;     /* CRC-32 (IEEE 802.3) of the rows' bytes, HAL_UPDATE_ROW each */
} sys_update;

/* Returns the CRC register after `count` more bytes. Its initial value is all ones; sys_update.crc is its final
 * complement. */
uint32 Sys_Add_UpdateCrc(uint32 crc, const uint8 *bytes, uint8 count);

/* Begins an update: erases a store. false, and an update in progress continues: the facts are invalid, a complete
 * program of this version or a newer one is stored, the running or the kept program is not confirmed yet, or the store
 * is worn. false, and an update in progress is abandoned: the store cannot be erased. */
bool Sys_Begin_Update(const sys_update *facts);
/* Stores a row, in any order; a row stored before stays. false: no such row, or flash does not hold it after three
 * writes; the update is then abandoned and the store not used until the next start. */
bool Sys_Put_UpdateRow(uint8 row, const uint8 *bytes);
/* Bit n: row n is missing; 0 if no update was begun. */
uint32 Sys_Get_MissingRows(void);
/* Makes the update a stored program. false: a row is missing, the CRC or tag is wrong, or flash did not hold row 0. */
bool Sys_End_Update(void);
/* Returns the facts of the newest whole program, and whether it is activated. false: there is none. */
bool Sys_Get_StoredUpdate(sys_update *facts, bool *is_active);
/* Copies a row of the program that the last Sys_Get_StoredUpdate returned. */
void Sys_Get_UpdateRow(uint8 row, uint8 *bytes);
/* Makes the next start run the program of this version. false: there is no such whole program, or its flag cannot be
 * written; the flag is not tried again until the next start. */
bool Sys_Activate_Update(uint16 version);
/* Version that the next start calls, or 0. A program that used up its tries stays stored and activated, but is not
 * called. */
uint16 Sys_Get_NextVersion(void);
/* Copies the chosen program into the run slot and calls it. If its tries cannot be counted or its rows not written, it
 * calls the previous one. Returns the version, or 0: no program was called. */
uint16 Sys_Start_Update(void);
/* Confirms the program that was called last. false: none was called, or its flag cannot be written, as above. */
bool Sys_Confirm_Update(void);

#ifdef __cplusplus
}
#endif

#endif
