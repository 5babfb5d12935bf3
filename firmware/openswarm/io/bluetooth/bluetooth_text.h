/* SPDX-License-Identifier: MIT */
/* Numbers as text, both ways, in a few bytes of stack. Private to this folder. */
#ifndef BLUETOOTH_TEXT_H
#define BLUETOOTH_TEXT_H

#include "openswarm.h"

enum { TEXT_ARGUMENTS = 2 };

/* Reads "number,number..." with or without a comma before the first, up to the end of the text. Returns how many, or -1 for
 * anything else and for more than TEXT_ARGUMENTS. Numbers are decimal, -32768 to 65535. */
sint16 text_arguments(const char *text, uint16 size, sint32 *arguments);

/* A line under construction; what does not fit is left out. */
typedef struct {
    char *text;
    uint16 size, room;
} text_line;

void text_character(text_line *line, char c);
void text_number(text_line *line, sint32 number); /* -32768 to 65535 */

#endif
