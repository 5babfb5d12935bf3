/* SPDX-License-Identifier: MIT */
/* %f, %e, %g, %a of scanf. */
#include "scan.h"
#include "stack_room.h"

#include <stdlib.h>
#include <string.h>

const char *__scan_double(const char *at, const char *stop, double *value)
{
    unsigned length = (unsigned)(stop - at);
    STACK_ROOM(length + 1);
    char text[length + 1]; /* strtod takes no width */
    memcpy(text, at, length);
    text[length] = 0;
    char *end;
    *value = strtod(text, &end);
    return end == text ? NULL : at + (end - text);
}
