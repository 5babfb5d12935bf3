/* SPDX-License-Identifier: MIT */
/* Private to this folder: what a frame is made of, and who does what with it (README.md). All in ISR context unless said. */
#ifndef INFRARED_PARTS_H
#define INFRARED_PARTS_H

#include "hal_infrared.h"
#include "openswarm_infrared.h"

typedef const volatile unsigned int *scan; /* raw readings of the sensors */

/* ---- coder.c: Hamming (15,11), distance 3 ---- */
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
    uint16 number; /* of the sender */
    uint8 kind, size;
    const uint8 *payload;
} frame;

typedef struct {
    uint8 bytes[FRAME_BYTES + 1]; /* one more: the last word may reach behind the last byte */
    uint8 bits;                   /* done of them */
    uint8 repairs;
} frame_buffer;

void frame_pack(frame_buffer *b, const frame *f);
bool frame_next_word(frame_buffer *b, uint16 *word); /* to be sent; false: that was all */
bool frame_next_byte(frame_buffer *b, uint8 *byte);  /* or so */
typedef enum { FRAME_MORE, FRAME_WHOLE, FRAME_DAMAGED } frame_state;
void frame_begin(frame_buffer *b);
frame_state frame_word(frame_buffer *b, uint16 word); /* as received */
frame_state frame_byte(frame_buffer *b, uint8 byte);  /* or so */
void frame_unpack(const frame_buffer *b, frame *f);   /* of a whole one; payload points into b */

/* ---- detector.c: light that comes and goes, sensor by sensor. Levels are sixteenths of a count ---- */
bool detector_filter(scan raw);        /* one scan; whether any sensor is darkened below its threshold */
void detector_follow(void);            /* one sensor's background and noise; not in every scan */
uint8 detector_strongest(void);
void detector_forget(void);            /* the light of a frame is gone: levels are the background again */
void detector_adapt(scan raw);         /* what is there now is the background */
bool detector_is_dark(scan raw);       /* no sensor is lit by more than its threshold */
uint16 detector_background(uint8 sensor);
uint16 detector_level(uint8 sensor);   /* mean of about four scans */

/* ---- queue.c: frames that wait for their turn ---- */
typedef struct {
    bool is_filled; /* its sender may have been interrupted */
    uint8 kind, size;
    uint8 payload[FRAME_PAYLOAD];
} waiting_frame;

bool queue_frame(frame_kind kind, const uint8 *payload, uint8 size); /* any context */
extern waiting_frame queue[SYS_INFRARED_QUEUE]; /* the link's, to see whether the first is filled; and how many there are */
extern volatile uint8 queue_first, queue_length;
void queue_pack(frame_buffer *b);      /* takes the first out */
void queue_sent(void);                 /* the last light of a frame is out */
bool queue_has_sent(void);             /* since the last call */
extern sys_infrared_statistics infrared_statistics;

/* ---- link.c, or the board's own: who may light up when ---- */
bool link_init(void);                  /* false: no memory */
uint16 link_random(void);

/* ---- infrared.c ---- */
extern uint16 infrared_number;
void infrared_received(const frame_buffer *b, uint8 sensor, uint16 strength);
void infrared_leaving(uint8 *payload, uint8 size); /* a message, before its first light */
void infrared_housekeeping(void);      /* 64 times a second */
/* Takes frames of kind FRAME_EVENT; NULL unless remote_events.c is used. */
extern void (*infrared_event_sink)(const frame *f);

/* ---- neighbours.c ---- */
void neighbours_heard(uint16 number, uint8 sensor, uint16 strength);
void neighbours_age(void);             /* one of the table */
uint8 neighbours_count(void);

/* ---- reflections.c: proximity between frames ---- */
bool reflections_init(void);           /* false: no memory */
void reflections_lit(scan raw);        /* the own emitters have been on for two scans */
void reflections_use(void);            /* nobody else lit anything meanwhile */

#endif
