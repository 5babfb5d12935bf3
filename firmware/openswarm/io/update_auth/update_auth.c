/* SPDX-License-Identifier: MIT */
/* The tags of programs and advertisements (README.md), and the highest version kept, in two records of which one is
 * always valid. */
#include "ascon.h"
#include "authentication.h"
#include "hal_update_auth.h"

enum { BLOCKS = HAL_UPDATE_ROW / SYS_ASCON_BYTES };

static uint8 authentic; /* bit n: the tag of store n was right */

/* Reads the key. false: it is erased, and an erased key is known to all. */
static bool __attribute__((noinline)) read_key(uint8 *key)
{
    uint8 all = 0xFF;
    hal_update_key(key);
    for (uint8 i = 0; i < SYS_ASCON_BYTES; i++) {
        all &= key[i];
    }
    return all != 0xFF;
}

static bool has_tag(uint8 store, const sys_update *facts)
{
    uint8 key[SYS_ASCON_BYTES], tag[SYS_ASCON_BYTES], row[HAL_UPDATE_ROW];
    uint8 nonce[SYS_ASCON_BYTES] = {(uint8)facts->version, (uint8)(facts->version >> 8), facts->rows};
    uint8 difference = 0;
    sys_ascon mac;
    bool has_key = read_key(key);
    Sys_Begin_AsconMac(&mac, key, nonce);
    for (uint8 i = 1; i <= facts->rows; i++) {
        uint8 blocks = i < facts->rows ? BLOCKS : BLOCKS - 1; /* the last block of the last row is the tag */
        hal_update_read(store, i, row);
        for (uint8 block = 0; block < blocks; block++) {
            Sys_Add_AsconMac(&mac, row + block * SYS_ASCON_BYTES);
        }
    }
    Sys_End_AsconMac(&mac, key, row, 0, tag);
    for (uint8 i = 0; i < SYS_ASCON_BYTES; i++) {
        difference |= tag[i] ^ row[(BLOCKS - 1) * SYS_ASCON_BYTES + i];
    }
    return difference == 0 && has_key;
}

bool Sys_Prove_Advertisement(const uint8 *advertisement, uint8 *proof)
{
    uint8 key[SYS_ASCON_BYTES], tag[SYS_ASCON_BYTES], nonce[SYS_ASCON_BYTES];
    sys_ascon mac;
    for (uint8 i = 0; i < SYS_ASCON_BYTES; i++) { /* the number of rows is where the nonce of a program has a zero */
        nonce[i] = i < SYS_ADVERTISEMENT_BYTES ? advertisement[i] : 0;
    }
    bool has_key = read_key(key);
    Sys_Begin_AsconMac(&mac, key, nonce);
    Sys_End_AsconMac(&mac, key, advertisement, SYS_ADVERTISEMENT_BYTES, tag);
    proof[0] = SYS_PROOF_KIND; /* instead of the tag's first byte */
    for (uint8 i = 1; i < SYS_ADVERTISEMENT_BYTES; i++) {
        proof[i] = tag[i];
    }
    return has_key;
}

bool Sys_Is_UpdateAuthentic(uint8 store, const sys_update *facts)
{
    uint8 bit = (uint8)(1u << store);
    if ((authentic & bit) == 0 && has_tag(store, facts)) {
        authentic |= bit;
    }
    return (authentic & bit) != 0;
}

void Sys_Forget_UpdateTag(uint8 store)
{
    authentic &= (uint8)~(1u << store);
}

/* Returns the version in a record, or 0. An interrupted write leaves 1s, which the complement reveals. */
static uint16 kept(uint8 record)
{
    uint16 version = hal_update_cell((uint8)(2 * record));
    return (version ^ hal_update_cell((uint8)(2 * record + 1))) == 0xFFFF ? version : 0;
}

static uint16 highest(void)
{
    uint16 one = kept(0), other = kept(1);
    return one > other ? one : other;
}

bool Sys_Is_UpdateAllowed(uint16 version)
{
    return version > highest();
}

bool Sys_Keep_UpdateVersion(uint16 version)
{
    if (version <= highest()) {
        return true;
    }
    uint8 record = kept(0) > kept(1) ? 1 : 0; /* the other one stays valid meanwhile */
    hal_update_set_cell((uint8)(2 * record), version);
    hal_update_set_cell((uint8)(2 * record + 1), (uint16)~version);
    return kept(record) == version;
}
