/* SPDX-License-Identifier: MIT */
/* Input and output (C11 7.21). Conversions of printf: d i u x X o c s p n % with flags - 0 + space #, width, precision, *, and
 * lengths hh h l ll z t j; f F e E g G are linked if a program uses them.
 * There are no files: stdout and stderr both go to the hook __putchar, stdin is the hook __getchar, and fopen fails. */
#ifndef STDIO_H
#define STDIO_H

#include <stdarg.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define EOF (-1)
#define BUFSIZ 256
#define FILENAME_MAX 16
#define FOPEN_MAX 8
#define L_tmpnam 16
#define TMP_MAX 25
#define _IOFBF 0
#define _IOLBF 1
#define _IONBF 2
#define SEEK_SET 0
#define SEEK_CUR 1
#define SEEK_END 2

typedef struct __stream FILE;
#define stdout ((FILE *)1)
#define stderr ((FILE *)2)
#define stdin ((FILE *)3)
typedef long fpos_t;

/* Hook that receives the output of printf, puts and putchar. The default sends it to UART1, which it enables if necessary;
 * a program that defines this function replaces it. Returns the character. */
int __putchar(int character);

/* Hook that reads a character for getchar, gets and scanf. The default waits for one from UART1, which it enables if
 * necessary (UNVERIFIED: that XC16's library does the same); a program that defines this function replaces it. Returns
 * the character, or EOF, which marks the end of stdin until clearerr. */
int __getchar(void);

int getchar(void);
int fgetc(FILE *stream);
int getc(FILE *stream);
int ungetc(int character, FILE *stream); /* at most one character */
char *gets(char *to);
char *fgets(char *__restrict to, int size, FILE *__restrict stream);
size_t fread(void *__restrict to, size_t size, size_t count, FILE *__restrict stream);
int feof(FILE *stream);
int ferror(FILE *stream);
void clearerr(FILE *stream);
void perror(const char *text);

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

/* There are no files: these functions fail, except fclose and setvbuf with _IONBF. */
int remove(const char *name);
int rename(const char *from, const char *to);
FILE *fopen(const char *__restrict name, const char *__restrict mode);
FILE *freopen(const char *__restrict name, const char *__restrict mode, FILE *__restrict stream);
FILE *tmpfile(void);
char *tmpnam(char *name);
int fclose(FILE *stream);
void setbuf(FILE *__restrict stream, char *__restrict buffer);
int setvbuf(FILE *__restrict stream, char *__restrict buffer, int mode, size_t size);
int fseek(FILE *stream, long offset, int from);
long ftell(FILE *stream);
void rewind(FILE *stream);
int fgetpos(FILE *__restrict stream, fpos_t *__restrict position);
int fsetpos(FILE *stream, const fpos_t *position);

/* Conversions: d i u o x X p c s [ n %, with *, width and hh h l ll j z t L; a e f g too. */
int sscanf(const char *__restrict text, const char *__restrict format, ...) __attribute__((__format__(__scanf__, 2, 3)));
int vsscanf(const char *__restrict text, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__scanf__, 2, 0)));
int scanf(const char *__restrict format, ...) __attribute__((__format__(__scanf__, 1, 2)));
int vscanf(const char *__restrict format, va_list arguments) __attribute__((__format__(__scanf__, 1, 0)));
int fscanf(FILE *__restrict stream, const char *__restrict format, ...) __attribute__((__format__(__scanf__, 2, 3)));
int vfscanf(FILE *__restrict stream, const char *__restrict format, va_list arguments)
    __attribute__((__format__(__scanf__, 2, 0)));

#ifdef __cplusplus
}
#endif

#endif
