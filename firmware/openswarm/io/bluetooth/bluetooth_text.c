/* SPDX-License-Identifier: MIT */
/* Numbers as text (bluetooth_text.h). */
#include "bluetooth_text.h"

enum { LOWEST = -32768 };
#define HIGHEST 65535L

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Reads one number at *at; false: no number, or out of range. */
static bool read_number(const char *text, uint16 size, uint16 *at, sint32 *number)
{
    bool negative = *at < size && text[*at] == '-';
    if (negative) {
        ++*at;
    }
    if (*at >= size || !is_digit(text[*at])) {
        return false;
    }
    *number = 0;
    while (*at < size && is_digit(text[*at])) {
        *number = *number * 10 + (text[*at] - '0');
        if (*number > HIGHEST) {
            return false;
        }
        ++*at;
    }
    if (negative) {
        *number = -*number;
    }
    return *number >= LOWEST;
}

sint16 text_arguments(const char *text, uint16 size, sint32 *arguments)
{
    uint16 at = 0;
    sint16 count = 0;
    if (size != 0 && text[0] == ',') {
        at = 1;
    }
    while (at < size) {
        if (count == TEXT_ARGUMENTS || !read_number(text, size, &at, &arguments[count])) {
            return -1;
        }
        count++;
        if (at < size && (text[at] != ',' || ++at == size)) {
            return -1;
        }
    }
    return count;
}

void text_character(text_line *line, char c)
{
    if (line->size < line->room) {
        line->text[line->size++] = c;
    }
}

void text_number(text_line *line, sint32 number)
{
    uint16 rest = (uint16)(number < 0 ? -number : number);
    uint16 power = 10000;
    if (number < 0) {
        text_character(line, '-');
    }
    while (power > rest && power > 1) {
        power = (uint16)(power / 10);
    }
    for (; power != 0; power = (uint16)(power / 10)) {
        text_character(line, (char)('0' + rest / power));
        rest = (uint16)(rest % power);
    }
}
