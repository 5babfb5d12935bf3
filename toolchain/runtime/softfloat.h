/* SPDX-License-Identifier: MIT */
/* Common to the soft-float sources: bit patterns of IEC 60559 single and double, and the unpacked form of numbers.
 *
 * An unpacked number consists of sign, biased exponent and significand. The leading one of the significand is bit 30
 * (single) or 62 (double). The 7 or 10 bits below the last kept bit are guard bits; the lowest of them is sticky: it is
 * set if a bit that was shifted out was not 0. With exponent 1 the leading one may be missing, as in subnormal
 * numbers. */
#ifndef SOFTFLOAT_H
#define SOFTFLOAT_H

#include <stdint.h>

#define F32_SIGN 0x80000000UL
#define F32_INF 0x7F800000UL
#define F32_NAN 0x7FC00000UL
#define F32_QUIET 0x00400000UL
#define F32_MANTISSA 0x007FFFFFUL
#define F32_TOP 0x40000000UL
#define F32_BIAS 127

#define F64_SIGN 0x8000000000000000ULL
#define F64_INF 0x7FF0000000000000ULL
#define F64_NAN 0x7FF8000000000000ULL
#define F64_QUIET 0x0008000000000000ULL
#define F64_MANTISSA 0x000FFFFFFFFFFFFFULL
#define F64_TOP 0x4000000000000000ULL
#define F64_BIAS 1023

static inline uint32_t f32_bits(float value)
{
    union {
        float value;
        uint32_t bits;
    } pun = {value};
    return pun.bits;
}

static inline float f32_value(uint32_t bits)
{
    union {
        uint32_t bits;
        float value;
    } pun = {bits};
    return pun.value;
}

static inline uint64_t f64_bits(double value)
{
    union {
        double value;
        uint64_t bits;
    } pun = {value};
    return pun.bits;
}

static inline double f64_value(uint64_t bits)
{
    union {
        uint64_t bits;
        double value;
    } pun = {bits};
    return pun.value;
}

/* Round to nearest even, handle overflow and underflow, pack. `sign` is 0 or the sign bit. */
uint32_t __f32_pack(uint32_t sign, int16_t exponent, uint32_t significand);
uint64_t __f64_pack(uint64_t sign, int16_t exponent, uint64_t significand);

/* Shift right by any count >= 0; bits shifted out set the lowest bit. */
uint32_t __f32_shift_sticky(uint32_t significand, int16_t count);
uint64_t __f64_shift_sticky(uint64_t significand, int16_t count);

/* Return the number of leading zeros of a nonzero number. */
int16_t __f32_leading_zeros(uint32_t value);
int16_t __f64_leading_zeros(uint64_t value);

/* Return the significand of a finite nonzero magnitude, leading one in the top bit (31 or 63); *exponent becomes the
 * biased exponent, below 1 for subnormal numbers. */
uint32_t __f32_unpack(uint32_t magnitude, int16_t *exponent);
uint64_t __f64_unpack(uint64_t magnitude, int16_t *exponent);

/* Return dividend / divisor if the quotient fits 16 bits: one hardware division on the target. */
#ifdef __dsPIC30F__
unsigned int __dspic_divud(unsigned long dividend, unsigned int divisor);
static inline uint16_t divide_32_16(uint32_t dividend, uint16_t divisor)
{
    return __dspic_divud(dividend, divisor);
}
#else
static inline uint16_t divide_32_16(uint32_t dividend, uint16_t divisor)
{
    return (uint16_t)(dividend / divisor);
}
#endif

#endif
