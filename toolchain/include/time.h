/* SPDX-License-Identifier: MIT */
/* Calendar time (C11 7.27). The chip has no calendar: time() and clock() return -1 (not available) until a program
 * defines functions of these names. Local time is UTC. */
#ifndef TIME_H
#define TIME_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CLOCKS_PER_SEC 1000L

typedef long time_t; /* seconds since 1970-01-01 00:00:00 UTC */
typedef long clock_t;

struct tm {
  int tm_sec, tm_min, tm_hour; /* 0-59, 0-59, 0-23 */
  int tm_mday, tm_mon;         /* 1-31, 0-11 */
  int tm_year;                 /* since 1900 */
  int tm_wday, tm_yday;        /* 0 = Sunday; 0-365 */
  int tm_isdst;
};

clock_t clock(void);
time_t time(time_t *result);
double difftime(time_t end, time_t start);
time_t mktime(struct tm *calendar); /* normalises its fields */
struct tm *gmtime(const time_t *seconds);
struct tm *localtime(const time_t *seconds);
char *asctime(const struct tm *calendar); /* "Sun Nov 22 11:15:27 2026\n" */
char *ctime(const time_t *seconds);
/* Return the length, or 0 if the text does not fit; all conversions of C11 7.27.3.5 in the "C" locale, %Z is "UTC". */
size_t strftime(char *__restrict to, size_t size, const char *__restrict format, const struct tm *__restrict calendar)
    __attribute__((__format__(__strftime__, 3, 0)));

#ifdef __cplusplus
}
#endif

#endif
