// Infrared light between Kilobots: edges of emitters reach the receivers' comparators and converters.
//
// Time is counted in ticks of 125 ns since the start of the swarm; each robot has its own clock rate. Light reaches
// other robots `delay` ticks after the emitter's pin, and the sender itself (its echo) after ECHO ticks. A robot never
// runs past a tick at which light may still arrive. So no light is late, and the division of a run into calls has no
// effect.

typedef i64 (*run_function)(struct avr *m, const struct insn *code, u64 until);
typedef i64 (*observed_function)(struct avr *m, const struct insn *code, u64 until, void *observation);
typedef i64 (*input_function)(struct avr *m, u64 at, i64 kind, i64 value);
typedef i64 (*observed_input_function)(struct avr *m, u64 at, i64 kind, i64 value, void *observation);

// MARGIN: ticks by which the last instruction may pass the goal of a robot; all light until then must be known. The
// longest one, SBI of EERE, ends 5 cycles after the goal: at most 8 ticks of the slowest clock (SLOWEST in swarm.py).
enum { ECHO = 9, MARGIN = 8 };
enum { LAMP = 0xFFFFFFFF }; // sender of light from outside the swarm
enum { INPUT_ANALOG = 2, CH_HIGH_GAIN = 0, CH_LOW_GAIN = 1, CH_AIN0 = 9 };
enum { RUN_LIMIT, RUN_FAULT, RUN_HALT, RUN_LOG, RUN_PROGRAM, RUN_LIGHT, RUN_BREAK }; // results of a run
enum { LIT_UV = 1000000, DARK_UV = 0 };
#define STOPPED (1ULL << 62) // a tick after the end of every run

struct edge {
    u64 at; // ticks
    u32 high_uv, low_uv;
    i32 change; // +1: an emitter is switched on, -1: off
    u32 sender; // decides the order of edges of one tick
};

struct link { // light of a sender at a receiver
    u32 high_uv, low_uv;
    u32 loss;   // of 65,536 pulses
    u32 shown;  // 1: the receiver sees an emitter of the sender that is still on
};

struct robot {
    struct avr *avr;
    const struct insn *code;
    u64 on_at; // tick of power-on
    u64 rate;  // cycles per 2^32 ticks
    u64 period; // ticks per 2^32 cycles, rounded down
    u32 lights, edge_count;
    u64 reached; // tick up to which the robot has run
    u64 pulses;  // light pulses it has sent
    void *observation; // of a profile or debugger, else 0
    struct edge *edges; // `room` of them
};

struct air {
    i64 count;
    struct robot *robots;
    struct link *links; // [sender][receiver]
    u64 *acts;          // earliest tick at which each robot can send light
    run_function run;
    input_function input;
    observed_function run_observed;
    observed_input_function input_observed;
    u64 delay, seed, room;
    u64 lost_edges; // edges for which a receiver had no room
};

// Return a random number for a pulse on a link. It depends only on its arguments, not on the order in which robots run.
static u32 draw(const struct air *a, u64 link, u64 pulse)
{
    u64 z = a->seed + link * 0x9E3779B97F4A7C15ULL + pulse * 0xD1B54A32D192ED03ULL;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ z >> 27) * 0x94D049BB133111EBULL;
    return (u32)((z ^ z >> 31) >> 32);
}

// Return the robot's cycle at a tick.
static u64 cycle_at(const struct robot *r, u64 tick)
{
    return tick <= r->on_at ? 0 : (u64)((unsigned __int128)(tick - r->on_at) * r->rate >> 32);
}

// Return the first tick at or after a cycle of the robot.
static u64 tick_of(const struct robot *r, u64 cycle)
{
    u64 tick = r->on_at + (u64)((unsigned __int128)cycle * r->period >> 32);
    while (cycle_at(r, tick) < cycle)
        tick++;
    return tick;
}

