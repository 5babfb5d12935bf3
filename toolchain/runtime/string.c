/* SPDX-License-Identifier: MIT */
/* String functions in C (C11 7.24); string.s and memory.s contain the ones in assembly. */
#include <string.h>

void *memchr(const void *in, int value, size_t count)
{
    const unsigned char *at = in;
    for (; count; count--, at++)
        if (*at == (unsigned char)value)
            return (void *)at;
    return NULL;
}

char *strncpy(char *restrict to, const char *restrict from, size_t count)
{
    char *at = to;
    for (; count && *from; count--)
        *at++ = *from++;
    for (; count; count--)
        *at++ = 0;
    return to;
}

char *strcat(char *restrict to, const char *restrict from)
{
    strcpy(to + strlen(to), from);
    return to;
}

char *strncat(char *restrict to, const char *restrict from, size_t count)
{
    char *at = to + strlen(to);
    for (; count && *from; count--)
        *at++ = *from++;
    *at = 0;
    return to;
}

char *strchr(const char *in, int value)
{
    for (;; in++) {
        if (*in == (char)value)
            return (char *)in;
        if (!*in)
            return NULL;
    }
}

char *strrchr(const char *in, int value)
{
    const char *found = NULL;
    do {
        if (*in == (char)value)
            found = in;
    } while (*in++);
    return (char *)found;
}

char *strstr(const char *in, const char *what)
{
    size_t length = strlen(what);
    for (; strncmp(in, what, length) != 0; in++)
        if (!*in)
            return NULL;
    return (char *)in;
}

/* Return the length of the longest prefix whose characters are (wanted 1) or are not (wanted 0) in `set`. */
static size_t span(const char *in, const char *set, int wanted)
{
    size_t length = 0;
    while (in[length] && (strchr(set, in[length]) != NULL) == wanted)
        length++;
    return length;
}

size_t strspn(const char *in, const char *accept)
{
    return span(in, accept, 1);
}

size_t strcspn(const char *in, const char *reject)
{
    return span(in, reject, 0);
}

char *strpbrk(const char *in, const char *accept)
{
    in += strcspn(in, accept);
    return *in ? (char *)in : NULL;
}

char *strtok(char *restrict in, const char *restrict separators)
{
    static char *rest;
    char *token = in ? in : rest;
    if (!token)
        return NULL;
    token += strspn(token, separators);
    if (!*token) {
        rest = NULL;
        return NULL;
    }
    rest = token + strcspn(token, separators);
    if (*rest)
        *rest++ = 0;
    else
        rest = NULL;
    return token;
}

size_t strnlen(const char *in, size_t limit)
{
    size_t length = 0;
    while (length < limit && in[length])
        length++;
    return length;
}

char *strerror(int number)
{
    (void)number;
    return (char *)"error";
}

int strcoll(const char *left, const char *right)
{
    return strcmp(left, right);
}

size_t strxfrm(char *restrict to, const char *restrict from, size_t limit)
{
    size_t length = strlen(from);
    if (length < limit)
        strcpy(to, from);
    return length;
}
