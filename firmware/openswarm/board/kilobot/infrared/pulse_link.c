/* SPDX-License-Identifier: MIT */
/* Medium access and pulse coding. A byte is a pulse, a pause, eight bits of which the ones are pulses, and another
 * pulse. A frame begins with a byte 0, whose last pulse reveals other robots that begin as well (as in kilolib); the
 * bytes of frame.c follow.
 *
 * Pulses of a byte may be 34 us apart, less than the kernel's clock interrupt takes. Sender and receiver therefore
 * process a byte within one interrupt. The pause after the first pulse covers delays of the receiver's interrupt. */
#include "infrared_parts.h"
#include "kernel.h"
#include "pulses.h"

enum {
    CYCLES_PER_SLOT = 269, /* as kilolib's bits */
    CYCLES_PER_COUNT = 8,
    PER_COUNT = 61, /* slots, in 1/2048 */
    PER_COUNT_SHIFT = 11,
    HALF_SLOT = 17, /* counts */
    FIRST_SLOT = 3, /* of the first bit: leaves 807 cycles for other interrupts */
    STOP_SLOT = FIRST_SLOT + 8,
    LONGEST = 505, /* counts, maximum from a byte's first pulse to its last: an interrupt may delay it by four slots */
    WINDOW = 370,  /* counts between the two pulses of a byte 0; the second is in STOP_SLOT */
    PAUSE = 100,   /* counts between bytes: time for all other code on this CPU */
    ECHO = 8,    /* counts behind the own light in which a pulse may be its reflection: UNVERIFIED, docs/accuracy.md */
    TICK = 977,  /* counts */
    SILENCE = 2, /* ticks without a pulse: longer than any pause between bytes of a frame */
    CLEAR = 3,   /* ticks without a pulse before an own frame */
    FIRST_SLOTS = 12,
    SLOTS_PER_NEIGHBOUR = 4, /* ticks of back-off */
    SKEW = 511,              /* counts: largest random delay of one tick, which separates the ticks of robots */
    HOUSEKEEPING = 16,       /* ticks */
    NO_BYTE = -1
};

static enum { STARTING, LISTEN, RECEIVE, LEADING, SENDING } state;
static uint8 quiet = SILENCE; /* ticks without a pulse */
static uint8 backoff, due;    /* ticks: silence still required before an own frame; since last housekeeping */
static uint16 skew;
static uint16 seen; /* time of the last processed pulse */
static uint16 lit_at;
static bool collided;
static uint16 strength;
static uint16 random_state;
static frame_buffer buffer;

uint16 link_random(void)
{
    random_state ^= (uint16)(random_state << 7); /* xorshift of full period, never 0 */
    random_state ^= random_state >> 9;
    random_state ^= (uint16)(random_state << 8);
    return random_state;
}

static void stir(uint16 noise)
{
    random_state = (uint16)(random_state + noise);
    if (random_state == 0) {
        random_state = 1;
    }
}

static void draw_backoff(void)
{
    backoff = (uint8)(link_random() % (uint16)(FIRST_SLOTS + SLOTS_PER_NEIGHBOUR * neighbours_count()));
    skew = link_random() & SKEW;
}

/* -- receiving ----------------------------------------------------------------------------------------------------- */

/* Receives the rest of a byte whose first pulse was at `began`. Returns the byte, or NO_BYTE. */
static sint16 read_byte(uint16 began)
{
    uint8 byte = 0;
    for (;;) {
        uint16 at = pulses_seen();
        if (at == seen) {
            if ((uint16)(pulses_now() - began) > LONGEST) {
                return NO_BYTE;
            }
            continue;
        }
        seen = at;
        uint8 slot = (uint8)((uint16)((at - began + HALF_SLOT) * PER_COUNT) >> PER_COUNT_SHIFT);
        if (slot >= STOP_SLOT) {
            return byte;
        }
        if (slot < FIRST_SLOT) {
            return NO_BYTE;
        }
        byte |= (uint8)(1u << (slot - FIRST_SLOT));
    }
}

static void listen_again(void)
{
    pulses_gain(true);
    if (backoff == 0) { /* other robots may answer the same frame */
        draw_backoff();
    }
    state = LISTEN;
}

static void damaged(void)
{
    os_count(&infrared_statistics.damaged);
    listen_again();
}

static void begin_frame(sint16 byte)
{
    if (byte == 0) {
        strength = pulses_strength();
        pulses_gain(false);
        stir(seen);
        frame_begin(&buffer);
        state = RECEIVE;
    } else if (byte > 0) { /* two robots have begun a frame */
        damaged();
    } else {
        os_count(&infrared_statistics.false_starts);
    }
}

