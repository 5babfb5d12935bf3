/* SPDX-License-Identifier: MIT */
/* A frame is a header (number of the sender 11 bits, kind 1, size 4), the payload and a CRC of both, low bytes first.
 * On the air it is a series of 15-bit code words for 11 bits each, or of plain bytes, depending on the link. */
#include "infrared_parts.h"

#include <string.h>

/* XORed with each word, so that runs of zeros and ones alternate. The mask is no code word: a word without any light
 * needs at least one repair, and means that the sender has disappeared. */
enum { WHITENING = 0x5555 };

static uint8 total_bits(const frame_buffer *b)
{
    return (uint8)(8u * (FRAME_HEADER + (b->bytes[1] >> 4) + FRAME_CRC));
}

void frame_pack(frame_buffer *b, const frame *f)
{
    uint8 covered = (uint8)(FRAME_HEADER + f->size);
    memset(b, 0, sizeof *b);
    b->bytes[0] = (uint8)f->number;
    b->bytes[1] = (uint8)((f->number >> 8 & 7u) | (uint8)(f->kind << 3) | (uint8)(f->size << 4));
    memcpy(b->bytes + FRAME_HEADER, f->payload, f->size);
    uint16 crc = coder_crc(b->bytes, covered);
    b->bytes[covered] = (uint8)crc;
    b->bytes[covered + 1u] = (uint8)(crc >> 8);
}

bool frame_next_word(frame_buffer *b, uint16 *word)
{
    if (b->bits >= total_bits(b)) {
        return false;
    }
    const uint8 *from = b->bytes + (b->bits >> 3);
    uint32 bits = (uint32)from[0] | (uint32)from[1] << 8 | (uint32)from[2] << 16;
    *word = coder_encode((uint16)(bits >> (b->bits & 7u))) ^ WHITENING;
    b->bits = (uint8)(b->bits + DATA_BITS);
    return true;
}

void frame_begin(frame_buffer *b)
{
    memset(b, 0, sizeof *b);
}

/* Returns the state of a frame after another part has arrived. */
static frame_state judge(const frame_buffer *b)
{
    if (b->bits < 8 * FRAME_HEADER || b->bits < total_bits(b)) {
        return FRAME_MORE;
    }
    uint8 covered = (uint8)(FRAME_HEADER + (b->bytes[1] >> 4));
    uint16 crc = (uint16)(b->bytes[covered] | (uint16)b->bytes[covered + 1u] << 8);
    return crc == coder_crc(b->bytes, covered) ? FRAME_WHOLE : FRAME_DAMAGED;
}

frame_state frame_word(frame_buffer *b, uint16 word)
{
    if (word == 0) {
        return FRAME_DAMAGED;
    }
    uint32 bits = (uint32)coder_decode(word ^ WHITENING, &b->repairs) << (b->bits & 7u);
    uint8 *to = b->bytes + (b->bits >> 3);
    to[0] |= (uint8)bits;
    to[1] = (uint8)(bits >> 8);
    to[2] = (uint8)(bits >> 16);
    b->bits = (uint8)(b->bits + DATA_BITS);
    return judge(b);
}

bool frame_next_byte(frame_buffer *b, uint8 *byte)
{
    if (b->bits >= total_bits(b)) {
        return false;
    }
    *byte = b->bytes[b->bits >> 3];
    b->bits = (uint8)(b->bits + 8u);
    return true;
}

frame_state frame_byte(frame_buffer *b, uint8 byte)
{
    b->bytes[b->bits >> 3] = byte;
    b->bits = (uint8)(b->bits + 8u);
    return judge(b);
}

void frame_unpack(const frame_buffer *b, frame *f)
{
    f->number = (uint16)(b->bytes[0] | (uint16)(b->bytes[1] & 7u) << 8);
    f->kind = b->bytes[1] >> 3 & 1u;
    f->size = b->bytes[1] >> 4;
    f->payload = b->bytes + FRAME_HEADER;
}
