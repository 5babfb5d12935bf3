/* SPDX-License-Identifier: MIT */
/* Private interface of this folder's files (README.md). ISR context unless stated otherwise. */
#ifndef INFRARED_PARTS_H
#define INFRARED_PARTS_H

#include "hal_infrared.h"
#include "openswarm_infrared.h"

typedef const volatile unsigned int *scan; /* raw readings of the sensors */

/* ---- error_correction.c: Hamming (15,11), distance 3 ---- */
enum { CODE_BITS = 15, DATA_BITS = 11, CODE_MASK = 0x7FFF };
uint16 coder_encode(uint16 data);                 /* 11 bits to 15; any context */
uint16 coder_decode(uint16 word, uint8 *repairs); /* 15 bits to 11; adds 1 to *repairs if one was wrong; any context */
uint16 coder_crc(const uint8 *bytes, uint8 size); /* CRC-16/CCITT-FALSE; any context */

/* ---- frame.c: bytes to words on the air and back ---- */
enum {
    FRAME_HEADER = 2,
    FRAME_CRC = 2,
    FRAME_PAYLOAD = 15, /* four bits in the header */
    FRAME_BYTES = FRAME_HEADER + FRAME_PAYLOAD + FRAME_CRC,
    NUMBER_MASK = 0x07FF
};
typedef enum { FRAME_MESSAGE, FRAME_EVENT } frame_kind;

typedef struct {
    uint16 number; /* of the sending robot */
    uint8 kind, size;
    const uint8 *payload;
} frame;

typedef struct {
    uint8 bytes[FRAME_BYTES + 1]; /* one more: the last word may extend beyond the last byte */
    uint8 bits;                   /* bits sent or received so far */
    uint8 repairs;
} frame_buffer;

void frame_pack(frame_buffer *b, const frame *f);
bool frame_next_word(frame_buffer *b, uint16 *word); /* next word to send; false: the frame is complete */
bool frame_next_byte(frame_buffer *b, uint8 *byte);  /* the same for links that carry bytes */
typedef enum { FRAME_MORE, FRAME_WHOLE, FRAME_DAMAGED } frame_state;
void frame_begin(frame_buffer *b);
frame_state frame_word(frame_buffer *b, uint16 word); /* adds a received word */
frame_state frame_byte(frame_buffer *b, uint8 byte);  /* the same for links that carry bytes */
void frame_unpack(const frame_buffer *b, frame *f);   /* decodes a whole frame; payload points into b */

/* ---- detector.c: light detection per sensor. Levels are sixteenths of a count ---- */
bool detector_filter(scan raw);        /* filters one scan; whether light takes any sensor below its threshold */
void detector_follow(void);            /* updates background and noise of one sensor; not in every scan */
uint8 detector_strongest(void);
void detector_forget(void);            /* after a frame: resets the levels to the background */
void detector_adapt(scan raw);         /* takes the present light as the background */
bool detector_is_dark(scan raw);       /* whether no sensor is lit by more than its threshold */
uint16 detector_background(uint8 sensor);
uint16 detector_level(uint8 sensor);   /* mean of about four scans */

/* ---- queue.c: frames waiting to be sent ---- */
typedef struct {
    bool is_filled; /* false while an interrupted sender still fills it */
    uint8 kind, size;
    uint8 payload[FRAME_PAYLOAD];
} waiting_frame;

bool queue_frame(frame_kind kind, const uint8 *payload, uint8 size); /* any context */
extern waiting_frame queue[SYS_INFRARED_QUEUE]; /* the link reads is_filled of the first frame */
extern volatile uint8 queue_first, queue_length;
void queue_pack(frame_buffer *b);      /* takes the first frame */
void queue_sent(void);                 /* the last bit of a frame is sent */
bool queue_has_sent(void);             /* whether a frame was sent since the last call */
extern sys_infrared_statistics infrared_statistics;

/* ---- link.c, or the board's own link: medium access ---- */
bool link_init(void);                  /* false: no memory */
uint16 link_random(void);

/* ---- infrared.c ---- */
extern uint16 infrared_number;
void infrared_received(const frame_buffer *b, uint8 sensor, uint16 strength);
void infrared_leaving(uint8 *payload, uint8 size); /* ISR: the program may change a message before it is sent */
void infrared_housekeeping(void);      /* 64 times per second */
typedef void (*frame_sink)(const frame *f);
extern frame_sink infrared_event_sink; /* takes frames of kind FRAME_EVENT; NULL unless remote_events.c is used */

/* ---- neighbours.c ---- */
void neighbours_heard(uint16 number, uint8 sensor, uint16 strength);
void neighbours_age(void);             /* expires one entry of the table, in turn */
uint8 neighbours_count(void);

/* ---- reflections.c: proximity between frames ---- */
bool reflections_init(void);           /* false: no memory */
void reflections_lit(scan raw);        /* handles a reading for which the own emitters were on for two scans */
void reflections_use(void);            /* no other robot sent light meanwhile: reports the reflections */

#endif
