/* Compares the soft-float sources, compiled for the host, with the host's floating-point hardware. argv[1]: random
 * pairs per operation. Prints one line per operation; exits with status 1 if any result differs. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DECLARE(type, op) type __##op(type, type)
DECLARE(float, addsf3);
DECLARE(float, subsf3);
DECLARE(float, mulsf3);
DECLARE(float, divsf3);
DECLARE(double, adddf3);
DECLARE(double, subdf3);
DECLARE(double, muldf3);
DECLARE(double, divdf3);
#define DECLARE_COMPARE(op) int __##op##sf2(float, float); int __##op##df2(double, double)
DECLARE_COMPARE(eq);
DECLARE_COMPARE(ne);
DECLARE_COMPARE(lt);
DECLARE_COMPARE(le);
DECLARE_COMPARE(gt);
DECLARE_COMPARE(ge);
DECLARE_COMPARE(unord);
int32_t __fixsfsi(float), __fixdfsi(double);
uint32_t __fixunssfsi(float), __fixunsdfsi(double);
int64_t __fixsfdi(float), __fixdfdi(double);
uint64_t __fixunssfdi(float), __fixunsdfdi(double);
float __floatsisf(int32_t), __floatunsisf(uint32_t), __floatdisf(int64_t), __floatundisf(uint64_t);
double __floatsidf(int32_t), __floatunsidf(uint32_t), __floatdidf(int64_t), __floatundidf(uint64_t);
double __extendsfdf2(float);
float __truncdfsf2(double);

static uint64_t state = 0x9E3779B97F4A7C15u; /* xorshift64*, fixed seed */
static uint64_t random64(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1Du;
}

static float as_float(uint32_t bits) { float f; memcpy(&f, &bits, 4); return f; }
static double as_double(uint64_t bits) { double d; memcpy(&d, &bits, 8); return d; }
static uint32_t float_bits(float f) { uint32_t b; memcpy(&b, &f, 4); return b; }
static uint64_t double_bits(double d) { uint64_t b; memcpy(&b, &d, 8); return b; }

/* Magnitudes at limits: zero, subnormal, smallest normal, around 1, integer limits, largest, infinity, NaN. */
static const uint32_t edge32[] = {
    0, 1, 2, 3, 0x400000, 0x7FFFFE, 0x7FFFFF, 0x800000, 0x800001, 0xFFFFFF, 0x1000000, 0x33800000, 0x34000000, 0x3EFFFFFF,
    0x3F000000, 0x3F000001, 0x3F7FFFFF, 0x3F800000, 0x3F800001, 0x3FC00000, 0x3FFFFFFF, 0x40000000, 0x40400000, 0x46FFFE00,
    0x47000000, 0x477FFF00, 0x47800000, 0x4B000000, 0x4B7FFFFF, 0x4B800000, 0x4EFFFFFF, 0x4F000000, 0x4F7FFFFF, 0x4F800000,
    0x5EFFFFFF, 0x5F000000, 0x5F7FFFFF, 0x5F800000, 0x7E800000, 0x7F000000, 0x7F7FFFFE, 0x7F7FFFFF, 0x7F800000, 0x7F800001,
    0x7FC00000, 0x7FFFFFFF};
static const uint64_t edge64[] = {
    0, 1, 2, 3, 0x8000000000000, 0xFFFFFFFFFFFFE, 0xFFFFFFFFFFFFF, 0x10000000000000, 0x10000000000001, 0x1FFFFFFFFFFFFF,
    0x20000000000000, 0x3690000000000000, 0x36A0000000000000, 0x36A0000000000001, 0x380FFFFFFFFFFFFF, 0x3810000000000000,
    0x3CA0000000000000, 0x3CB0000000000000, 0x3FE0000000000000, 0x3FEFFFFFFFFFFFFF, 0x3FF0000000000000, 0x3FF0000000000001,
    0x3FF8000000000000, 0x3FFFFFFFFFFFFFFF, 0x4000000000000000, 0x4008000000000000, 0x40DFFFC000000000, 0x40E0000000000000,
    0x41DFFFFFFFC00000, 0x41DFFFFFFFFFFFFF, 0x41E0000000000000, 0x41EFFFFFFFE00000, 0x41F0000000000000, 0x4330000000000000,
    0x433FFFFFFFFFFFFF, 0x43DFFFFFFFFFFFFF, 0x43E0000000000000, 0x43EFFFFFFFFFFFFF, 0x43F0000000000000, 0x47EFFFFFDFFFFFFF,
    0x47EFFFFFE0000000, 0x47EFFFFFEFFFFFFF, 0x47EFFFFFF0000000, 0x47F0000000000000, 0x7FE0000000000000, 0x7FEFFFFFFFFFFFFF,
    0x7FF0000000000000, 0x7FF0000000000001, 0x7FF8000000000000, 0x7FFFFFFFFFFFFFFF};
#define COUNT(a) (sizeof(a) / sizeof(a)[0])

