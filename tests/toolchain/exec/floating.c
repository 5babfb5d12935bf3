/* float and double: arithmetic, comparison, conversion, special values, math.h. */
#include "exec.h"

#include <float.h>
#include <math.h>

static unsigned long bits(float f) { union { float f; unsigned long l; } u = {f}; return u.l; }
static unsigned long long bits_d(double d) { union { double d; unsigned long long l; } u = {d}; return u.l; }

TEST(float_representation, "C11 5.2.4.2.2") { CHECK(bits(F(1.0f)) == 0x3F800000ul && bits(F(-0.15625f)) == 0xBE200000ul && bits(F(3.4028235e38f)) == 0x7F7FFFFFul); }
TEST(double_representation, "C11 5.2.4.2.2") { CHECK(bits_d(D(1.0)) == 0x3FF0000000000000ull && bits_d(D(-0.1)) == 0xBFB999999999999Aull && sizeof(double) == 8); }
TEST(float_add, "C11 6.5.6") { CHECK(F(1.5f) + F(2.25f) == 3.75f && F(0.1f) + F(0.2f) == 0.3f && F(1e10f) + F(1.0f) == 1e10f && F(1.0f) + F(-1.0f) == 0.0f); }
TEST(float_subtract, "C11 6.5.6") { CHECK(F(5.0f) - F(7.5f) == -2.5f && F(16777216.0f) - F(1.0f) == 16777215.0f && F(1.0000001f) - F(1.0f) == FLT_EPSILON); }
TEST(float_multiply, "C11 6.5.5") { CHECK(F(1.5f) * F(-2.0f) == -3.0f && F(1e20f) * F(1e20f) == INFINITY && F(1e-30f) * F(1e-30f) == 0.0f && F(3.0f) * F(0.333333343f) == 1.0f); }
TEST(float_divide, "C11 6.5.5") { CHECK(F(7.0f) / F(2.0f) == 3.5f && F(1.0f) / F(3.0f) == 0.333333343f && F(-1.0f) / F(0.0f) == -INFINITY && F(1.0f) / F(10.0f) == 0.1f); }
TEST(double_add, "C11 6.5.6") { CHECK(D(0.1) + D(0.2) == 0.30000000000000004 && D(1e16) + D(1.0) == 1e16 && D(1.0) + D(DBL_EPSILON) > 1.0); }
TEST(double_multiply, "C11 6.5.5") { CHECK(D(1.1) * D(1.1) == 1.2100000000000002 && D(1e200) * D(1e200) == HUGE_VAL && D(-3.0) * D(4.0) == -12.0); }
TEST(double_divide, "C11 6.5.5") { CHECK(D(1.0) / D(3.0) == 0.3333333333333333 && D(10.0) / D(4.0) == 2.5 && D(1.0) / D(-0.0) == -HUGE_VAL); }
TEST(subnormal_float, "C11 5.2.4.2.2p10") { CHECK(F(1.17549435e-38f) / F(2.0f) == 5.87747175e-39f && bits(F(1.4e-45f)) == 1 && F(1.4e-45f) / F(2.0f) == 0.0f && F(5.87747175e-39f) * F(2.0f) == FLT_MIN); }
TEST(subnormal_double, "C11 5.2.4.2.2p10") { CHECK(D(DBL_MIN) / D(2.0) > 0 && bits_d(D(4.9406564584124654e-324)) == 1 && D(DBL_MIN) / D(4.0) * D(4.0) == DBL_MIN); }
TEST(rounds_to_nearest_even, "C11 F.10") { CHECK(F(16777216.0f) + F(1.0f) == 16777216.0f && F(16777218.0f) + F(1.0f) == 16777220.0f && D(9007199254740992.0) + D(1.0) == 9007199254740992.0); }
TEST(negative_zero, "C11 F.3") { float z = F(-0.0f); CHECK(z == 0.0f && bits(z) == 0x80000000ul && bits(-F(0.0f)) == 0x80000000ul && 1.0f / z == -INFINITY && bits(F(1.0f) - F(1.0f)) == 0); }
TEST(nan_comparisons, "C11 F.9.3") { float n = F(NAN); CHECK(!(n == n) && n != n && !(n < 1.0f) && !(n > 1.0f) && !(n <= n) && !(n >= n) && isnan(n)); }
TEST(double_nan_comparisons, "C11 F.9.3") { double n = D(NAN); CHECK(!(n == n) && n != n && !(n < 1.0) && !(n > 1.0) && !(n <= n) && !(n >= n) && isnan(n)); }
TEST(nan_in_negated_conditions, "C11 F.9.3") { double n = D(NAN); int r = 0; if (!(n < 0)) r |= 1; if (!(n >= 0)) r |= 2; if (n < 0 || n >= 0) r |= 4; CHECK(r == 3); }
TEST(infinity_arithmetic, "C11 F.10") { float i = F(INFINITY); CHECK(i + 1.0f == i && -i < 0.0f && isnan(i - i) && i * 2.0f == i && 1.0f / i == 0.0f && isinf(i) && i > FLT_MAX); }
TEST(float_ordering, "C11 6.5.8") { CHECK(F(-2.0f) < F(-1.0f) && F(-1.0f) < F(1.0f) && F(1.0f) < F(1.5f) && F(1e-40f) > F(0.0f) && F(-0.0f) >= F(0.0f) && F(3.0f) <= F(3.0f)); }
TEST(double_ordering, "C11 6.5.8") { CHECK(D(-2.0) < D(-1.0) && D(1.0000000000000002) > D(1.0) && D(-1e300) < D(1e-300) && !(D(2.0) < D(2.0))); }
TEST(float_to_int, "C11 6.3.1.4p1") { CHECK((int)F(3.99f) == 3 && (int)F(-3.99f) == -3 && (long)F(-70000.5f) == -70000L && (unsigned)F(65535.0f) == 65535u && (unsigned long)F(4e9f) == 4000000000ul); }
TEST(float_to_narrow, "C11 6.3.1.4p1") { CHECK((signed char)F(-100.7f) == -100 && (unsigned char)F(200.9f) == 200 && (_Bool)F(0.1f) == 1); }
TEST(float_to_long_long, "C11 6.3.1.4p1") { CHECK((long long)F(-1e15f) == -999999986991104ll && (unsigned long long)F(1e18f) == 999999984306749440ull); }
TEST(double_to_integers, "C11 6.3.1.4p1") { CHECK((int)D(-32768.9) == -32767 - 1 && (long)D(2147483647.5) == 2147483647L && (long long)D(9007199254740993.0) == 9007199254740992ll && (unsigned long)D(4294967295.0) == 4294967295ul); }
TEST(int_to_float, "C11 6.3.1.4p2") { CHECK((float)I(-5) == -5.0f && (float)U(65535u) == 65535.0f && (float)L(-123456) == -123456.0f && (float)UL(4294967295ul) == 4294967296.0f && (float)C(-1) == -1.0f); }
TEST(int_to_float_rounds, "C11 6.3.1.4p2") { CHECK((float)L(16777217) == 16777216.0f && (float)L(16777219) == 16777220.0f && (float)LL(0x7FFFFFFFFFFFFFFFll) == 9223372036854775808.0f); }
TEST(int_to_double, "C11 6.3.1.4p2") { CHECK((double)I(-5) == -5.0 && (double)L(-2147483647 - 1) == -2147483648.0 && (double)ULL(0xFFFFFFFFFFFFFFFF) == 18446744073709551616.0 && (double)LL(-9007199254740993ll) == -9007199254740992.0); }
TEST(float_to_double, "C11 6.3.1.5p1") { CHECK((double)F(0.1f) == 0.10000000149011612 && (double)F(-1e-45f) < 0 && (double)F(INFINITY) == HUGE_VAL); }
TEST(double_to_float, "C11 6.3.1.5p2") { CHECK((float)D(0.1) == 0.1f && (float)D(1e300) == INFINITY && (float)D(1e-300) == 0.0f); }
TEST(usual_arithmetic_conversions, "C11 6.3.1.8p1") { CHECK(sizeof(F(1.0f) + D(1.0)) == 8 && sizeof(F(1.0f) + L(1)) == 4 && F(0.5f) + I(2) == 2.5f && L(100000) * D(0.5) == 50000.0); }
TEST(compound_assignments, "C11 6.5.16.2") { float f = F(2.0f); f += 1; f *= 3; f -= 0.5f; f /= 2; CHECK(f == 4.25f); int i = I(7); i *= 1.5; CHECK(i == 10); }
TEST(increment, "C11 6.5.2.4") { float f = F(0.5f); double d = D(-1.0); f++; ++f; d--; CHECK(f == 2.5f && d == -2.0); }
TEST(unary_minus, "C11 6.5.3.3") { CHECK(-F(2.5f) == -2.5f && -D(-3.0) == 3.0 && !F(0.0f) && !!D(0.001)); }
TEST(float_in_conditions, "C11 6.8.4.1p2") { int r = 0; if (F(0.0f)) r |= 1; if (F(1e-40f)) r |= 2; if (D(-0.0)) r |= 4; if (D(NAN)) r |= 8; CHECK(r == 10); }
static NOINLINE float mix(float a, int n, float b, double c, int m) { return a * (float)n + b * (float)m + (float)c; }
TEST(float_arguments, "abi-elf.md 2.2") { CHECK(mix(F(1.5f), I(2), F(0.25f), D(10.0), I(4)) == 14.0f); }
TEST(array_of_floats, "C11 6.5.2.1") { float a[5]; for (int i = 0; i < 5; i++) a[i] = (float)i / 4; float sum = 0; for (int i = 0; i < I(5); i++) sum += a[i]; CHECK(sum == 2.5f); }
TEST(dot_product, "C11 6.5.5") { static const float a[] = {1, 2, 3, 4}, b[] = {0.5f, 0.25f, 2, -1}; float s = 0; for (int i = 0; i < 4; i++) s += a[i] * b[i]; CHECK(s == 3.0f); }
TEST(series_for_e, "C11 6.5.5") { double e = 1, t = 1; for (int i = 1; i < I(20); i++) { t /= i; e += t; } CHECK(e > 2.718281828459044 && e < 2.718281828459047); }
TEST(newton_root, "C11 6.5.5") { float x = F(2.0f), r = x; for (int i = 0; i < 6; i++) r = 0.5f * (r + x / r); CHECK(r > 1.4142134f && r < 1.4142137f); }
TEST(rounding_functions, "C11 7.12.9") { CHECK(floor(D(-1.5)) == -2 && ceil(D(-1.5)) == -1 && trunc(D(-1.5)) == -1 && round(D(-1.5)) == -2 && floorf(F(2.7f)) == 2 && ceilf(F(2.1f)) == 3); }
TEST(fabs_and_copysign, "C11 7.12.7.2") { CHECK(fabs(D(-2.5)) == 2.5 && fabsf(F(-2.5f)) == 2.5f && bits(copysignf(F(1.0f), F(-0.0f))) == 0xBF800000ul && fmin(D(1), D(2)) == 1 && fmax(D(1), D(2)) == 2); }
TEST(square_roots, "C11 7.12.7.5") { CHECK(sqrt(D(2.0)) == 1.4142135623730951 && sqrtf(F(2.0f)) == 1.41421354f && sqrt(D(0.25)) == 0.5 && isnan(sqrt(D(-1.0))) && sqrtf(F(1e-40f)) > 9.9e-21f); }
TEST(fmod_is_exact, "C11 7.12.10.1") { CHECK(fmod(D(10.5), D(3.0)) == 1.5 && fmod(D(-10.5), D(3.0)) == -1.5 && fmodf(F(7.25f), F(0.5f)) == 0.25f && fmod(D(1e15), D(7.0)) == 6.0); }
TEST(trigonometry, "C11 7.12.4") { CHECK(sinf(F(0.0f)) == 0 && fabsf(sinf(F(1.0f)) - 0.841470985f) < 2e-7f && fabs(cos(D(2.0)) + 0.4161468365471424) < 1e-15 && fabs(atan2(D(-1.0), D(-1.0)) + 2.356194490192345) < 1e-15); }
TEST(exponentials, "C11 7.12.6") { CHECK(fabs(exp(D(1.0)) - 2.718281828459045) < 1e-15 && fabsf(logf(F(10.0f)) - 2.30258509f) < 3e-7f && fabs(pow(D(2.0), D(0.5)) - 1.4142135623730951) < 1e-15 && pow(D(3.0), D(4.0)) == 81.0); }
TEST(frexp_and_ldexp, "C11 7.12.6.4") { int e; double m = frexp(D(48.0), &e); CHECK(m == 0.75 && e == 6 && ldexp(m, e) == 48.0 && ldexpf(F(1.0f), I(-149)) > 0); }
TEST(classification, "C11 7.12.3") { CHECK(isfinite(F(1.0f)) && !isfinite(F(INFINITY)) && isinf(D(-HUGE_VAL)) && !isnan(D(1.0)) && signbit(F(-0.0f)) && !signbit(D(1.0))); }
#define NEAR(got, want) (fabs((got) - (want)) <= 1e-15 * fabs(want))
TEST(hyperbolic_functions, "C11 7.12.5") { CHECK(NEAR(sinh(D(1.0)), 1.1752011936438014) && NEAR(cosh(D(1.0)), 1.5430806348152437) && NEAR(tanh(D(0.5)), 0.46211715726000979) && tanh(D(-50.0)) == -1 && isinf(cosh(D(800.0)))); }
TEST(inverse_hyperbolic_functions, "C11 7.12.5") { CHECK(NEAR(asinh(D(-2.0)), -1.4436354751788103) && NEAR(acosh(D(3.0)), 1.7627471740390861) && NEAR(atanh(D(0.25)), 0.25541281188299536) && isnan(acosh(D(0.5))) && isinf(atanh(D(1.0)))); }
TEST(exponentials_near_their_zeros, "C11 7.12.6") { CHECK(NEAR(expm1(D(1e-9)), 1.0000000005000000e-9) && NEAR(log1p(D(-1e-9)), -1.0000000005000000e-9) && exp2(D(-3.0)) == 0.125 && log2(D(1024.0)) == 10 && exp2f(F(5.0f)) == 32 && isinf(log1p(D(-1.0)))); }
TEST(cube_roots, "C11 7.12.7.1") { CHECK(cbrt(D(-27.0)) == -3 && cbrtf(F(0.001f)) == 0.1f && signbit(cbrt(D(-0.0)))); }
TEST(rounding_to_even, "C11 7.12.9") { CHECK(rint(D(2.5)) == 2 && rintf(F(-1.5f)) == -2 && nearbyint(D(0.5)) == 0 && signbit(rint(D(-0.25))) && lrint(D(-70000.5)) == -70000 && lround(D(-70000.5)) == -70001 && llround(D(3e10)) == 30000000000 && lrintf(F(3.5f)) == 4); }
TEST(scaling, "C11 7.12.6") { CHECK(scalbn(D(3.0), I(-2)) == 0.75 && scalbln(D(1.0), L(-100000)) == 0 && isinf(scalblnf(F(1.0f), L(70000))) && logb(D(-10.0)) == 3 && logbf(F(0.0f)) == -INFINITY); }
TEST(neighbours, "C11 7.12.11") { CHECK(nextafter(D(1.0), D(2.0)) == 1 + DBL_EPSILON && nextafterf(F(0.0f), F(-1.0f)) == -FLT_TRUE_MIN && nexttowardf(F(1.0f), 0.5L) == 1 - FLT_EPSILON / 2 && isnan(nextafter(D(NAN), D(1.0))) && isnan(nan(""))); }
TEST(remainders_nearest, "C11 7.12.10") { int q; CHECK(remainder(D(7.0), D(4.0)) == -1 && remainder(D(6.0), D(4.0)) == -2 && remquo(D(-29.0), D(3.0), &q) == 1 && q == -2 && remainderf(F(5.5f), F(2.0f)) == -0.5f && isnan(remainder(D(1.0), D(0.0)))); }
TEST(fused_products, "C11 7.12.13.1") { double x = D(1 + DBL_EPSILON); CHECK(fma(x, x, D(-1.0)) == 2 * DBL_EPSILON + DBL_EPSILON * DBL_EPSILON && fmaf(F(1 + FLT_EPSILON), F(1 - FLT_EPSILON), F(-1.0f)) == -FLT_EPSILON * FLT_EPSILON && isinf(fma(D(1e200), D(1e200), D(-HUGE_VAL)))); }
TEST(positive_difference, "C11 7.12.12.1") { CHECK(fdim(D(3.0), D(1.0)) == 2 && fdim(D(1.0), D(3.0)) == 0 && isnan(fdimf(F(NAN), F(1.0f)))); }
TEST(long_double_functions, "C11 7.12") { long double x = D(2.25), whole; int e; CHECK(sqrtl(x) == 1.5L && fabsl(-x) == x && modfl(x, &whole) == 0.25L && whole == 2 && frexpl(x, &e) == 0.5625L && e == 2 && lroundl(x) == 2 && floorl(x) == 2 && powl(x, 2) == 5.0625L); }
