/* SPDX-License-Identifier: MIT */
/* Calendar arithmetic of time.h in the proleptic Gregorian calendar; no time zones. */
#include <time.h>

#define SECONDS_PER_DAY 86400L
#define DAYS_PER_ERA 146097L /* 400 years */
#define DAYS_0000_TO_1970 719468L /* from 0000-03-01: years that begin in March end with the leap day */

static struct tm broken_down;
static char text[26];

/* Weak defaults, which a program with a clock replaces. */
clock_t clock(void)
{
    return -1;
}

time_t time(time_t *result)
{
    if (result)
        *result = -1;
    return -1;
}

double difftime(time_t end, time_t start)
{
    return (double)end - (double)start;
}

/* difftime of programs whose double has 32 bits. */
float __short_difftime(time_t end, time_t start);
float __short_difftime(time_t end, time_t start)
{
    return (float)end - (float)start;
}

/* Return the days from 1970-01-01 to a date; month 0-11, day 1-31. */
static long days_of(long year, int month, long day)
{
    if (month < 2)
        year--; /* years begin in March here */
    long era = (year >= 0 ? year : year - 399) / 400;
    long of_era = year - era * 400;
    int since_march = month < 2 ? month + 10 : month - 2;
    long of_year = (153 * since_march + 2) / 5 + day - 1;
    return era * DAYS_PER_ERA + of_era * 365 + of_era / 4 - of_era / 100 + of_year - DAYS_0000_TO_1970;
}

struct tm *gmtime(const time_t *seconds)
{
    long days = *seconds / SECONDS_PER_DAY, rest = *seconds % SECONDS_PER_DAY;
    if (rest < 0) {
        rest += SECONDS_PER_DAY;
        days--;
    }
    broken_down.tm_sec = (int)(rest % 60);
    broken_down.tm_min = (int)(rest / 60 % 60);
    broken_down.tm_hour = (int)(rest / 3600);
    int weekday = (int)((days + 4) % 7); /* 1970-01-01 was a Thursday */
    broken_down.tm_wday = weekday < 0 ? weekday + 7 : weekday;

    long day = days + DAYS_0000_TO_1970;
    long era = (day >= 0 ? day : day - DAYS_PER_ERA + 1) / DAYS_PER_ERA;
    long of_era = day - era * DAYS_PER_ERA;
    long year = (of_era - of_era / 1460 + of_era / 36524 - of_era / 146096) / 365;
    long of_year = of_era - (365 * year + year / 4 - year / 100);
    int since_march = (int)((5 * of_year + 2) / 153);
    broken_down.tm_mday = (int)(of_year - (153 * since_march + 2) / 5 + 1);
    broken_down.tm_mon = since_march < 10 ? since_march + 2 : since_march - 10;
    year += era * 400 + (broken_down.tm_mon < 2);
    broken_down.tm_year = (int)(year - 1900);
    broken_down.tm_yday = (int)(days - days_of(year, 0, 1));
    broken_down.tm_isdst = 0;
    return &broken_down;
}

struct tm *localtime(const time_t *seconds)
{
    return gmtime(seconds);
}

time_t mktime(struct tm *calendar)
{
    long year = calendar->tm_year + 1900L + calendar->tm_mon / 12;
    int month = calendar->tm_mon % 12;
    if (month < 0) {
        month += 12;
        year--;
    }
    time_t seconds = days_of(year, month, calendar->tm_mday) * SECONDS_PER_DAY + calendar->tm_hour * 3600L +
                     calendar->tm_min * 60L + calendar->tm_sec;
    *calendar = *gmtime(&seconds);
    return seconds;
}

static char *two(char *to, int value, char fill)
{
    to[0] = (char)(value < 10 ? fill : '0' + value / 10);
    to[1] = (char)('0' + value % 10);
    return to + 2;
}

char *asctime(const struct tm *calendar)
{
    static const char days[] = "SunMonTueWedThuFriSat", months[] = "JanFebMarAprMayJunJulAugSepOctNovDec";
    char *to = text;
    for (int k = 0; k < 3; k++)
        *to++ = days[3 * calendar->tm_wday + k];
    *to++ = ' ';
    for (int k = 0; k < 3; k++)
        *to++ = months[3 * calendar->tm_mon + k];
    *to++ = ' ';
    to = two(to, calendar->tm_mday, ' ');
    *to++ = ' ';
    to = two(to, calendar->tm_hour, '0');
    *to++ = ':';
    to = two(to, calendar->tm_min, '0');
    *to++ = ':';
    to = two(to, calendar->tm_sec, '0');
    *to++ = ' ';
    int year = calendar->tm_year + 1900;
    to = two(two(to, year / 100, '0'), year % 100, '0');
    *to++ = '\n';
    *to = 0;
    return text;
}

char *ctime(const time_t *seconds)
{
    return asctime(gmtime(seconds));
}
