/* SPDX-License-Identifier: MIT */
/* Medium access and reception. A frame on the air has three scans per bit: six ones (the preamble), a zero, its
 * words, a zero.
 *
 * Receiver: light for two scans selects the strongest sensor. The bits begin where the ones end; the decision threshold
 * is half of what the ones took from that sensor. A late start or a flash of the robot's own proximity therefore costs
 * only a few of the ones. Shorter light, such as other robots' proximity, begins no frame; lasting light becomes the
 * background. */
#include "infrared_parts.h"
#include "hal_cpu.h"

enum {
    SCANS_PER_BIT = 3,
    PREAMBLE = 0x3F,
    PREAMBLE_BITS = 7, /* covers a flash of this robot, the filter's delay of faint light and LEAST_ONES */
    PICK_AFTER = 2,    /* scans of light */
    START_AFTER =
        8, /* dark scans: earlier light is the middle of a frame whose preamble was missed */
    LEAST_ONES = 10, /* minimum scans of light of a preamble: a proximity flash has 3 or 4 */
    LEAST_BEHIND_FLASH = 5,
    FLASH_COUNTS = 24, /* scans after an own flash, which may have hidden the first ones of a preamble */
    LONGEST_ONES = 20, /* maximum scans of light in a preamble (18 sent); a longer light is ones inside a frame */
    MOST_ONES = 36,    /* longer light is no frame and becomes the background */
    CLEAR = 12,        /* dark scans before sending: more than usual words have in a row */
    SLOT = 6,          /* scans of a back-off slot: the detection delay of faint light */
    FIRST_SLOTS = 12,
    SLOTS_PER_NEIGHBOUR = 4,
    FLASH = 3,              /* scans of a proximity flash: the receivers settle in 0.5 ms, then they are read */
    AFTERGLOW = 3, /* scans until the receivers have settled: a reading is a scan old, and light at contact, 3700
                    * counts, has fallen to 63 after one scan and to 1 after two (60 us) */
    MOST_BUSY = 1000,       /* scans of light without START_AFTER dark ones in between: longer than any frame */
    PROXIMITY_PERIOD = 205, /* scans: 50 ms */
    FOLLOW_EVERY = 4,       /* scans */
    HOUSEKEEPING = 64,
    MULTIPLIER = 25173,
    INCREMENT = 13849 /* with MULTIPLIER: a period of 2^16 */
};

static enum { LISTEN, ONES, BITS, SEND, FLASHING, SETTLING, RESTING } state;
static uint8 phase;      /* scans until the next step of the state, or scan within a bit */
static uint8 lit, quiet; /* scans with and without light in state LISTEN */
static uint16 busy;      /* scans of light that could not begin a frame */
static uint8 rest;       /* further dark scans before a flash */
static uint16 backoff;   /* further dark scans before sending a frame */
static uint8 sensor;     /* sensor with the strongest signal of the frame */
static uint8 ones;
static bool falling;                /* the last scan was dark: a second one ends the ones */
static uint16 dark, bright, slicer; /* background, lit level and decision threshold, sixteenths of a count */
static uint16 sum;                  /* sum of a bit's scans, the middle one twice */
static uint16 word;
static uint8 word_bits;
static frame_buffer buffer;
static uint16 scans, flashed_at, random_state;

static void count(uint16 *counter)
{
    if (++*counter == 0) {
        --*counter;
    }
}

uint16 link_random(void)
{
    random_state = (uint16)(random_state * MULTIPLIER + INCREMENT);
    return random_state >> 5;
}

static void draw_backoff(void)
{
    uint16 slots = (uint16)(FIRST_SLOTS + SLOTS_PER_NEIGHBOUR * neighbours_count());
    backoff = (uint16)((uint16)(link_random() % slots) * SLOT);
}

/* -- sending ------------------------------------------------------------------------------------------------------- */

static HAL_OUTLINE void begin_sending(void)
{
    queue_pack(&buffer);
    word = PREAMBLE;
    word_bits = PREAMBLE_BITS;
    phase = 1;
    state = SEND;
}

static void rest_for(uint8 how_long)
{
    hal_infrared_light(false);
    phase = how_long;
    state = RESTING;
}

static HAL_OUTLINE void send(void)
{
    if (--phase != 0) {
        return;
    }
    phase = SCANS_PER_BIT;
    if (word_bits == 0) {
        if (!frame_next_word(&buffer, &word)) {
            queue_sent();
            draw_backoff();
            rest_for(SCANS_PER_BIT);
            return;
        }
        word_bits = CODE_BITS;
    }
    hal_infrared_light(word & 1u);
    word >>= 1;
    word_bits--;
}

/* -- receiving ----------------------------------------------------------------------------------------------------- */

static HAL_OUTLINE void listen_again(void)
{
    detector_forget();
    lit = 0;
    quiet = 0;
    busy = 0;
    if (backoff == 0) { /* other robots may answer the same frame */
        draw_backoff();
    }
    state = LISTEN;
}

static void brighter(uint16 reading)
{
    bright = (uint16)(bright - (bright >> 2) + (reading >> 2));
    slicer = (uint16)((dark >> 1) + (bright >> 1));
}

