/* SPDX-License-Identifier: MIT */
/* Failed assertions (C11 7.2.1.1). */
#include <stdio.h>
#include <stdlib.h>

_Noreturn void __assert_fail(const char *condition, const char *file, int line);

_Noreturn void __assert_fail(const char *condition, const char *file, int line)
{
    printf("%s:%d: assertion failed: %s\n", file, line, condition);
    abort();
}
