/* SPDX-License-Identifier: MIT */
/* Formatted output (C11 7.21.6). Conversions: d i u x X o c s p % with flags - 0 + space #, width, precision, *, and
 * lengths hh h l ll z t j; f F e E g G are there when a program that uses them calls the _float variants.
 * There are no files: stdout and stderr both go to the hook __putchar. */
#ifndef STDIO_H
#define STDIO_H

#include <stdarg.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define EOF (-1)

typedef struct __stream FILE;
#define stdout ((FILE *)1)
#define stderr ((FILE *)2)

/* Where printf, puts and putchar send characters. The library's own sends to UART1, which it enables if need be;
 * a program that defines this function replaces it. Returns the character. */
int __putchar(int character);

int putchar(int character);
int fputc(int character, FILE *stream);
int putc(int character, FILE *stream);
int fputs(const char *__restrict text, FILE *__restrict stream);
size_t fwrite(const void *__restrict from, size_t size, size_t count, FILE *__restrict stream);
int fflush(FILE *stream);
int puts(const char *text);
int printf(const char *__restrict format, ...) __attribute__((__format__(__printf__, 1, 2)));
int vprintf(const char *__restrict format, va_list arguments) __attribute__((__format__(__printf__, 1, 0)));
int fprintf(FILE *__restrict stream, const char *__restrict format, ...) __attribute__((__format__(__printf__, 2, 3)));
int vfprintf(FILE *__restrict stream, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 2, 0)));
int sprintf(char *__restrict to, const char *__restrict format, ...) __attribute__((__format__(__printf__, 2, 3)));
int vsprintf(char *__restrict to, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 2, 0)));
int snprintf(char *__restrict to, size_t size, const char *__restrict format, ...)
    __attribute__((__format__(__printf__, 3, 4)));
int vsnprintf(char *__restrict to, size_t size, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 3, 0)));

int remove(const char *name); /* there are no files: always -1 */
int rename(const char *from, const char *to);

/* Conversions: d i u o x X p c s [ n %, with *, width and hh h l ll j z t L; a e f g too. There is no standard input. */
int sscanf(const char *__restrict text, const char *__restrict format, ...) __attribute__((__format__(__scanf__, 2, 3)));
int vsscanf(const char *__restrict text, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__scanf__, 2, 0)));

#ifdef __cplusplus
}
#endif

#endif
