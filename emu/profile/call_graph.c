/* Call graph, built from the records of emu/dspic30f/cycle_accounting.py. It has one stack of frames for each stack of
   the firmware and, for every call site, the callee, the number of calls and their cycles.

   A return belongs to the call that stored its return address where the return reads it. If that address is on another
   stack, the return is a thread switch. The frames above it are dropped. Time in Sleep, in interrupts and in other
   threads is attributed to no function. Nor is the time of a loop that calls the idle function, from its first call to
   the end of its last one. */
typedef unsigned char u8;
typedef unsigned short u16;
typedef unsigned int u32;
typedef unsigned long long u64;

enum { STACKS = 128, DEPTH = 2048, EDGES = 1 << 16, TOP = 0xFFFFFFu };
enum { CALLED = 1, RETURNED, ENTERED, SLEPT, RESET };
enum { OPEN = 1, CLOSE, SWITCH, SLEEP };

typedef struct { u64 start, stolen, idle_from, idle_stolen; u32 site, entry, place, level, edge; } Frame;
typedef struct { u64 left; u32 depth; Frame frame[DEPTH]; } Stack;
typedef struct { u64 key, calls, cycles, most, least; } CallEdge;
typedef struct { u64 cycle, since; u32 what, stack, level, entry, site, length; } CallEvent;
typedef struct {
    u64 now;
    u32 current, lost, edges, idle;
    CallEvent *event;
    u64 events;
    CallEdge edge[EDGES];
    Stack stack[STACKS];
} CallGraph;

static u32 edge_of(CallGraph *t, u32 site, u32 entry) {
    u64 key = ((u64)site << 32 | entry) + 1;
    u32 at = (u32)(key * 0x9E3779B97F4A7C15ull >> 48) & (EDGES - 1);
    while (t->edge[at].key && t->edge[at].key != key) at = (at + 1) & (EDGES - 1);
    if (!t->edge[at].key) {
        if (t->edges >= EDGES - 1) {
            t->lost++;
            return at;
        }
        t->edge[at].key = key;
        t->edges++;
    }
    return at;
}

static void record_event(CallGraph *t, u32 what, const Frame *f, u64 since, u32 length) {
    if (!t->event) return;
    CallEvent *event = &t->event[t->events++];
    event->cycle = t->now;
    event->since = since;
    event->what = what;
    event->stack = t->current;
    event->level = f ? f->level : 0;
    event->entry = f ? f->entry : 0;
    event->site = f ? f->site : 0;
    event->length = length;
}

static void push(CallGraph *t, u64 start, u32 site, u32 entry, u32 place, u32 level, u64 since) {
    Stack *s = &t->stack[t->current];
    if (s->depth == DEPTH) {
        t->lost++;
        return;
    }
    Frame *f = &s->frame[s->depth++];
    *f = (Frame){start, 0, 0, 0, site, entry, place, level, edge_of(t, level ? TOP : site, entry)};
    t->edge[f->edge].calls++;
    if (entry == t->idle && !level && s->depth > 1 && !f[-1].idle_from) {
        f[-1].idle_from = start;
        f[-1].idle_stolen = f[-1].stolen;
    }
    u64 now = t->now;
    t->now = start;
    record_event(t, OPEN, f, since, 0);
    t->now = now;
}

/* End the top frame of the current stack. The inclusive time of recursive calls counts only for the outermost one. */
static void pop(CallGraph *t) {
    Stack *s = &t->stack[t->current];
    Frame *f = &s->frame[--s->depth];
    u64 all = t->now - f->start;
    int outermost = 1;
    if (!f->level)
        for (u32 i = s->depth; i-- > 0;) {
            if (s->frame[i].edge == f->edge) outermost = 0;
            if (s->frame[i].level) break;
        }
    if (outermost) {
        CallEdge *e = &t->edge[f->edge];
        u64 own = all - f->stolen;
        e->cycles += own;
        if (own > e->most) e->most = own;
        if (!e->least || own < e->least) e->least = own;
    }
    if (s->depth) {
        Frame *caller = &s->frame[s->depth - 1];
        caller->stolen += f->level ? all : f->stolen;
        if (f->entry == t->idle && !f->level && caller->idle_from)
            caller->stolen = caller->idle_stolen + (t->now - caller->idle_from);
    }
    record_event(t, CLOSE, f, 0, 0);
}

static void to_stack(CallGraph *t, u32 other) {
    Stack *s = &t->stack[other];
    t->stack[t->current].left = t->now;
    t->current = other;
    if (s->depth) s->frame[s->depth - 1].stolen += t->now - s->left;
    record_event(t, SWITCH, 0, 0, 0);
}

