/* SPDX-License-Identifier: MIT */
/* C11 7.24, without locales; plus the POSIX functions that firmware uses. */
#ifndef STRING_H
#define STRING_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

void *memcpy(void *__restrict to, const void *__restrict from, size_t count);
void *memmove(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);
int memcmp(const void *left, const void *right, size_t count);
void *memchr(const void *in, int value, size_t count);
char *strcpy(char *__restrict to, const char *__restrict from);
char *strncpy(char *__restrict to, const char *__restrict from, size_t count);
char *strcat(char *__restrict to, const char *__restrict from);
char *strncat(char *__restrict to, const char *__restrict from, size_t count);
int strcmp(const char *left, const char *right);
int strncmp(const char *left, const char *right, size_t count);
char *strchr(const char *in, int value);
char *strrchr(const char *in, int value);
char *strstr(const char *in, const char *what);
char *strpbrk(const char *in, const char *accept);
size_t strspn(const char *in, const char *accept);
size_t strcspn(const char *in, const char *reject);
char *strtok(char *__restrict in, const char *__restrict separators);
size_t strlen(const char *in);
size_t strnlen(const char *in, size_t limit);
char *strerror(int number);
int strcoll(const char *left, const char *right);
size_t strxfrm(char *__restrict to, const char *__restrict from, size_t limit);

#ifdef __cplusplus
}
#endif

#endif
