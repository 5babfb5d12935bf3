/* SPDX-License-Identifier: MIT */
/* Checks of update.c and spread.c against forged and replayed programs and advertisements: `DEVICES := update
 * update_auth` links them; without update_auth nothing is checked (io/update_auth/README.md). */
#ifndef OPENSWARM_AUTHENTICATION_H
#define OPENSWARM_AUTHENTICATION_H

#include "update.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_ADVERTISEMENT_BYTES = 8, SYS_PROOF_KIND = 0xE0 };

#ifdef SYS_UPDATE_AUTH

enum { SYS_NEEDS_PROOFS = true };

/* Whether the rows of a store have the tag of these facts. A correct tag counts until Sys_Forget_UpdateTag. */
bool Sys_Is_UpdateAuthentic(uint8 store, const sys_update *facts);
void Sys_Forget_UpdateTag(uint8 store);
/* Whether the version is above all that Sys_Keep_UpdateVersion has kept. */
bool Sys_Is_UpdateAllowed(uint16 version);
/* Keeps the version of a whole program, before another one is stored. false: the cells do not hold it. If power fails
 * meanwhile, the version kept before remains. */
bool Sys_Keep_UpdateVersion(uint16 version);
/* Writes the message that proves an advertisement. Both have SYS_ADVERTISEMENT_BYTES. false: the robot has no key. */
bool Sys_Prove_Advertisement(const uint8 *advertisement, uint8 *proof);

#else

enum { SYS_NEEDS_PROOFS = false };

static inline bool Sys_Is_UpdateAuthentic(uint8 store, const sys_update *facts)
{
    (void)store;
    (void)facts;
    return true;
}

static inline void Sys_Forget_UpdateTag(uint8 store)
{
    (void)store;
}

static inline bool Sys_Is_UpdateAllowed(uint16 version)
{
    (void)version;
    return true;
}

static inline bool Sys_Keep_UpdateVersion(uint16 version)
{
    (void)version;
    return true;
}

static inline bool Sys_Prove_Advertisement(const uint8 *advertisement, uint8 *proof)
{
    (void)advertisement;
    (void)proof;
    return false;
}

#endif

#ifdef __cplusplus
}
#endif

#endif