static void take_byte(sint16 byte)
{
    frame_state done = byte == NO_BYTE ? FRAME_DAMAGED : frame_byte(&buffer, (uint8)byte);
    if (buffer.bits == 8 && strength >= PULSES_SATURATED) { /* the first byte at low gain */
        strength = (uint16)(PULSES_LOW_GAIN + pulses_strength());
    }
    if (done == FRAME_DAMAGED) {
        damaged();
    } else if (done == FRAME_WHOLE) {
        os_count(&infrared_statistics.received);
        listen_again();
        infrared_received(&buffer, 0, strength);
    }
}

HAL_USED void infrared_pulse_isr(void)
{
    uint16 at = pulses_seen();
    if (at == seen) { /* read_byte() has processed it */
        return;
    }
    /* Ticks alone would miss a frame: its sender, which also counts ticks, may begin less than two after the last pulse. */
    bool was_silent = quiet >= SILENCE || (uint16)(at - seen) > TICK;
    seen = at;
    if (state == LEADING) {
        collided |= (uint16)(at - lit_at) > ECHO;
    } else if (state == RECEIVE) {
        quiet = 0;
        take_byte(read_byte(at));
    } else if (state == LISTEN) {
        quiet = 0;
        if (was_silent) { /* otherwise this pulse is inside a frame */
            begin_frame(read_byte(at));
        }
    }
}

/* -- sending ------------------------------------------------------------------------------------------------------- */

static void light(void)
{
    lit_at = pulses_now();
    pulses_flash();
}

static void begin_sending(void)
{
    collided = false;
    pulses_emitter(true);
    if (pulses_seen() == seen) { /* checked last: only robots that have not begun receive later ones */
        light();
        pulses_alarm(WINDOW);
        state = LEADING;
    } else {
        pulses_emitter(false);
    }
}

static void stop_sending(void)
{
    pulses_emitter(false);
    draw_backoff();
    quiet = 0;
    state = LISTEN;
    pulses_alarm(TICK);
}

static void wait_for(uint8 slot)
{
    uint16 counts = (uint16)(slot * CYCLES_PER_SLOT + CYCLES_PER_COUNT / 2) / CYCLES_PER_COUNT;
    while ((uint16)(pulses_now() - lit_at) < counts) {
    }
}

static void send_byte(uint8 byte)
{
    light();
    for (uint8 slot = FIRST_SLOT; slot < STOP_SLOT; slot++) {
        if (byte & 1u) {
            wait_for(slot);
            pulses_flash();
        }
        byte >>= 1;
    }
    wait_for(STOP_SLOT);
    pulses_flash();
}

static void send_next(void)
{
    uint8 byte;
    if (frame_next_byte(&buffer, &byte)) {
        send_byte(byte);
        pulses_alarm(PAUSE);
    } else {
        queue_sent();
        stop_sending();
    }
}

static void end_window(void)
{
    if (collided) {
        stop_sending();
        return;
    }
    pulses_flash();
    queue_pack(&buffer);
    state = SENDING;
    pulses_alarm(PAUSE);
}

/* -- taking turns -------------------------------------------------------------------------------------------------- */

static void tick(void)
{
    pulses_alarm_again((uint16)(TICK + skew));
    skew = 0;
    if (due < HOUSEKEEPING) {
        due++;
    }
    if (quiet < CLEAR) {
        quiet++;
    }
    if (quiet < SILENCE) {
        return;
    }
    if (state == RECEIVE) { /* its sender has stopped */
        damaged();
    }
    if (due == HOUSEKEEPING) { /* never within a frame, because a pulse could be missed */
        due = 0;
        infrared_housekeeping();
    }
    if (quiet == CLEAR) {
        if (backoff != 0) {
            backoff--;
        } else if (queue_length != 0 && queue[queue_first].is_filled && infrared_number != 0) {
            begin_sending();
        }
    }
}

HAL_USED void infrared_alarm_isr(void)
{
    if (state == LEADING) {
        end_window();
    } else if (state == SENDING) {
        send_next();
    } else {
        if (state == STARTING) {
            pulses_listen();
            state = LISTEN;
        }
        tick();
    }
}

bool link_init(void)
{
    return true;
}

void hal_infrared_start(void)
{
    pulses_prepare(TICK);
    stir(pulses_noise());
    draw_backoff();
}