// Return the earliest tick at which the robot can send light. A robot in a waiting loop sends none before its next event
// or the end of its countdown.
static u64 earliest_light(const struct robot *r)
{
    const struct avr *m = r->avr;
    u64 counts = m->resting || m->halted ? ~0ULL : m->counts_until;
    if (counts <= m->cycle)
        return r->reached;
    u64 due = m->next_due < counts ? m->next_due : counts;
    u64 wakes = due == ~0ULL ? due : tick_of(r, due);
    u64 light = r->edge_count ? r->edges[0].at : ~0ULL;
    u64 first = wakes < light ? wakes : light;
    return first > r->reached ? first : r->reached;
}

static void update_earliest_light(struct air *a, const struct robot *r)
{
    a->acts[r - a->robots] = earliest_light(r);
}

static int is_before(const struct edge *e, const struct edge *other)
{
    return e->at != other->at ? e->at < other->at : e->sender < other->sender;
}

// Queue an edge for a robot. Return whether the robot receives it: a stopped robot, or one without power yet, does not.
static int add_edge(struct air *a, struct robot *r, struct edge edge)
{
    if (edge.at < r->reached)
        return 0;
    if (r->edge_count == a->room) {
        a->lost_edges++;
        return 0;
    }
    u32 place = r->edge_count++;
    while (place && is_before(&edge, r->edges + place - 1)) {
        r->edges[place] = r->edges[place - 1];
        place--;
    }
    r->edges[place] = edge;
    update_earliest_light(a, r);
    return 1;
}

// Give a robot an input at its cycle `at`. Return 0, or -1 if there is no room.
static i64 give(const struct air *a, const struct robot *r, u64 at, i64 kind, i64 value)
{
    return r->observation ? a->input_observed(r->avr, at, kind, value, r->observation)
                          : a->input(r->avr, at, kind, value);
}

// Apply the edges up to tick `until` to the robot's inputs; edges of one tick are applied together. The comparator's
// input is light or darkness. The converter's inputs keep the strength, because a conversion samples after the pulse.
static void deliver(struct air *a, struct robot *r, u64 until)
{
    u32 done = 0;
    while (done < r->edge_count && r->edges[done].at <= until) {
        const struct edge *brightest = 0;
        u64 at = r->edges[done].at, cycle = cycle_at(r, at);
        u32 before = r->lights;
        i64 lost = 0;
        for (; done < r->edge_count && r->edges[done].at == at; done++) {
            const struct edge *e = r->edges + done;
            r->lights += (u32)e->change;
            if (e->change > 0 && (!brightest || e->high_uv > brightest->high_uv))
                brightest = e;
        }
        if (brightest) {
            lost |= give(a, r, cycle, INPUT_ANALOG + CH_HIGH_GAIN, brightest->high_uv);
            lost |= give(a, r, cycle, INPUT_ANALOG + CH_LOW_GAIN, brightest->low_uv);
        }
        if (!before != !r->lights)
            lost |= give(a, r, cycle, INPUT_ANALOG + CH_AIN0, r->lights ? LIT_UV : DARK_UV);
        a->lost_edges += lost != 0;
    }
    for (u32 n = done; n < r->edge_count; n++)
        r->edges[n - done] = r->edges[n];
    r->edge_count -= done;
}

// Switch a robot's emitter on (+1) or off (-1) at a tick. Return whether another robot receives the change.
static int emit(struct air *a, i64 sender, u64 at, i32 change)
{
    struct robot *s = a->robots + sender;
    int received = 0;
    s->pulses += change > 0;
    for (i64 n = 0; n < a->count; n++) {
        struct link *l = a->links + sender * a->count + n;
        if (change < 0 ? !l->shown : !l->high_uv && !l->low_uv)
            continue; // the receiver also sees the end of the light if the sender has moved out of reach meanwhile
        if (change > 0 && l->loss && (draw(a, (u64)(sender * a->count + n), s->pulses) & 0xFFFF) < l->loss)
            continue;
        struct edge edge = {at + (n == sender ? ECHO : a->delay), l->high_uv, l->low_uv, change, (u32)sender};
        l->shown = add_edge(a, a->robots + n, edge) && change > 0;
        received |= n != sender;
    }
    return received;
}

// Stop a robot permanently: switch its light off, and deliver no more light to it.
void air_stop(struct air *a, i64 index)
{
    struct robot *r = a->robots + index;
    if (r->avr->lit)
        emit(a, index, r->reached, -1);
    r->avr->lit = 0;
    r->reached = STOPPED;
}

