/* Random test of the infra-red link. The robot receives whole, damaged, truncated and overlapping frames, ambient light
 * and noise, while its program makes all calls of openswarm_infrared.h and openswarm_remote.h.
 * tests/fuzz/kernel/fuzz_infrared.py supplies the seeds. */
#include "infrared_air.h"

#include "openswarm_remote.h"

enum { SHARED = 0x150, ALONE, STEPS = 600, MOST_WORDS = 14, SAID = 64 };

static uint32 state;
static uint32 below(uint32 limit)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % limit;
}

static bool one_in(uint32 n)
{
    return below(n) == 0;
}

/* ---- The medium ------------------------------------------------------------------------------------------ */

static uint16 room[HAL_INFRARED_SENSORS], noise;

static void scan_noisily(uint8 at, uint16 depth, uint8 also_at, uint16 also)
{
    static unsigned part;
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        long reading = room[i] + (long)below(2u * noise + 1u) - noise;
        reading -= (i == at ? depth : 0) + (i == also_at ? also : 0);
        readings[i] = (unsigned)(reading < 0 ? 0 : reading > 4095 ? 4095 : reading);
    }
    host_device(scan_isr);
    for (part += 125; part >= 512; part -= 512) {
        host_tick();
    }
}

static void dark(unsigned scans)
{
    while (scans-- != 0) {
        scan_noisily(0, 0, 0, 0);
    }
}

/* ---- Frames of other robots ------------------------------------------------------------------------------ */

typedef struct {
    uint8 kind, size;
    uint16 number;
    uint8 payload[FRAME_PAYLOAD];
} text;

static text said[SAID]; /* the last ones */
static unsigned talk;
/* Steps in which the receiver may still hold parts of a frame with more errors than are corrected, or of a jump of the
 * ambient light: its CRC may match by chance. */
enum { DAMAGED_STEPS = 4 };
static unsigned damaged;

static text *anything(void)
{
    static const uint16 numbers[] = {0, 1, 2, 9, 9, 9, 100, 2047};
    text *t = &said[talk++ % SAID];
    t->kind = (uint8)below(2);
    t->size = (uint8)(t->kind == FRAME_MESSAGE || one_in(5) ? below(FRAME_PAYLOAD + 1) : 4 + below(9));
    t->number = one_in(2) ? (uint16)(1 + below(2047)) : numbers[below(8)];
    for (uint8 i = 0; i < FRAME_PAYLOAD; i++) {
        t->payload[i] = (uint8)(one_in(3) ? 0 : below(256));
    }
    if (t->kind == FRAME_EVENT && !one_in(4)) { /* an event that this robot shares, from one of few robots */
        uint16 first = (uint16)((one_in(3) ? ALONE : SHARED) | below(8) << 13);
        uint16 origin = (uint16)(numbers[below(8)] | below(32) << 11);
        t->payload[0] = (uint8)first, t->payload[1] = (uint8)(first >> 8);
        t->payload[2] = (uint8)origin, t->payload[3] = (uint8)(origin >> 8);
    }
    return t;
}

static unsigned draw(bool *lit, const text *t, bool is_clear)
{
    frame_buffer b;
    frame f = {t->number, t->kind, t->size, t->payload};
    uint16 word = 0x3F;
    unsigned length = 0, bits = is_clear ? 7 : 4 + below(10), errors = is_clear ? 0 : below(4);
    frame_pack(&b, &f);
    do {
        uint16 flips = 0;
        for (unsigned i = 0; i < (bits == CODE_BITS ? errors : 0); i++) {
            flips |= (uint16)(one_in(3) ? 1u << below(CODE_BITS) : 0);
        }
        if ((flips & (flips - 1u)) != 0) {
            damaged = DAMAGED_STEPS;
        }
        for (unsigned i = 0; i < bits; i++) {
            for (unsigned k = 0; k < 3; k++) {
                lit[length++] = ((word ^ flips) >> i & 1u) != 0;
            }
        }
        bits = CODE_BITS;
    } while (frame_next_word(&b, &word));
    return length;
}

static void talk_at_random(void)
{
    bool one[LONGEST] = {false}, other[LONGEST] = {false};
    uint8 at = (uint8)below(8), also_at = (uint8)below(8);
    uint16 depth = (uint16)(5 + below(one_in(2) ? 60 : 3500)), also = 0;
    unsigned length = draw(one, anything(), one_in(2));
    unsigned from = one_in(6) ? below(length) : 0, to = one_in(6) ? from + below(length - from) : length;
    if (one_in(6)) {
        unsigned delay = below(40);
        bool late[LONGEST];
        unsigned more = draw(late, anything(), true);
        memcpy(other + delay, late, more * sizeof *late);
        length = to = length > more + delay ? length : more + delay;
        also = (uint16)(5 + below(1000));
        damaged = DAMAGED_STEPS;
    }
    if (from != 0 || to != length || depth <= 2u * noise) {
        damaged = DAMAGED_STEPS;
    }
    for (unsigned i = from; i < to; i++) {
        scan_noisily(at, one[i] ? depth : 0, also_at, other[i] ? also : 0);
    }
    dark(below(60));
}

/* ---- Received messages and events ------------------------------------------------------------------------ */

static bool was_said(uint16 number, uint8 kind, const uint8 *payload, uint8 size)
{
    for (const text *t = said; t != said + SAID; t++) {
        if (t->number == number && t->kind == kind && t->size == size && memcmp(t->payload, payload, size) == 0) {
            return true;
        }
    }
    return false;
}

