/* SPDX-License-Identifier: MIT */
/* COBS framing with a checksum: a Tx/Rx-processor pair.
 *
 * A frame is COBS(message, CRC high byte, CRC low byte) followed by 0. COBS (Cheshire and Baker, IEEE/ACM
 * Transactions on Networking 1999) removes every zero, so that 0 marks the end and a damaged frame costs only
 * itself. Checksum: CRC-16/CCITT-FALSE, polynomial 0x1021, start 0xFFFF. */
#include "hal_compiler.h"
#include "io.h"

enum { CRC_BYTES = 2, LONGEST_RUN = 254 };

static uint16 crc_of(uint16 crc, uint8 byte)
{
    crc ^= (uint16)(byte << 8);
    for (uint8 bit = 0; bit < 8; bit++) {
        crc = (crc & 0x8000u) ? (uint16)(crc << 1 ^ 0x1021u) : (uint16)(crc << 1);
    }
    return crc;
}

BOUNDS_AT("for (uint16 i", loop d + SYS_UART_RX);
static uint16 checksum(const uint8 *message, uint16 size)
{
    uint16 crc = 0xFFFFu;
    for (uint16 i = 0; i < size; i++) {
        crc = crc_of(crc, message[i]);
    }
    return crc;
}

typedef struct {
    const uint8 *message;
    uint16 size, crc;
} source;

static uint8 byte_at(const source *s, uint16 i)
{
    if (i < s->size) {
        return s->message[i];
    }
    return (uint8)(i == s->size ? s->crc >> 8 : s->crc);
}

BOUNDS_AT("while (more)", loop d + 3);
BOUNDS_AT("while (from + run", loop 254, share Sys_Frame_Tx d + 2);
BOUNDS_AT("for (uint16 i", loop 254, share Sys_Frame_Tx 2 + d);
BOUNDS_AT("!put((uint8)", calls sys_put);
BOUNDS_AT("!put(byte_at", calls sys_put);
BOUNDS_AT("return put(0)", calls sys_put);
bool Sys_Frame_Tx(const uint8 *message, uint16 size, sys_put put)
{
    source s = {message, size, checksum(message, size)};
    uint16 total = (uint16)(size + CRC_BYTES);
    uint16 from = 0;
    bool more = true;
    while (more) { /* one run of non-zero bytes, preceded by its length + 1 */
        uint16 run = 0;
        while (from + run < total && run < LONGEST_RUN && byte_at(&s, (uint16)(from + run)) != 0) {
            run++;
        }
        if (!put((uint8)(run + 1))) {
            return false;
        }
        for (uint16 i = 0; i < run; i++) {
            if (!put(byte_at(&s, (uint16)(from + i)))) {
                return false;
            }
        }
        more = from + run < total; /* ended at a zero, which the next run implies, or at the maximum length */
        from = (uint16)(from + run + (run < LONGEST_RUN ? 1 : 0));
    }
    return put(0);
}

/* Decodes in place; the result is shorter than the input. Returns its size, or 0 for a damaged frame. */
BOUNDS_AT("for (uint16 in", loop SYS_UART_RX);
BOUNDS_AT("for (uint16 i = 0; i < run", loop 254, share Sys_Frame_Rx SYS_UART_RX);
static uint16 decode(uint8 *frame, uint16 size)
{
    uint16 out = 0;
    for (uint16 in = 0; in < size;) {
        uint16 run = (uint16)(frame[in] - 1);
        uint8 code = frame[in++];
        if (run > (uint16)(size - in)) {
            return 0;
        }
        for (uint16 i = 0; i < run; i++) {
            frame[out++] = frame[in++];
        }
        if (code <= LONGEST_RUN && in < size) {
            frame[out++] = 0;
        }
    }
    if (out <= CRC_BYTES || checksum(frame, out) != 0) {
        return 0;
    }
    return (uint16)(out - CRC_BYTES);
}

/* A frame too long for the buffer is collected up to the end and then dropped. */
uint16 Sys_Frame_Rx(uint8 byte, uint8 *buffer, uint16 *used)
{
    uint16 size = *used;
    if (byte != 0) {
        if (size < SYS_UART_RX) {
            buffer[size] = byte;
        }
        if (size <= SYS_UART_RX) {
            *used = (uint16)(size + 1);
        }
        return 0;
    }
    *used = 0;
    return size <= SYS_UART_RX ? decode(buffer, size) : 0;
}
