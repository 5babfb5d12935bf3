/* SPDX-License-Identifier: MIT */
/* strftime in the "C" locale (C11 7.27.3.5); the modifiers E and O have no effect in it. */
#include <string.h>
#include <time.h>

static const char days[] = "Sunday\0Monday\0Tuesday\0Wednesday\0Thursday\0Friday\0Saturday\0";
static const char months[] = "January\0February\0March\0April\0May\0June\0July\0August\0September\0October\0November\0December\0";

typedef struct {
    char *at, *end; /* position of the next character; limit, without the final 0 */
    const struct tm *calendar;
} writer_t;

static void put(writer_t *w, char character)
{
    if (w->at != w->end)
        *w->at++ = character;
    else
        w->end = w->at = NULL; /* too long: discard this and all further characters */
}

static void text(writer_t *w, const char *names, int index, int length)
{
    for (; index > 0; index--)
        names += strlen(names) + 1;
    for (; *names && length; names++, length--)
        put(w, *names);
}

static void number(writer_t *w, long value, int width, char fill)
{
    char digits[12];
    int count = 0;
    if (value < 0) {
        put(w, '-');
        value = -value;
        width--;
    }
    do
        digits[count++] = (char)('0' + value % 10);
    while (value /= 10);
    for (; width > count; width--)
        put(w, fill);
    while (count)
        put(w, digits[--count]);
}

/* Return the week of the ISO 8601 year, whose week 1 contains January 4th; *year becomes that year. */
static int iso_week(const struct tm *calendar, long *year)
{
    int monday_based = (calendar->tm_wday + 6) % 7;
    int week = (calendar->tm_yday - monday_based + 10) / 7; /* counted from 1 */
    *year = 1900L + calendar->tm_year;
    if (week < 1) {
        --*year;
        int before = (monday_based - calendar->tm_yday + 371) % 7; /* weekday of January 1st, Monday 0 */
        int leap = *year % 4 == 0 && (*year % 100 != 0 || *year % 400 == 0);
        return before == 4 || (before == 5 && leap) ? 53 : 52; /* 53 if the previous year began or ended on a Thursday */
    }
    int leap = *year % 4 == 0 && (*year % 100 != 0 || *year % 400 == 0);
    if (week == 53 && calendar->tm_yday - monday_based + 3 >= 365 + leap) { /* the Thursday of this week is in the next year */
        ++*year;
        return 1;
    }
    return week;
}

static void expand(writer_t *w, const char *format);

static void convert(writer_t *w, char conversion)
{
    const struct tm *c = w->calendar;
    long year = 1900L + c->tm_year;
    int hour = c->tm_hour % 12 ? c->tm_hour % 12 : 12;
    switch (conversion) {
    case 'a': text(w, days, c->tm_wday, 3); break;
    case 'A': text(w, days, c->tm_wday, -1); break;
    case 'b':
    case 'h': text(w, months, c->tm_mon, 3); break;
    case 'B': text(w, months, c->tm_mon, -1); break;
    case 'c': expand(w, "%a %b %e %H:%M:%S %Y"); break;
    case 'C': number(w, year / 100, 2, '0'); break;
    case 'd': number(w, c->tm_mday, 2, '0'); break;
    case 'x':
    case 'D': expand(w, "%m/%d/%y"); break;
    case 'e': number(w, c->tm_mday, 2, ' '); break;
    case 'F': expand(w, "%Y-%m-%d"); break;
    case 'g': (void)iso_week(c, &year); number(w, year % 100, 2, '0'); break;
    case 'G': (void)iso_week(c, &year); number(w, year, 1, '0'); break;
    case 'H': number(w, c->tm_hour, 2, '0'); break;
    case 'I': number(w, hour, 2, '0'); break;
    case 'j': number(w, c->tm_yday + 1, 3, '0'); break;
    case 'm': number(w, c->tm_mon + 1, 2, '0'); break;
    case 'M': number(w, c->tm_min, 2, '0'); break;
    case 'n': put(w, '\n'); break;
    case 'p': text(w, "AM\0PM", c->tm_hour >= 12, -1); break;
    case 'r': expand(w, "%I:%M:%S %p"); break;
    case 'R': expand(w, "%H:%M"); break;
    case 'S': number(w, c->tm_sec, 2, '0'); break;
    case 't': put(w, '\t'); break;
    case 'X':
    case 'T': expand(w, "%H:%M:%S"); break;
    case 'u': number(w, c->tm_wday ? c->tm_wday : 7, 1, '0'); break;
    case 'U': number(w, (c->tm_yday + 7 - c->tm_wday) / 7, 2, '0'); break;
    case 'V': number(w, iso_week(c, &year), 2, '0'); break;
    case 'w': number(w, c->tm_wday, 1, '0'); break;
    case 'W': number(w, (c->tm_yday + 7 - (c->tm_wday + 6) % 7) / 7, 2, '0'); break;
    case 'y': number(w, year % 100, 2, '0'); break;
    case 'Y': number(w, year, 1, '0'); break;
    case 'z': text(w, "+0000", 0, -1); break;
    case 'Z': text(w, "UTC", 0, -1); break;
    default: put(w, conversion);
    }
}

static void expand(writer_t *w, const char *format)
{
    for (; *format; format++) {
        if (*format != '%') {
            put(w, *format);
            continue;
        }
        format++;
        if (*format == 'E' || *format == 'O')
            format++;
        if (!*format)
            return;
        convert(w, *format);
    }
}

size_t strftime(char *restrict to, size_t size, const char *restrict format, const struct tm *restrict calendar)
{
    if (!size)
        return 0;
    writer_t w = {to, to + size - 1, calendar};
    expand(&w, format);
    if (!w.at)
        return 0;
    *w.at = 0;
    return (size_t)(w.at - to);
}
