/* snprintf, sprintf and their va_list forms (C11 7.21.6). */
#include "format.h"

#include <stdio.h>

/* Counts every character, stores those that fit. */
static void store(sink_t *sink, char character)
{
    if (sink->at != sink->end)
        *sink->at++ = character;
    sink->count++;
}

int vsnprintf(char *restrict to, size_t size, const char *restrict format, va_list arguments)
{
    sink_t sink = {store, to, size ? to + (size - 1) : to, 0};
    int count = __format(&sink, format, arguments);
    if (size)
        *sink.at = 0;
    return count;
}

int snprintf(char *restrict to, size_t size, const char *restrict format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int count = vsnprintf(to, size, format, arguments);
    va_end(arguments);
    return count;
}

/* Far more than a buffer can hold here, and small enough that `to + size` does not wrap. */
#define UNBOUNDED(to) ((size_t)((char *)0 - 1 - (to)))

int vsprintf(char *restrict to, const char *restrict format, va_list arguments)
{
    return vsnprintf(to, UNBOUNDED(to), format, arguments);
}

int sprintf(char *restrict to, const char *restrict format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int count = vsnprintf(to, UNBOUNDED(to), format, arguments);
    va_end(arguments);
    return count;
}