// Show one robot light from outside the swarm, from tick `at` for `ticks`. Return 0, or -1 if the robot has already run
// past `at`.
i64 air_flash(struct air *a, i64 receiver, i64 at, i64 ticks, i64 high_uv, i64 low_uv)
{
    struct robot *r = a->robots + receiver;
    struct edge on = {(u64)at, (u32)high_uv, (u32)low_uv, 1, LAMP}, off = on;
    off.at += (u64)ticks, off.change = -1;
    if (on.at < r->reached && r->reached > r->on_at && r->reached != STOPPED)
        return -1;
    if (add_edge(a, r, on))
        add_edge(a, r, off);
    return 0;
}

// Return the last tick of the robot's present cycle.
static u64 last_tick(const struct robot *r)
{
    return tick_of(r, r->avr->cycle + 1) - 1;
}

// Run one robot to tick `goal`; if it sends light, only until an answer to that light can arrive. Return 0, or 1 if
// Python must handle its state (fault, log, new program, end of an observed run).
static int run_robot(struct air *a, i64 index, u64 goal)
{
    struct robot *r = a->robots + index;
    while (r->reached < goal) {
        deliver(a, r, (r->observation ? last_tick(r) : r->reached) + MARGIN);
        u64 piece = r->edge_count && r->edges[0].at - MARGIN < goal ? r->edges[0].at - MARGIN : goal;
        u64 cycle = cycle_at(r, piece);
        i64 result = r->observation ? a->run_observed(r->avr, r->code, cycle, r->observation)
                                    : a->run(r->avr, r->code, cycle);
        if (result == RUN_HALT) // only light can wake it
            r->avr->cycle = cycle > r->avr->cycle ? cycle : r->avr->cycle;
        u64 reached = tick_of(r, r->avr->cycle);
        if (result == RUN_LIGHT) {
            u64 at = tick_of(r, r->avr->light_cycle), answered = at + 2 * a->delay - MARGIN;
            r->avr->light_changed = 0;
            if (emit(a, index, at, r->avr->lit ? 1 : -1) && answered < goal)
                goal = answered;
        } else if (result == RUN_BREAK && last_tick(r) >= goal) {
            // Report the stop in the next call, which knows all light up to this cycle: the cycle ends after `goal`.
            reached = reached > goal ? reached : goal;
        } else if (result != RUN_LIMIT && result != RUN_HALT) {
            r->reached = reached;
            if (result == RUN_BREAK) // two stops at one cycle show the same inputs
                deliver(a, r, last_tick(r) + MARGIN);
            return 1;
        } else if (reached < piece)
            reached = piece; // `piece` is between two cycles of this robot
        r->reached = reached;
    }
    return 0;
}

// Run all robots to tick `until`. Return -1, or the index of a robot that Python must handle.
i64 air_run(struct air *a, i64 until)
{
    u64 end = (u64)until;
    for (i64 n = 0; n < a->count; n++)
        update_earliest_light(a, a->robots + n);
    for (;;) {
        u64 first = ~0ULL, second = ~0ULL;
        for (i64 n = 0; n < a->count; n++) {
            u64 at = a->acts[n];
            u64 later = at < first ? first : at;
            first = at < first ? at : first;
            second = later < second ? later : second;
        }
        if (first >= end)
            break;
        // Light that is sent at `first` or later arrives after `horizon`, so every robot may run to it. If only one
        // robot can send light before the horizon, that robot may run further.
        u64 horizon = first + a->delay - MARGIN, before = horizon, goal = horizon;
        if (second >= horizon)
            before = first + 1, goal = second > end ? end : second + a->delay - MARGIN;
        goal = goal < end ? goal : end;
        for (i64 n = 0; n < a->count; n++) {
            if (a->acts[n] >= before)
                continue;
            int stops = run_robot(a, n, goal);
            update_earliest_light(a, a->robots + n);
            if (stops)
                return n;
        }
    }
    for (i64 n = 0; n < a->count; n++) // no robot can send light before the end
        if (run_robot(a, n, end))
            return n;
    return -1;
}
