/* SPDX-License-Identifier: MIT */
/* Ascon-AEAD128 without plaintext (ascon.h), in words of 16 bits. A rotation by n is a choice of two words by n / 16 and
 * shifts by n % 16, which is 0 for none of the standard's rotations. */
#include "ascon.h"

enum {
    WORDS = 5,
    PARTS = 4,
    BLOCK = 2 * PARTS, /* 16-bit parts of a block */
    INITIAL = 0xF0,    /* constant of the first of twelve rounds */
    ABSORBING = 0xB4,  /* constant of the first of eight */
    STEP = 0x0F,
    LAST = 0x4B,
    PADDING = 0x01,
    SEPARATOR = 0x8000
};

static const uint8 rotations[WORDS][2] = {{19, 28}, {61, 39}, {1, 6}, {10, 17}, {7, 41}};

/* Adds `old`, rotated to the right, to `word`. */
static void __attribute__((noinline)) add_rotated(uint16 *word, const uint16 *old, uint8 by)
{
    uint16 shift = by % 16u, from = by / 16u, low = old[from];
    for (uint16 part = PARTS; part-- != 0; word++) {
        from = (from + 1u) % PARTS;
        uint16 high = old[from];
        *word ^= (uint16)(low >> shift | high << (16u - shift));
        low = high;
    }
}

static void substitute(uint16 (*s)[PARTS], uint8 part)
{
    uint16 x0 = s[0][part], x1 = s[1][part], x2 = s[2][part], x3 = s[3][part], x4 = s[4][part];
    x0 ^= x4;
    x4 ^= x3;
    x2 ^= x1;
    uint16 y0 = x0 ^ (uint16)(~x1 & x2), y1 = x1 ^ (uint16)(~x2 & x3), y2 = x2 ^ (uint16)(~x3 & x4);
    uint16 y3 = x3 ^ (uint16)(~x4 & x0), y4 = x4 ^ (uint16)(~x0 & x1);
    s[0][part] = y0 ^ y4;
    s[1][part] = y1 ^ y0;
    s[2][part] = (uint16)~y2;
    s[3][part] = y3 ^ y2;
    s[4][part] = y4;
}

static void diffuse(uint16 *word, const uint8 *by)
{
    uint16 old[PARTS];
    for (uint8 part = 0; part < PARTS; part++) {
        old[part] = word[part];
    }
    add_rotated(word, old, by[0]);
    add_rotated(word, old, by[1]);
}

/* The permutation from the round with this constant on. */
static void __attribute__((noinline)) permute(sys_ascon *mac, uint8 constant)
{
    for (; constant >= LAST; constant -= STEP) {
        mac->word[2][0] ^= constant;
        for (uint8 part = 0; part < PARTS; part++) {
            substitute(mac->word, part);
        }
        for (uint8 i = 0; i < WORDS; i++) {
            diffuse(mac->word[i], rotations[i]);
        }
    }
}

/* Adds 16 bytes to the state from `word` on. */
static void __attribute__((noinline)) add(uint16 *word, const uint8 *bytes)
{
    for (uint8 part = 0; part < BLOCK; part++, bytes += 2) {
        *word++ ^= (uint16)(bytes[0] | (uint16)bytes[1] << 8);
    }
}

void Sys_Begin_AsconMac(sys_ascon *mac, const uint8 *key, const uint8 *nonce)
{
    *mac = (sys_ascon){{{0x0001, 0x808C, 0x1000, 0x0000}}}; /* rate, key and tag lengths, rounds */
    add(mac->word[1], key);
    add(mac->word[3], nonce);
    permute(mac, INITIAL);
    add(mac->word[3], key);
}

void Sys_Add_AsconMac(sys_ascon *mac, const uint8 *block)
{
    add(mac->word[0], block);
    permute(mac, ABSORBING);
}

void Sys_End_AsconMac(sys_ascon *mac, const uint8 *key, const uint8 *rest, uint8 count, uint8 *tag)
{
    uint8 padded[SYS_ASCON_BYTES] = {0};
    for (uint8 i = 0; i < count; i++) {
        padded[i] = rest[i];
    }
    padded[count] = PADDING;
    Sys_Add_AsconMac(mac, padded);
    mac->word[4][PARTS - 1] ^= SEPARATOR;
    mac->word[0][0] ^= PADDING; /* the empty plaintext */
    add(mac->word[2], key);
    permute(mac, INITIAL);
    add(mac->word[3], key);
    for (uint8 part = 0; part < BLOCK; part++) {
        uint16 word = mac->word[3 + part / PARTS][part % PARTS];
        *tag++ = (uint8)word;
        *tag++ = (uint8)(word >> 8);
    }
}
