// Conversion of a stepper motor's phases to steps (epuck.md §3). A pattern counts once it has been constant for SETTLE
// Tcy. No event is posted for that: the next pattern or the next read evaluates it.

#include <stdint.h>

typedef int64_t i64;

enum { SETTLE = 15, NOWHERE = 4, ILLEGAL = -1, ROOM = 4096 };

// State of a motor in the machine's record. `nibble` is the current coil pattern, `since` its first cycle.
struct state {
    i64 steps, lost, illegals, index, nibble, since, settled, on_time;
};

// Step history: values of `steps` with their cycles. `before` is the value before the first entry.
struct history {
    i64 before, count, cycle[ROOM], steps[ROOM];
};

struct motor {
    struct state *state;
    i64 shift, forward;
    struct history *history; // null if no history is recorded
};

// Phase index of each coil pattern; NOWHERE if all coils are off, ILLEGAL for a pattern that is not a phase.
static const int8_t meaning[16] = {NOWHERE, -1, -1, -1, -1, 2, 1, -1, -1, 3, 0, -1, -1, -1, -1, -1};

// Update the counters for the current coil pattern, which has been constant for SETTLE Tcy.
static void settle(const struct motor *m)
{
    struct state *s = m->state;
    i64 index = meaning[s->nibble];
    s->settled = 1;
    if (index == NOWHERE)
        return; // all coils off: friction in the gear holds the rotor
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

// Update the counters for the current coil pattern if it has been constant for SETTLE Tcy at cycle `now`.
void settle_by(const struct motor *m, i64 now)
{
    if (!m->state->settled && now - m->state->since >= SETTLE)
        settle(m);
}

// Record that the port's pins have `levels` from `cycle` on.
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

// Process port changes in order; each is encoded as cycle << 24 | port << 16 | levels.
void decode(const struct motor *m, const uint64_t *changes, i64 count, i64 port)
{
    for (i64 i = 0; i < count; i++)
        if ((i64)(changes[i] >> 16 & 0xFF) == port && (i64)(changes[i] >> m->shift & 0xF) != m->state->nibble)
            change(m, (i64)(changes[i] >> 24), (i64)(changes[i] & 0xFFFF));
}

// Write the steps made by each of the given cycles, which are increasing and not in the future; drop older history.
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

// Both motors and the ring of pin changes made by native code (pins.py). `watched`: ports whose changes have other
// consumers.
struct pair {
    const struct motor *left, *right;
    i64 port;
    uint64_t *changes, *count;
    uint16_t *reported;
    i64 watched;
};

// Process the ring up to cycle `now`, then write both motors' steps at the given cycles: left, right, left and so on.
// Return 0 without any effect if the ring holds changes with other consumers.
i64 steps_of_both(const struct pair *p, i64 now, const i64 *cycles, i64 count, i64 *steps)
{
    i64 changes = (i64)*p->count;
    for (i64 i = 0; i < changes; i++)
        if (p->watched >> (p->changes[i] >> 16 & 0xFF) & 1)
            return 0;
    decode(p->left, p->changes, changes, p->port);
    decode(p->right, p->changes, changes, p->port);
    for (i64 i = 0; i < changes; i++) {
        p->reported[p->changes[i] >> 16 & 0xFF] = (uint16_t)p->changes[i];
        p->changes[i] = 0;
    }
    *p->count = 0;
    settle_by(p->left, now);
    settle_by(p->right, now);
    steps_by(p->left, cycles, count, steps);
    steps_by(p->right, cycles, count, steps + 1);
    return 1;
}
