/* SPDX-License-Identifier: MIT */
/* C11 7.22: conversions, division, random numbers, sorting, end of program. The linker option
 * -Wl,--heap=BYTES sets the size of the heap; there is no environment, and multibyte characters are single bytes. */
#ifndef STDLIB_H
#define STDLIB_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define EXIT_SUCCESS 0
#define EXIT_FAILURE 1
#define RAND_MAX 32767
#define MB_CUR_MAX 1

typedef struct {
  int quot, rem;
} div_t;
typedef struct {
  long quot, rem;
} ldiv_t;
typedef struct {
  long long quot, rem;
} lldiv_t;

int abs(int value);
long labs(long value);
long long llabs(long long value);
div_t div(int numerator, int denominator);
ldiv_t ldiv(long numerator, long denominator);
lldiv_t lldiv(long long numerator, long long denominator);

int atoi(const char *text);
long atol(const char *text);
long long atoll(const char *text);
double atof(const char *text);
long strtol(const char *__restrict text, char **__restrict end, int base);
unsigned long strtoul(const char *__restrict text, char **__restrict end, int base);
long long strtoll(const char *__restrict text, char **__restrict end, int base);
unsigned long long strtoull(const char *__restrict text, char **__restrict end, int base);
double strtod(const char *__restrict text, char **__restrict end);
float strtof(const char *__restrict text, char **__restrict end);
long double strtold(const char *__restrict text, char **__restrict end);

void *malloc(size_t size);
void *calloc(size_t count, size_t size);
void *aligned_alloc(size_t alignment, size_t size); /* NULL unless the alignment is a power of two */
void *realloc(void *memory, size_t size);
void free(void *memory);

int rand(void);
void srand(unsigned int seed);

void qsort(void *base, size_t count, size_t size, int (*compare)(const void *, const void *));
void *bsearch(const void *key, const void *base, size_t count, size_t size,
              int (*compare)(const void *, const void *));

/* End the program: the status is in __exit_status and W0, and the processor sleeps with interrupts masked. */
_Noreturn void exit(int status);
_Noreturn void _Exit(int status);
_Noreturn void abort(void);
int atexit(void (*handler)(void)); /* at most 32 functions; exit and the end of main call them, the last one first */
char *getenv(const char *name);    /* always NULL */
int system(const char *command);   /* -1; 0 for NULL */

int mblen(const char *text, size_t limit);
int mbtowc(wchar_t *__restrict to, const char *__restrict text, size_t limit);
int wctomb(char *to, wchar_t character);
size_t mbstowcs(wchar_t *__restrict to, const char *__restrict text, size_t limit);
size_t wcstombs(char *__restrict to, const wchar_t *__restrict text, size_t limit);

#ifdef __cplusplus
}
#endif

#endif
