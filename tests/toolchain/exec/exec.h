/* Macros of the execution tests. TEST(name, "paragraph") defines one case; the harness calls every case of a file and
 * reads one line per case from UART1. Values pass through volatile objects so that nothing is computed at compile time. */
#ifndef EXEC_H
#define EXEC_H

#include <stdint.h>

extern int exec_failed_line;

#define TEST(name, paragraph) void test_##name(void)
#define CHECK(condition)                    \
    do {                                    \
        if (!(condition)) {                 \
            exec_failed_line = __LINE__;    \
            return;                         \
        }                                   \
    } while (0)
/* Makes a value unknown to the compiler. */
#define OPAQUE(type, value) (*(volatile type *)&(type){value})
#define I(value) OPAQUE(int, value)
#define U(value) OPAQUE(unsigned, value)
#define L(value) OPAQUE(long, value)
#define UL(value) OPAQUE(unsigned long, value)
#define LL(value) OPAQUE(long long, value)
#define ULL(value) OPAQUE(unsigned long long, value)
#define C(value) OPAQUE(signed char, value)
#define UC(value) OPAQUE(unsigned char, value)
#define F(value) OPAQUE(float, value)
#define D(value) OPAQUE(double, value)
#define NOINLINE __attribute__((__noinline__))

#endif