static bool on_message(uint16 pid, uint16 id, sys_event_data *data)
{
    const sys_neighbour_message *m = data->payload;
    (void)pid, (void)id;
    CHECK(data->size == sizeof *m && data->value == m->source);
    CHECK(m->source >= 1 && m->source <= 2047);
    CHECK(m->sensor < HAL_INFRARED_SENSORS && m->strength <= 4095 && m->size >= 1 && m->size <= SYS_MESSAGE_BYTES);
    CHECK(damaged != 0 || was_said(m->source, FRAME_MESSAGE, m->payload, m->size));
    if (one_in(10)) {
        (void)Sys_Send_Neighbours(m->payload, m->size);
    }
    return true;
}

static uint16 present[2048 / 16]; /* bit per robot: reported SEEN and not yet LOST */
static bool on_neighbour(uint16 pid, uint16 id, sys_event_data *data)
{
    const sys_neighbour *n = data->payload;
    uint16 bit = (uint16)(1u << n->source % 16);
    (void)pid;
    CHECK(data->size == sizeof *n && n->source >= 1 && n->source <= 2047 && n->sensor < HAL_INFRARED_SENSORS);
    CHECK(((present[n->source / 16] & bit) == 0) == (id == SYS_NEIGHBOUR_SEEN));
    present[n->source / 16] ^= bit;
    return true;
}

static bool on_shared(uint16 pid, uint16 id, sys_event_data *data)
{
    (void)pid;
    CHECK(id == SHARED && data->size <= SYS_MAXIMUM_PAYLOAD);
    return true;
}

static void check_table(void)
{
    sys_neighbour all[SYS_NEIGHBOURS];
    unsigned known = 0;
    uint8 count = Sys_Get_Neighbours(all, SYS_NEIGHBOURS);
    for (unsigned i = 0; i < sizeof present / sizeof *present; i++) {
        known += (unsigned)__builtin_popcount(present[i]);
    }
    CHECK_EQ(known, count);
    for (uint8 i = 0; i < count; i++) {
        CHECK(present[all[i].source / 16] >> all[i].source % 16 & 1u);
    }
    CHECK_EQ(Sys_Get_Neighbours(all, (uint8)below(SYS_NEIGHBOURS)) <= count, true);
}

/* ---- The program ----------------------------------------------------------------------------------------- */

static void call_something(void)
{
    uint8 bytes[12];
    memset(bytes, (int)below(256), sizeof bytes);
    switch (below(9)) {
    case 0:
    case 1:
        (void)Sys_Send_Neighbours(bytes, (uint16)below(12));
        break;
    case 2:
        (void)Sys_Send_Event(SYS_SEND_NEIGHBOURS, bytes, (uint16)below(12));
        break;
    case 3:
    case 4:
        (void)Sys_Send_Event(SHARED, bytes, (uint16)below(12));
        break;
    case 5:
        (void)Sys_Set_RobotNumber((uint16)below(2049));
        break;
    case 6:
        CHECK(Sys_Set_InfraredThreshold((uint8)(1 + below(8))) && !Sys_Set_InfraredThreshold((uint8)(101 + below(155))));
        break;
    case 7:
        (void)Sys_Share_Event(SHARED, (uint8)below(9));
        break;
    default:
        CHECK(Sys_Estimate_Range((uint16)below(5000)) <= 600);
    }
}

static void step(void)
{
    bool is_held = one_in(8);
    damaged -= damaged != 0;
    if (is_held) {
        Sys_Start_CriticalSection();
    }
    if (one_in(12)) {
        for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
            room[i] = (uint16)(one_in(20) ? below(2) * 4095 : 2000 + below(2000));
        }
        damaged = DAMAGED_STEPS;
    }
    if (one_in(12)) {
        noise = (uint16)(one_in(4) ? below(200) : below(4));
    }
    for (unsigned i = below(4); i != 0; i--) {
        talk_at_random();
        call_something();
    }
    if (one_in(10)) {
        dark(below(9000));
    }
    if (is_held) {
        Sys_End_CriticalSection();
    }
    Sys_Yield();
    check_table();
}

TEST(anything_seen_and_asked_is_survived, "nothing damaged, false or stale arrives; memory is given back; frames arrive again")
{
    state = test_seed;
    for (uint8 i = 0; i < HAL_INFRARED_SENSORS; i++) {
        room[i] = DARK;
    }
    begin_link();
    CHECK(Sys_Register_Event(SHARED) && Sys_Share_Event(SHARED, 3));
    CHECK(Sys_Subscribe_to_Event(SHARED, 0, on_shared, NULL));
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_MESSAGE, 0, on_message, NULL));
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_SEEN, 0, on_neighbour, NULL));
    CHECK(Sys_Subscribe_to_Event(SYS_NEIGHBOUR_LOST, 0, on_neighbour, NULL));
    Sys_Yield();
    uint16 heap = heap_now();
    for (int i = 0; i < STEPS; i++) {
        step();
    }
    noise = 0;
    for (int i = 0; i < 2 + SYS_INFRARED_QUEUE; i++) { /* queued frames are sent or expire */
        scans_in_the_dark(4096);
        Sys_Yield();
    }
    CHECK_EQ(heap_now(), heap);
    recording r = {{false}, 0};
    uint16 received = Sys_Get_InfraredStatistics()->received;
    r.length = draw(r.lit, &(text){FRAME_MESSAGE, 1, 1234, "x"}, true);
    for (int tries = 0; tries < 8 && received == Sys_Get_InfraredStatistics()->received; tries++) {
        play(&r, 2, 300); /* repeat: the robot itself may be sending */
    }
    CHECK(received != Sys_Get_InfraredStatistics()->received);
}
