/* SPDX-License-Identifier: MIT */
/* C11 7.3: complex arithmetic. The functions follow annex G for finite numbers; results for infinities and NaN are those of
 * the formulas. long double is double, with the same functions. */
#ifndef COMPLEX_H
#define COMPLEX_H

#ifdef __cplusplus
#error "complex.h is a header of C"
#endif

#define complex _Complex
#define _Complex_I (__extension__(float _Complex){0.0f, 1.0f})
#define I _Complex_I
#define CMPLX(x, y) __builtin_complex((double)(x), (double)(y))
#define CMPLXF(x, y) __builtin_complex((float)(x), (float)(y))
#define CMPLXL(x, y) __builtin_complex((long double)(x), (long double)(y))

/* Functions from complex to complex, and from complex to real. */
#define COMPLEX_TO_COMPLEX(name)                                                            \
    double _Complex name(double _Complex z);                                                \
    float _Complex name##f(float _Complex z);                                               \
    long double _Complex name##l(long double _Complex z) __asm__(#name);
#define COMPLEX_TO_REAL(name)                                                               \
    double name(double _Complex z);                                                         \
    float name##f(float _Complex z);                                                        \
    long double name##l(long double _Complex z) __asm__(#name);
COMPLEX_TO_COMPLEX(cacos)
COMPLEX_TO_COMPLEX(casin)
COMPLEX_TO_COMPLEX(catan)
COMPLEX_TO_COMPLEX(ccos)
COMPLEX_TO_COMPLEX(csin)
COMPLEX_TO_COMPLEX(ctan)
COMPLEX_TO_COMPLEX(cacosh)
COMPLEX_TO_COMPLEX(casinh)
COMPLEX_TO_COMPLEX(catanh)
COMPLEX_TO_COMPLEX(ccosh)
COMPLEX_TO_COMPLEX(csinh)
COMPLEX_TO_COMPLEX(ctanh)
COMPLEX_TO_COMPLEX(cexp)
COMPLEX_TO_COMPLEX(clog)
COMPLEX_TO_COMPLEX(csqrt)
COMPLEX_TO_COMPLEX(conj)
COMPLEX_TO_COMPLEX(cproj)
COMPLEX_TO_REAL(cabs)
COMPLEX_TO_REAL(carg)
COMPLEX_TO_REAL(creal)
COMPLEX_TO_REAL(cimag)
#undef COMPLEX_TO_COMPLEX
#undef COMPLEX_TO_REAL
double _Complex cpow(double _Complex z, double _Complex exponent);
float _Complex cpowf(float _Complex z, float _Complex exponent);
long double _Complex cpowl(long double _Complex z, long double _Complex exponent) __asm__("cpow");

#endif
