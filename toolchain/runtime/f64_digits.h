/* SPDX-License-Identifier: MIT */
/* A 64-bit significand as an array of 16-bit digits, least significant first. */
#ifndef F64_DIGITS_H
#define F64_DIGITS_H

#include "softfloat.h"

#define DIGITS 4

static inline void split(uint64_t value, uint16_t *digits)
{
    for (uint16_t i = 0; i < DIGITS; i++) {
        digits[i] = (uint16_t)value;
        value >>= 16;
    }
}

static inline uint64_t join(const uint16_t *digits)
{
    return (uint64_t)((uint32_t)digits[3] << 16 | digits[2]) << 32 | ((uint32_t)digits[1] << 16 | digits[0]);
}

#endif
