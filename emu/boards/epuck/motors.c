// Phases of a stepper motor to steps (epuck.md §3). A pattern counts once it has stood for SETTLE Tcy; nothing is posted
// for that: what is due is settled when the next pattern comes or somebody looks.

#include <stdint.h>

typedef int64_t i64;

enum { SETTLE = 15, NOWHERE = 4, ILLEGAL = -1, ROOM = 4096 };

// A motor's part of the machine's record.
struct state {
    i64 steps, lost, illegals, index, nibble, since, settled, on_time;
};

// When `steps` became what, for somebody who asks later. `before`: what it was in front of the first entry.
struct history {
    i64 before, count, cycle[ROOM], steps[ROOM];
};

struct motor {
    struct state *state;
    i64 shift, forward;
    struct history *history; // null: nobody asks
};

// Phase index of a nibble; NOWHERE for all coils off, ILLEGAL for what is no phase.
static const int8_t meaning[16] = {NOWHERE, -1, -1, -1, -1, 2, 1, -1, -1, 3, 0, -1, -1, -1, -1, -1};

// The present pattern has stood long enough to count.
static void settle(const struct motor *m)
{
    struct state *s = m->state;
    i64 index = meaning[s->nibble];
    s->settled = 1;
    if (index == NOWHERE)
        return; // all off: friction in the gear keeps the rotor where it is
    if (index == ILLEGAL) {
        s->illegals++;
        return;
    }
    i64 moved = s->index == NOWHERE ? 0 : (index - s->index) & 3;
    s->index = index;
    if (moved == 2)
        s->lost++;
    if (moved != 1 && moved != 3)
        return;
    s->steps += moved == 1 ? m->forward : -m->forward;
    struct history *h = m->history;
    if (!h)
        return;
    if (h->count == ROOM)
        h->count = 0, h->before = h->steps[ROOM - 1];
    h->cycle[h->count] = s->since + SETTLE;
    h->steps[h->count++] = s->steps;
}

// What has stood long enough by cycle `now` counts.
void settle_by(const struct motor *m, i64 now)
{
    if (!m->state->settled && now - m->state->since >= SETTLE)
        settle(m);
}

// From `cycle` on the port has `levels`.
void change(const struct motor *m, i64 cycle, i64 levels)
{
    struct state *s = m->state;
    settle_by(m, cycle);
    if (s->nibble)
        s->on_time += cycle - s->since;
    s->nibble = levels >> m->shift & 0xF;
    s->since = cycle;
    s->settled = 0;
}

// Changes of ports in their order, each cycle << 24 | port << 16 | levels.
void decode(const struct motor *m, const uint64_t *changes, i64 count, i64 port)
{
    for (i64 i = 0; i < count; i++)
        if ((i64)(changes[i] >> 16 & 0xFF) == port && (i64)(changes[i] >> m->shift & 0xF) != m->state->nibble)
            change(m, (i64)(changes[i] >> 24), (i64)(changes[i] & 0xFFFF));
}

// Steps made by each of some cycles, which rise and are not behind the present; what is older is forgotten.
static void steps_by(const struct motor *m, const i64 *cycles, i64 count, i64 *steps)
{
    struct history *h = m->history;
    i64 place = 0;
    for (i64 i = 0; i < count; i++) {
        while (place < h->count && h->cycle[place] <= cycles[i])
            h->before = h->steps[place++];
        steps[2 * i] = h->before;
    }
    h->count -= place;
    for (i64 i = 0; i < h->count; i++)
        h->cycle[i] = h->cycle[place + i], h->steps[i] = h->steps[place + i];
}

// Both motors, and what native code has done to the pins (pins.py), in order; `heard`: ports whose changes others are
// told too.
struct pair {
    const struct motor *left, *right;
    i64 port;
    uint64_t *changes, *count;
    uint16_t *told;
    i64 heard;
};

// Both motors' steps, left, right, left and so on, once both know what is in the ring, and what counts by cycle `now`.
// 0, and nothing is done, if others want to know of it.
i64 steps_of_both(const struct pair *p, i64 now, const i64 *cycles, i64 count, i64 *steps)
{
    i64 changes = (i64)*p->count;
    for (i64 i = 0; i < changes; i++)
        if (p->heard >> (p->changes[i] >> 16 & 0xFF) & 1)
            return 0;
    decode(p->left, p->changes, changes, p->port);
    decode(p->right, p->changes, changes, p->port);
    for (i64 i = 0; i < changes; i++) {
        p->told[p->changes[i] >> 16 & 0xFF] = (uint16_t)p->changes[i];
        p->changes[i] = 0;
    }
    *p->count = 0;
    settle_by(p->left, now);
    settle_by(p->right, now);
    steps_by(p->left, cycles, count, steps);
    steps_by(p->right, cycles, count, steps + 1);
    return 1;
}
