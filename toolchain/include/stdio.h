/* Formatted output (C11 7.21.6). Conversions: d i u x X o c s p % with flags - 0 + space #, width, precision, *, and
 * lengths hh h l ll z t j; f F e E g G are there when a program that uses them calls the _float variants.
 * There are no files: stdout and stderr both go to the hook __putchar. */
#ifndef STDIO_H
#define STDIO_H

#include <stdarg.h>
#include <stddef.h>

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
int fputs(const char *restrict text, FILE *restrict stream);
size_t fwrite(const void *restrict from, size_t size, size_t count, FILE *restrict stream);
int fflush(FILE *stream);
int puts(const char *text);
int printf(const char *restrict format, ...) __attribute__((__format__(__printf__, 1, 2)));
int vprintf(const char *restrict format, va_list arguments) __attribute__((__format__(__printf__, 1, 0)));
int fprintf(FILE *restrict stream, const char *restrict format, ...) __attribute__((__format__(__printf__, 2, 3)));
int vfprintf(FILE *restrict stream, const char *restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 2, 0)));
int sprintf(char *restrict to, const char *restrict format, ...) __attribute__((__format__(__printf__, 2, 3)));
int vsprintf(char *restrict to, const char *restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 2, 0)));
int snprintf(char *restrict to, size_t size, const char *restrict format, ...)
    __attribute__((__format__(__printf__, 3, 4)));
int vsnprintf(char *restrict to, size_t size, const char *restrict format, va_list arguments)
    __attribute__((__format__(__printf__, 3, 0)));

#endif