/* Returns one of: random bits; a number whose exponent is close to that of `near`; a number with few significant
 * bits. */
static uint32_t random_float(uint32_t near)
{
    uint64_t r = random64();
    uint32_t bits = (uint32_t)r;
    switch ((r >> 32) % 3) {
    case 0: return bits;
    case 1: return (bits & 0x807FFFFF) | (((near >> 23) + (uint32_t)(r >> 40) % 53 - 26 & 0xFF) << 23);
    default: return bits & ~(0x7FFFFFu >> (r >> 40) % 24);
    }
}
static uint64_t random_double(uint64_t near)
{
    uint64_t bits = random64(), r = random64();
    switch (r % 3) {
    case 0: return bits;
    case 1: return (bits & 0x800FFFFFFFFFFFFF) | (((near >> 52) + (r >> 8) % 111 - 55 & 0x7FF) << 52);
    default: return bits & ~(0xFFFFFFFFFFFFFu >> (r >> 8) % 53);
    }
}

static unsigned long failures, checks;
static void report(const char *name)
{
    printf("%s %lu checks %lu failures\n", name, checks, failures);
    checks = 0;
}
static void note(const char *name, uint64_t x, uint64_t y, uint64_t got, uint64_t want)
{
    if (failures++ < 20)
        printf("%s(%" PRIx64 ", %" PRIx64 ") = %" PRIx64 ", expected %" PRIx64 "\n", name, x, y, got, want);
}

typedef void check32(uint32_t, uint32_t);
typedef void check64(uint64_t, uint64_t);
static void pairs32(const char *name, check32 *check, long n)
{
    for (size_t i = 0; i < 4 * COUNT(edge32) * COUNT(edge32); i++)
        check(edge32[i / 4 % COUNT(edge32)] | (uint32_t)(i & 1) << 31,
              edge32[i / 4 / COUNT(edge32)] | (uint32_t)(i & 2) << 30);
    for (long i = 0; i < n; i++) {
        uint32_t x = random_float(0x3F800000);
        check(x, i % 8 ? random_float(x) : edge32[random64() % COUNT(edge32)]);
    }
    report(name);
}
static void pairs64(const char *name, check64 *check, long n)
{
    for (size_t i = 0; i < 4 * COUNT(edge64) * COUNT(edge64); i++)
        check(edge64[i / 4 % COUNT(edge64)] | (uint64_t)(i & 1) << 63,
              edge64[i / 4 / COUNT(edge64)] | (uint64_t)(i & 2) << 62);
    for (long i = 0; i < n; i++) {
        uint64_t x = random_double(0x3FF0000000000000);
        check(x, i % 8 ? random_double(x) : edge64[random64() % COUNT(edge64)]);
    }
    report(name);
}

