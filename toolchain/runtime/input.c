/* SPDX-License-Identifier: MIT */
/* Input from stdin, which reads through __getchar (stdio.h), and its end-of-file state. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

static int pushed; /* the character that ungetc pushed back, plus 1 */
static unsigned char ended;

int getchar(void)
{
    int character = pushed - 1;
    pushed = 0;
    if (character < 0 && !ended) {
        character = __getchar();
        ended = character < 0;
    }
    return character < 0 ? EOF : character;
}

int fgetc(FILE *stream)
{
    (void)stream;
    return getchar();
}

int getc(FILE *stream)
{
    (void)stream;
    return getchar();
}

int ungetc(int character, FILE *stream)
{
    (void)stream;
    if (character == EOF || pushed)
        return EOF;
    pushed = (unsigned char)character + 1;
    return (unsigned char)character;
}

int feof(FILE *stream)
{
    (void)stream;
    return ended && !pushed;
}

void clearerr(FILE *stream)
{
    (void)stream;
    ended = 0;
}

void rewind(FILE *stream)
{
    clearerr(stream);
}

char *fgets(char *restrict to, int size, FILE *restrict stream)
{
    (void)stream;
    char *at = to;
    while (--size > 0) {
        int character = getchar();
        if (character == EOF)
            break;
        *at++ = (char)character;
        if (character == '\n')
            break;
    }
    *at = 0;
    return at == to ? NULL : to;
}

char *gets(char *to)
{
    char *at = to;
    int character;
    while ((character = getchar()) != EOF && character != '\n')
        *at++ = (char)character;
    *at = 0;
    return at == to && character == EOF ? NULL : to;
}

size_t fread(void *restrict to, size_t size, size_t count, FILE *restrict stream)
{
    (void)stream;
    unsigned char *at = to;
    size_t left = size * count;
    for (int character; left && (character = getchar()) != EOF; left--)
        *at++ = (unsigned char)character;
    return size ? count - (left + size - 1) / size : 0;
}

void perror(const char *text)
{
    if (text && *text) {
        fputs(text, stderr);
        fputs(": ", stderr);
    }
    puts(strerror(errno));
}
