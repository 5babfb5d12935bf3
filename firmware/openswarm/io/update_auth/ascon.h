/* SPDX-License-Identifier: MIT */
/* Message authentication by Ascon-AEAD128 (NIST SP 800-232) with an empty plaintext: the message is the associated
 * data, and the tag authenticates it. One key must not be used for two messages with the same nonce.
 *
 *     Sys_Begin_AsconMac(&mac, key, nonce);
 *     Sys_Add_AsconMac(&mac, block);                     for each whole block of the message
 *     Sys_End_AsconMac(&mac, key, rest, count, tag);     the bytes that are left over
 *
 * Time does not depend on key or message. */
#ifndef OPENSWARM_ASCON_H
#define OPENSWARM_ASCON_H

#include "openswarm.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SYS_ASCON_BYTES = 16 }; /* of a key, a nonce, a block and a tag */

typedef struct {
    uint16 word[5][4]; /* the standard's S0 to S4, the least significant 16 bits first */
} sys_ascon;

void Sys_Begin_AsconMac(sys_ascon *mac, const uint8 *key, const uint8 *nonce);
void Sys_Add_AsconMac(sys_ascon *mac, const uint8 *block);
/* count: 0 to SYS_ASCON_BYTES - 1. The message must not be empty. */
void Sys_End_AsconMac(sys_ascon *mac, const uint8 *key, const uint8 *rest, uint8 count, uint8 *tag);

#ifdef __cplusplus
}
#endif

#endif
