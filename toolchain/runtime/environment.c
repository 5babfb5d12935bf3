/* SPDX-License-Identifier: MIT */
/* Functions of the hosted library for a system without files, environment and external signals, and with one locale
 * (C11 7.11, 7.14, 7.21, 7.22.4). */
#include <limits.h>
#include <locale.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

char *getenv(const char *name)
{
    (void)name;
    return NULL;
}

int system(const char *command)
{
    return command ? -1 : 0; /* 0: there is no command processor */
}

char *setlocale(int category, const char *name)
{
    if (category < LC_ALL || category > LC_TIME)
        return NULL;
    return name == NULL || *name == 0 || strcmp(name, "C") == 0 ? "C" : NULL;
}

struct lconv *localeconv(void)
{
    static const struct lconv c_locale = {
        ".",      "",       "",       "",       "",       "",       "",       "",       "",       "",
        CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX,
        CHAR_MAX, CHAR_MAX, CHAR_MAX, CHAR_MAX};
    return (struct lconv *)&c_locale; /* the program must not write to it (C11 7.11.2.1p8) */
}

static void (*handlers[SIGTERM + 1])(int);

static int is_signal(int number)
{
    return number == SIGINT || number == SIGILL || number == SIGABRT || number == SIGFPE || number == SIGSEGV ||
           number == SIGTERM;
}

void (*signal(int number, void (*handler)(int)))(int)
{
    if (!is_signal(number))
        return SIG_ERR;
    void (*before)(int) = handlers[number];
    handlers[number] = handler;
    return before;
}

int raise(int number)
{
    if (!is_signal(number))
        return -1;
    void (*handler)(int) = handlers[number];
    if (handler == SIG_IGN)
        return 0;
    if (handler == SIG_DFL)
        _Exit(128 + number); /* the status that a shell reports for a signal */
    handlers[number] = SIG_DFL;
    handler(number);
    return 0;
}

FILE *fopen(const char *restrict name, const char *restrict mode)
{
    (void)name;
    (void)mode;
    return NULL;
}

FILE *freopen(const char *restrict name, const char *restrict mode, FILE *restrict stream)
{
    (void)name;
    (void)mode;
    (void)stream;
    return NULL;
}

FILE *tmpfile(void)
{
    return NULL;
}

char *tmpnam(char *name)
{
    (void)name;
    return NULL;
}

int fclose(FILE *stream)
{
    (void)stream;
    return 0;
}

void setbuf(FILE *restrict stream, char *restrict buffer)
{
    (void)stream;
    (void)buffer;
}

int setvbuf(FILE *restrict stream, char *restrict buffer, int mode, size_t size)
{
    (void)stream;
    (void)buffer;
    (void)size;
    return mode == _IONBF ? 0 : -1; /* only the unbuffered mode exists */
}

int fseek(FILE *stream, long offset, int from)
{
    (void)stream;
    (void)offset;
    (void)from;
    return -1;
}

long ftell(FILE *stream)
{
    (void)stream;
    return -1;
}

int fgetpos(FILE *restrict stream, fpos_t *restrict position)
{
    (void)stream;
    (void)position;
    return -1;
}

int fsetpos(FILE *stream, const fpos_t *position)
{
    (void)stream;
    (void)position;
    return -1;
}

int ferror(FILE *stream)
{
    (void)stream;
    return 0;
}
