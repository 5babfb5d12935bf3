/* SPDX-License-Identifier: MIT */
/* Hamming (15,11): bits 10-0 are data, 14-11 parity. Each bit has a position from 1 to 15; parity bits have the
 * powers of two. The XOR of the positions of all ones (the syndrome) is 0, or the position of the bit in error. */
#include "hal_compiler.h"
#include "infrared_parts.h"

static const uint8 place_of[DATA_BITS] = {3, 5, 6, 7, 9, 10, 11, 12, 13, 14, 15};

/* Mask of the bit at each position. */
static const uint16 bit_at[CODE_BITS + 1] = {0,      0x0800, 0x1000, 0x0001, 0x2000, 0x0002, 0x0004, 0x0008,
                                             0x4000, 0x0010, 0x0020, 0x0040, 0x0080, 0x0100, 0x0200, 0x0400};

static uint8 parity_of(uint16 data)
{
    uint8 sum = 0;
    for (const uint8 *place = place_of; place != place_of + DATA_BITS; place++) {
        if (data & 1u) {
            sum ^= *place;
        }
        data >>= 1;
    }
    return sum;
}

uint16 coder_encode(uint16 data)
{
    data &= 0x07FFu;
    return (uint16)(data | (uint16)parity_of(data) << DATA_BITS);
}

uint16 coder_decode(uint16 word, uint8 *repairs)
{
    uint8 syndrome = (uint8)(parity_of(word) ^ (word >> DATA_BITS & 0x0Fu));
    if (syndrome != 0) {
        word ^= bit_at[syndrome];
        ++*repairs;
    }
    return word & 0x07FFu;
}

BOUNDS_AT("while (", loop 17); /* FRAME_HEADER + FRAME_PAYLOAD */
uint16 coder_crc(const uint8 *bytes, uint8 size)
{
    uint16 crc = 0xFFFFu;
    while (size-- != 0) {
        uint8 x = (uint8)(crc >> 8 ^ *bytes++); /* eight steps of the polynomial 0x1021 at once */
        x ^= (uint8)(x >> 4);
        crc = (uint16)(crc << 8 ^ (uint16)x << 12 ^ (uint16)x << 5 ^ x);
    }
    return crc;
}
