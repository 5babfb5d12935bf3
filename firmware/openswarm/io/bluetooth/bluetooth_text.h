/* SPDX-License-Identifier: MIT */
/* Conversion of numbers from and to text with little stack. Private to this folder. */
#ifndef BLUETOOTH_TEXT_H
#define BLUETOOTH_TEXT_H

#include "openswarm.h"

enum { TEXT_ARGUMENTS = 2 };

/* Parses "number,number..." with or without a leading comma, up to the end of the text. Returns the count, or -1 for
 * any other text and for more than TEXT_ARGUMENTS numbers. Numbers are decimal, -32768 to 65535. */
sint16 text_arguments(const char *text, uint16 size, sint32 *arguments);

/* A line under construction; characters that do not fit are omitted. */
typedef struct {
    char *text;
    uint16 size, room;
} text_line;

void text_character(text_line *line, char c);
void text_number(text_line *line, sint32 number); /* -32768 to 65535 */

#endif