static HAL_OUTLINE void pick_sensor(void)
{
    sensor = detector_strongest();
    dark = detector_background(sensor);
    bright = detector_level(sensor);
    slicer = (uint16)((dark >> 1) + (bright >> 1));
    ones = PICK_AFTER;
    falling = false;
    state = ONES;
}

static HAL_OUTLINE void adapt(scan raw)
{
    count(&infrared_statistics.adaptations);
    detector_adapt(raw);
    listen_again();
}

static HAL_OUTLINE void measure_ones(scan raw)
{
    uint16 reading = (uint16)(raw[sensor] << 4);
    if (reading < slicer) {
        ones = (uint8)(ones + 1u + falling);
        falling = false;
        brighter(reading);
        if (ones > MOST_ONES) {
            adapt(raw);
        }
    } else if (!falling) {
        falling = true;
    } else if (ones > LONGEST_ONES ||
               ones < ((uint16)(scans - flashed_at) < FLASH_COUNTS ? LEAST_BEHIND_FLASH : LEAST_ONES)) {
        count(&infrared_statistics.false_starts);
        listen_again();
    } else {
        frame_begin(&buffer);
        random_state = (uint16)(random_state + scans); /* separates robots with the same random state */
        phase = 2;                                     /* third scan of the zero */
        word_bits = CODE_BITS + 1;
        state = BITS;
    }
}

static HAL_OUTLINE void end_of_word(void)
{
    word_bits = CODE_BITS;
    switch (frame_word(&buffer, word >> 1)) {
    case FRAME_MORE:
        return;
    case FRAME_WHOLE:
        count(&infrared_statistics.received);
        infrared_received(&buffer, sensor, (uint16)(dark - bright) >> 4);
        break;
    case FRAME_DAMAGED:
        count(&infrared_statistics.damaged);
        break;
    }
    rest_for(SCANS_PER_BIT);
}

static HAL_OUTLINE void receive(scan raw)
{
    uint16 reading = (uint16)raw[sensor];
    if (++phase <= SCANS_PER_BIT - 1) {
        sum = (uint16)(phase == 1 ? reading : sum + 2 * reading);
        return;
    }
    phase = 0;
    if (word_bits > CODE_BITS) { /* the zero after the preamble */
        word_bits = CODE_BITS;
        return;
    }
    sum = (uint16)((sum + reading) << 2);
    word >>= 1;
    if (sum < slicer) {
        word |= 1u << CODE_BITS;
        brighter(sum);
    }
    if (--word_bits == 0) {
        end_of_word();
    }
}

/* -- medium access ------------------------------------------------------------------------------------------------- */

static HAL_OUTLINE void flash(void)
{
    flashed_at = scans;
    rest = (uint8)(link_random() & 15u);
    hal_infrared_light(true);
    phase = FLASH;
    state = FLASHING;
}

/* Uses a dark medium: sends a proximity flash or a frame when its back-off is over. */
static HAL_OUTLINE void use_silence(void)
{
    if ((uint16)(scans - flashed_at) >= PROXIMITY_PERIOD) {
        if (rest-- == 0) {
            flash();
        }
    } else if (backoff != 0) {
        backoff--;
    } else if (queue_length != 0 && queue[queue_first].is_filled && infrared_number != 0) {
        begin_sending();
    }
}

static HAL_INLINE void listen(scan raw)
{
    if ((uint8)scans % FOLLOW_EVERY == 0) {
        detector_follow();
    }
    if (detector_filter(raw)) {
        if (lit == 0 && quiet < START_AFTER) {
            if (++busy == MOST_BUSY) {
                adapt(raw);
            }
        } else if (++lit == PICK_AFTER) {
            pick_sensor();
        }
        quiet = 0;
        return;
    }
    lit = 0;
    if (quiet == CLEAR) {
        use_silence();
    } else {
        quiet++;
        if (quiet == START_AFTER) {
            busy = 0;
        }
    }
}

static HAL_OUTLINE void own_light(scan raw)
{
    if (--phase != 0) {
        return;
    }
    if (state == RESTING) {
        listen_again();
    } else if (state == FLASHING) {
        reflections_lit(raw);
        hal_infrared_light(false);
        phase = AFTERGLOW;
        state = SETTLING;
    } else {
        if (detector_is_dark(raw)) {
            reflections_use();
        }
        state = LISTEN;
    }
}

static HAL_OUTLINE void act(scan raw)
{
    if (state == BITS) {
        receive(raw);
    } else if (state == ONES) {
        measure_ones(raw);
    } else if (state == SEND) {
        send();
    } else {
        own_light(raw);
    }
}

static HAL_OUTLINE void keep_house(scan raw)
{
    random_state = (uint16)(random_state * MULTIPLIER + raw[scans / HOUSEKEEPING % HAL_INFRARED_SENSORS]);
    infrared_housekeeping();
}

void infrared_scanned(scan raw)
{
    scans++;
    if (state == LISTEN) {
        listen(raw);
    } else {
        act(raw);
    }
    if ((uint8)scans % HOUSEKEEPING == 0) {
        keep_house(raw);
    }
}

bool link_init(void)
{
    draw_backoff();
    return reflections_init();
}
