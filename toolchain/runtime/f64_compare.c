/* SPDX-License-Identifier: MIT */
/* Double-precision comparisons. The caller compares the result with 0. For NaN the result makes that comparison false
 * (abi-elf.md §2.8). */
#include "softfloat.h"

int __eqdf2(double left, double right);
int __nedf2(double left, double right);
int __ltdf2(double left, double right);
int __ledf2(double left, double right);
int __gtdf2(double left, double right);
int __gedf2(double left, double right);
int __unorddf2(double left, double right);

/* Return -1, 0 or 1; `unordered` if an operand is NaN. */
static int compare(uint64_t x, uint64_t y, int unordered)
{
    uint64_t x_magnitude = x & ~F64_SIGN, y_magnitude = y & ~F64_SIGN;
    if (x_magnitude > F64_INF || y_magnitude > F64_INF)
        return unordered;
    if (x == y || (x_magnitude | y_magnitude) == 0)
        return 0;
    int less = x & y & F64_SIGN ? x > y : (int64_t)x < (int64_t)y;
    return less ? -1 : 1;
}

int __ledf2(double left, double right)
{
    return compare(f64_bits(left), f64_bits(right), 1);
}

int __gedf2(double left, double right)
{
    return compare(f64_bits(left), f64_bits(right), -1);
}

int __eqdf2(double left, double right)
{
    return __ledf2(left, right);
}

int __nedf2(double left, double right)
{
    return __ledf2(left, right);
}

int __ltdf2(double left, double right)
{
    return __ledf2(left, right);
}

int __gtdf2(double left, double right)
{
    return __gedf2(left, right);
}

int __unorddf2(double left, double right)
{
    return (f64_bits(left) & ~F64_SIGN) > F64_INF || (f64_bits(right) & ~F64_SIGN) > F64_INF;
}
