/* Run-time functions that csmith's programs need on a microcontroller: a checksum without a table, and its output.
 * It replaces csmith's own csmith.h; its safe_math.h is used as installed. */
#ifndef RANDOM_RUNTIME_H
#define RANDOM_RUNTIME_H

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#define STATIC __attribute__((__unused__)) static
#define UNDEFINED(value) (value)
#define LOG_INDEX
#define LOG_EXEC
#define FUNC_NAME(name) safe_##name
#define _CSMITH_BITFIELD(width) ((width) > 16 ? (width) % 16 : (width))
#include "safe_math.h"

#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
static void csmith_put(char c)
{
    while (!(UCSR0A & (1 << UDRE0))) {
    }
    UDR0 = (uint8_t)c;
}
static void csmith_begin(void) { UCSR0B = 1 << TXEN0; }
/* simavr ends a run when the CPU sleeps and no interrupt can wake it. */
static void csmith_end(void)
{
    csmith_put('\n');
    cli();
    sleep_mode();
}
#else
int __putchar(int character);
static void csmith_put(char c) { __putchar(c); }
static void csmith_begin(void) {}
static void csmith_end(void) { csmith_put('\n'); }
#endif

#define printf(...) ((void)0) /* prints intermediate checksums; off by default */

static uint32_t crc32_context = 0xFFFFFFFFUL;

static void crc32_gentab(void) {}

__attribute__((__noinline__)) static void crc32_byte(uint8_t b)
{
    crc32_context ^= b;
    for (uint8_t bit = 0; bit < 8; bit++)
        crc32_context = crc32_context & 1 ? crc32_context >> 1 ^ 0xEDB88320UL : crc32_context >> 1;
}

__attribute__((__noinline__)) static void transparent_crc(uint64_t value, char *name, int flag)
{
    (void)name;
    (void)flag;
    for (uint8_t byte = 0; byte < 8; byte++, value >>= 8)
        crc32_byte((uint8_t)value);
}

__attribute__((__unused__)) static void transparent_crc_bytes(char *at, int count, char *name, int flag)
{
    (void)name;
    (void)flag;
    while (count--)
        crc32_byte((uint8_t)*at++);
}

static void platform_main_begin(void) { csmith_begin(); }

static void platform_main_end(uint32_t crc, int flag)
{
    (void)flag;
    for (int8_t shift = 28; shift >= 0; shift = (int8_t)(shift - 4))
        csmith_put("0123456789ABCDEF"[crc >> shift & 15]);
    csmith_end();
}

#endif