static int find(const Stack *s, u32 place) {
    for (u32 i = s->depth; i-- > 0;)
        if (s->frame[i].place == place) return (int)i;
    return -1;
}

/* Return an unused stack; if there is none, the least recently used one. */
static u32 new_stack(CallGraph *t) {
    u32 best = t->current ? 0 : 1;
    for (u32 i = 0; i < STACKS; i++) {
        if (i == t->current) continue;
        if (!t->stack[i].depth) return i;
        if (t->stack[i].left < t->stack[best].left) best = i;
    }
    t->stack[best].depth = 0;
    return best;
}

static void returned(CallGraph *t, u32 site, u32 place, u32 target) {
    int at = find(&t->stack[t->current], place);
    if (at < 0) {
        u32 other = STACKS;
        for (u32 i = 0; i < STACKS && at < 0; i++)
            if (i != t->current && (at = find(&t->stack[i], place)) >= 0) other = i;
        if (other == STACKS) {
            to_stack(t, new_stack(t));
            push(t, t->now, site, target, ~0u, 0, 0);
            return;
        }
        to_stack(t, other);
    }
    while (t->stack[t->current].depth > (u32)at) pop(t);
}

static void close_all(CallGraph *t) {
    for (u32 i = 0; i < STACKS; i++) {
        if (!t->stack[i].depth) continue;
        if (i != t->current) to_stack(t, i);
        while (t->stack[i].depth) pop(t);
    }
}

u64 call_graph_size(void) { return sizeof(CallGraph); }

/* Start the call graph: the program is at `entry` at cycle `now`. `idle` is the idle function's entry, or 0xFFFFFF. */
void call_graph_begin(CallGraph *t, u64 now, u64 entry, u64 idle) {
    t->now = now;
    t->idle = (u32)idle;
    push(t, now, TOP, (u32)entry, ~0u, 0, 0);
}

/* Reset all counts; keep the stacks. */
void call_graph_clear(CallGraph *t, u64 now) {
    for (u32 i = 0; i < EDGES; i++) t->edge[i].calls = t->edge[i].cycles = t->edge[i].most = t->edge[i].least = 0;
    for (u32 i = 0; i < STACKS; i++) {
        Stack *s = &t->stack[i];
        if (i != t->current) s->left = now;
        for (u32 k = 0; k < s->depth; k++) s->frame[k].start = now, s->frame[k].stolen = s->frame[k].idle_from = 0;
    }
    t->now = now;
}

void call_graph_end(CallGraph *t, u64 now) {
    t->now = now;
    close_all(t);
}

/* Return the number of open frames in all stacks. */
u64 call_graph_open(const CallGraph *t) {
    u64 sum = 0;
    for (u32 i = 0; i < STACKS; i++) sum += t->stack[i].depth;
    return sum;
}

/* Process `count` records. `event` receives at most 2 * count call events, plus one for every open frame and stack. */
u64 call_graph_process(CallGraph *t, const u64 *record, u64 count, CallEvent *event) {
    t->event = event;
    t->events = 0;
    for (; count; count--, record += 4) {
        u32 kind = record[1] & 0xFF, level = record[1] >> 8 & 0xFF, place = record[1] >> 16 & 0xFFFF;
        u32 site = (u32)(record[1] >> 32), target = (u32)record[2], cycles = (u32)(record[2] >> 32);
        t->now = record[0];
        if (kind == CALLED)
            push(t, t->now, site, target, place, 0, 0);
        else if (kind == RETURNED)
            returned(t, site, place, target);
        else if (kind == ENTERED)
            push(t, t->now - cycles, site, target, place, level + 1, record[3]);
        else if (kind == SLEPT) {
            Stack *s = &t->stack[t->current];
            if (s->depth) s->frame[s->depth - 1].stolen += cycles;
            record_event(t, SLEEP, 0, 0, cycles);
        } else if (kind == RESET) {
            close_all(t);
            push(t, t->now, TOP, 0, ~0u, 0, 0);
        }
    }
    t->event = 0;
    return t->events;
}

/* Write the edges in use: call site or 0xFFFFFF, entry, calls, cycles, cycles of the longest and the shortest call. */
u64 call_graph_edges(const CallGraph *t, u64 *out) {
    u64 n = 0;
    for (u32 i = 0; i < EDGES; i++)
        if (t->edge[i].key && (t->edge[i].calls || t->edge[i].cycles)) {
            u64 key = t->edge[i].key - 1;
            const CallEdge *e = &t->edge[i];
            u64 row[] = {key >> 32, (u32)key, e->calls, e->cycles, e->most, e->least};
            for (u32 k = 0; k < 6; k++) out[6 * n + k] = row[k];
            n++;
        }
    return n;
}

u64 call_graph_lost(const CallGraph *t) { return t->lost; }