#define ARITHMETIC(name, width, type, operator)                                                                      \
    static void check_##name(uint##width##_t x, uint##width##_t y)                                                   \
    {                                                                                                                \
        volatile type a = as_##type(x), b = as_##type(y);                                                            \
        type want = a operator b, got = __##name(as_##type(x), as_##type(y));                                        \
        checks++;                                                                                                    \
        if (!(isnan(want) && isnan(got)) && type##_bits(want) != type##_bits(got))                                   \
            note(#name, x, y, type##_bits(got), type##_bits(want));                                                  \
    }
ARITHMETIC(addsf3, 32, float, +)
ARITHMETIC(subsf3, 32, float, -)
ARITHMETIC(mulsf3, 32, float, *)
ARITHMETIC(divsf3, 32, float, /)
ARITHMETIC(adddf3, 64, double, +)
ARITHMETIC(subdf3, 64, double, -)
ARITHMETIC(muldf3, 64, double, *)
ARITHMETIC(divdf3, 64, double, /)

#define COMPARISONS(width, type, suffix)                                                                             \
    static void check_compare##suffix(uint##width##_t x, uint##width##_t y)                                          \
    {                                                                                                                \
        type a = as_##type(x), b = as_##type(y);                                                                     \
        unsigned want = (a == b) | (a != b) << 1 | (a < b) << 2 | (a <= b) << 3 | (a > b) << 4 | (a >= b) << 5 |     \
                        (unsigned)(isnan(a) || isnan(b)) << 6;                                                       \
        unsigned got = (__eq##suffix(a, b) == 0) | (__ne##suffix(a, b) != 0) << 1 | (__lt##suffix(a, b) < 0) << 2 |  \
                       (__le##suffix(a, b) <= 0) << 3 | (__gt##suffix(a, b) > 0) << 4 |                              \
                       (__ge##suffix(a, b) >= 0) << 5 | (unsigned)(__unord##suffix(a, b) != 0) << 6;                 \
        checks++;                                                                                                    \
        if (want != got)                                                                                             \
            note("compare" #suffix, x, y, got, want);                                                                \
    }
COMPARISONS(32, float, sf2)
COMPARISONS(64, double, df2)

/* Saturating reference of float -> integer, because the C conversion is undefined outside the range. */
#define FIX(name, from_width, from, to, low, high)                                                                   \
    static void check_##name(uint##from_width##_t x, uint##from_width##_t unused)                                    \
    {                                                                                                                \
        from a = as_##from(x);                                                                                       \
        to want = isnan(a) ? 0 : a <= (from)low ? low : a >= (from)high ? high : (to)a, got = __##name(a);           \
        (void)unused;                                                                                                \
        checks++;                                                                                                    \
        if (want != got)                                                                                             \
            note(#name, x, 0, (uint64_t)got, (uint64_t)want);                                                        \
    }
FIX(fixsfsi, 32, float, int32_t, INT32_MIN, INT32_MAX)
FIX(fixunssfsi, 32, float, uint32_t, 0, UINT32_MAX)
FIX(fixsfdi, 32, float, int64_t, INT64_MIN, INT64_MAX)
FIX(fixunssfdi, 32, float, uint64_t, 0, UINT64_MAX)
FIX(fixdfsi, 64, double, int32_t, INT32_MIN, INT32_MAX)
FIX(fixunsdfsi, 64, double, uint32_t, 0, UINT32_MAX)
FIX(fixdfdi, 64, double, int64_t, INT64_MIN, INT64_MAX)
FIX(fixunsdfdi, 64, double, uint64_t, 0, UINT64_MAX)

/* Tests integers of every length: random bits shifted right. */
#define FROM_INTEGER(name, from, to)                                                                                 \
    static void check_##name(long n)                                                                                 \
    {                                                                                                                \
        for (long i = 0; i < n; i++) {                                                                               \
            from x = (from)(random64() >> random64() % 64);                                                          \
            if (i < 256)                                                                                             \
                x = (from)((i & 128 ? -1 : 1) * ((int64_t)((uint64_t)1 << (i & 63)) - (i >> 6 & 1)));                \
            volatile from v = x;                                                                                     \
            to want = (to)v, got = __##name(x);                                                                      \
            checks++;                                                                                                \
            if (memcmp(&want, &got, sizeof want))                                                                    \
                note(#name, (uint64_t)x, 0, sizeof got == 4 ? float_bits((float)got) : double_bits(got),             \
                     sizeof got == 4 ? float_bits((float)want) : double_bits(want));                                 \
        }                                                                                                            \
        report(#name);                                                                                               \
    }
FROM_INTEGER(floatsisf, int32_t, float)
FROM_INTEGER(floatunsisf, uint32_t, float)
FROM_INTEGER(floatdisf, int64_t, float)
FROM_INTEGER(floatundisf, uint64_t, float)
FROM_INTEGER(floatsidf, int32_t, double)
FROM_INTEGER(floatunsidf, uint32_t, double)
FROM_INTEGER(floatdidf, int64_t, double)
FROM_INTEGER(floatundidf, uint64_t, double)

static void check_extendsfdf2(uint32_t x, uint32_t unused)
{
    volatile float a = as_float(x);
    double want = a, got = __extendsfdf2(as_float(x));
    (void)unused;
    checks++;
    if (!(isnan(want) && isnan(got)) && double_bits(want) != double_bits(got))
        note("extendsfdf2", x, 0, double_bits(got), double_bits(want));
}
static void check_truncdfsf2(uint64_t x, uint64_t near)
{
    if (near & 1) /* most random doubles exceed the range of float: reduce the exponent */
        x = (x & 0x800FFFFFFFFFFFFF) | (0x360 + (x >> 52) % 0x120) << 52;
    volatile double a = as_double(x);
    float want = (float)a, got = __truncdfsf2(as_double(x));
    checks++;
    if (!(isnan(want) && isnan(got)) && float_bits(want) != float_bits(got))
        note("truncdfsf2", x, 0, float_bits(got), float_bits(want));
}

int main(int argc, char **argv)
{
    long n = argc > 1 ? atol(argv[1]) : 1000000;
#define PAIRS32(name) pairs32(#name, check_##name, n)
#define PAIRS64(name) pairs64(#name, check_##name, n)
    PAIRS32(addsf3), PAIRS32(subsf3), PAIRS32(mulsf3), PAIRS32(divsf3), PAIRS32(comparesf2);
    PAIRS64(adddf3), PAIRS64(subdf3), PAIRS64(muldf3), PAIRS64(divdf3), PAIRS64(comparedf2);
    PAIRS32(fixsfsi), PAIRS32(fixunssfsi), PAIRS32(fixsfdi), PAIRS32(fixunssfdi);
    PAIRS64(fixdfsi), PAIRS64(fixunsdfsi), PAIRS64(fixdfdi), PAIRS64(fixunsdfdi);
    check_floatsisf(n), check_floatunsisf(n), check_floatdisf(n), check_floatundisf(n);
    check_floatsidf(n), check_floatunsidf(n), check_floatdidf(n), check_floatundidf(n);
    PAIRS32(extendsfdf2), PAIRS64(truncdfsf2);
    return failures != 0;
}
