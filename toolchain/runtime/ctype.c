/* SPDX-License-Identifier: MIT */
/* Character classes of the "C" locale (C11 7.4), ASCII. */
#include <ctype.h>

int isdigit(int character)
{
    return (unsigned)character - '0' < 10;
}

int islower(int character)
{
    return (unsigned)character - 'a' < 26;
}

int isupper(int character)
{
    return (unsigned)character - 'A' < 26;
}

int isalpha(int character)
{
    return ((unsigned)character | 0x20) - 'a' < 26;
}

int isalnum(int character)
{
    return isalpha(character) || isdigit(character);
}

int isxdigit(int character)
{
    return isdigit(character) || ((unsigned)character | 0x20) - 'a' < 6;
}

int isblank(int character)
{
    return character == ' ' || character == '\t';
}

int isspace(int character)
{
    return character == ' ' || (unsigned)character - '\t' < 5;
}

int isprint(int character)
{
    return (unsigned)character - ' ' < 95;
}

int isgraph(int character)
{
    return (unsigned)character - '!' < 94;
}

int ispunct(int character)
{
    return isgraph(character) && !isalnum(character);
}

int iscntrl(int character)
{
    return (unsigned)character < ' ' || character == 127;
}

int tolower(int character)
{
    return isupper(character) ? character + ('a' - 'A') : character;
}

int toupper(int character)
{
    return islower(character) ? character - ('a' - 'A') : character;
}
