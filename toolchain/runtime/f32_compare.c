/* SPDX-License-Identifier: MIT */
/* Single-precision comparisons. The caller compares the result with 0. For NaN the result makes that comparison false
 * (abi-elf.md §2.8). */
#include "softfloat.h"

int __eqsf2(float left, float right);
int __nesf2(float left, float right);
int __ltsf2(float left, float right);
int __lesf2(float left, float right);
int __gtsf2(float left, float right);
int __gesf2(float left, float right);
int __unordsf2(float left, float right);

/* Return -1, 0 or 1; `unordered` if an operand is NaN. */
static int compare(uint32_t x, uint32_t y, int unordered)
{
    uint32_t x_magnitude = x & ~F32_SIGN, y_magnitude = y & ~F32_SIGN;
    if (x_magnitude > F32_INF || y_magnitude > F32_INF)
        return unordered;
    if (x == y || (x_magnitude | y_magnitude) == 0)
        return 0;
    int less = x & y & F32_SIGN ? x > y : (int32_t)x < (int32_t)y;
    return less ? -1 : 1;
}

int __lesf2(float left, float right)
{
    return compare(f32_bits(left), f32_bits(right), 1);
}

int __gesf2(float left, float right)
{
    return compare(f32_bits(left), f32_bits(right), -1);
}

int __eqsf2(float left, float right)
{
    return __lesf2(left, right);
}

int __nesf2(float left, float right)
{
    return __lesf2(left, right);
}

int __ltsf2(float left, float right)
{
    return __lesf2(left, right);
}

int __gtsf2(float left, float right)
{
    return __gesf2(left, right);
}

int __unordsf2(float left, float right)
{
    return (f32_bits(left) & ~F32_SIGN) > F32_INF || (f32_bits(right) & ~F32_SIGN) > F32_INF;
}
