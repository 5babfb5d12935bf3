// Robots that run ahead, each until it looks at something, and the world that follows the slowest: the loop of
// lockstep.py. Native code runs a robot; a line of its camera, ends of quanta and looks at whether its CPU is idle are
// done here; for whatever else native code comes back, Python goes on with the robot. What robots do between two steps
// of the world touches nothing of each other, so threads share them.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

// What is to be done with a robot: Python has it, or it is through; it runs; it waits for poses to paint a line with,
// or Python waits for them; native code has come back for Python.
enum { AWAY, RUNS, PAINTS, LOOKS, CAME_BACK };

// Results of `run_all` that are no robot's number.
enum { OVER = -1, WORLD = -2 };

// Looks of a helper before it sleeps: longer than a step of the world takes.
enum { PATIENCE = 10000 };

// A machine (emu/system/native_handle.py).
struct native {
    i64 (*entry)(void *record, void *env);
    void *record, *env;
    u64 *begins, *limit, *last, *noted, *notes, *fresh, *cycle, *now, *deadline;
    uint32_t *pc;
    uint16_t *mode, *corcon, *enables[3];
    i64 room, interpret, service, awake, trap;
};

// Functions of other files, which know what a camera, a view and rays are (line.c, sight.c).
struct code {
    i64 (*asked)(const void *camera, i64 setting, i64 cycle, i64 *href);
    void (*send)(const void *camera, i64 href, const uint8_t *pixels);
    const uint8_t *(*line)(void *view, const f64 *poses, const f64 *before, f64 quanta, const void *rays,
                           const int16_t *colours, const int16_t *noise);
    i64 (*both_by)(const void *pair, i64 now, const u64 *cycles, i64 count, i64 *steps);
    void (*turned)(void *drive, i64 first, i64 count, const i64 *steps);
    uint32_t (*draw)(void *generator);
};

// A robot. Ticks count quanta since the trial's start, cycles are its machine's, which was switched on at `on_at`.
struct robot {
    i64 stands, tick; // the latter: of the poses that are waited for
    i64 why;          // native code came back
    struct native *native;
    const struct code *code;
    i64 quantum, on_at;
    i64 taken, told;                      // quanta whose ends Python has taken; whose steps the wheels have been told
    i64 end;                              // cycle at which Python wants it back
    i64 probe_at, probes, busy, stuck_at; // looks at whether the CPU is idle: the next; how many, and how many found it
                                          // at work; since when something seems wrong, -1: nothing
    i64 probe_span, kept; // the random time between two is below this; wheels are told after so many quanta
    const void *camera;
    i64 data_port; // index of the register that the picture is read from
    void *view;
    const void *const *fans; // rays of each row of the scene, of one setting of the camera
    i64 setting;
    i64 first_strip, last_strip, strip; // rows whose pixels are recorded; the last one painted of them, -1: none
    const int16_t *colours, *noise;
    i64 noise_shift; // a random number of 32 bits, shifted, is where noise of a line begins
    const void *pair;
    void *drive, *generator;
    i64 *steps;    // room for those of all notes
    i64 row, href; // of the scene and of the line that is to be painted
};

// The world (world.py).
struct ground {
    void (*quanta)(void *world, const f64 *const *speeds, i64 room, i64 first, i64 count, f64 *wheels, f64 *out,
                   i64 numbers);
    void *world;
    f64 *wheels;
    i64 numbers, ticks, until;
    f64 *row;
    const f64 *now, *before;
};

// A thread that helps. It sleeps in a lock of Python's, for which it needs no global lock.
struct helper {
    void *lock;
    i64 sleeps, runs; // runs: of robots, so far
};

struct swarm {
    i64 count;
    struct robot *const *robots;
    const f64 *const *speeds;
    i64 room; // quanta for which speeds are kept
    struct ground *ground;
    i64 wanted; // how far the world is to go, by Python
    i64 helpers;
    struct helper *helper;
    int (*acquire)(void *lock, int waits);
    void (*release)(void *lock);
    // A round: robots with something to do, how many of them nobody has (0 or less: none), and how many are through.
    struct robot **ready;
    i64 left, through, rounds, is_over;
};

static i64 end_of(const struct robot *r, i64 tick)
{
    return (tick + 1) * r->quantum - r->on_at;
}

// What `integers(end)` of the generator would draw next: Lemire's method on 32 bits.
static i64 below(const struct robot *r, u64 end)
{
    for (;;) {
        u64 drawn = r->code->draw(r->generator) * end;
        if ((drawn & 0xFFFFFFFF) >= (1ULL << 32) % end)
            return (i64)(drawn >> 32);
    }
}

// Tell the wheels what the motors have done in quanta that are over. 0: others are to be told of the pins first.
static int settle(struct robot *r)
{
    const struct native *n = r->native;
    i64 count = r->taken + (i64)*n->noted - r->told;
    if (count <= 0)
        return 1;
    *n->now = *n->cycle;
    if (!r->pair || !r->code->both_by(r->pair, (i64)*n->cycle, n->notes + (r->told - r->taken), count, r->steps))
        return 0;
    r->code->turned(r->drive, r->told, count, r->steps);
    r->told += count;
    return 1;
}

// At a limit that is a look at the CPU, after which the robot may run on. A CPU that may be stuck is Python's.
static int probe(struct robot *r)
{
    struct native *n = r->native;
    i64 now = (i64)*n->cycle, tick = r->taken + (i64)*n->noted;
    int awake = *n->mode == n->awake;
    if (!*n->last || now < (i64)*n->last || now < r->probe_at || now >= r->end)
        return 0;
    if (*n->corcon & n->trap || !(awake || *n->enables[0] || *n->enables[1] || *n->enables[2]))
        return 0;
    for (; end_of(r, tick) <= now; tick++) {
        if ((i64)*n->noted == n->room)
            return 0;
        n->notes[(*n->noted)++] = (u64)now;
    }
    if (tick - r->told >= r->kept && !settle(r))
        return 0;
    r->probes++, r->busy += awake, r->stuck_at = -1;
    r->probe_at = now + 1 + below(r, (u64)r->probe_span);
    i64 last = r->probe_at < r->end ? r->probe_at : r->end, cut = end_of(r, tick);
    *n->last = (u64)last;
    *n->limit = (u64)(cut < last ? cut : last);
    *n->begins = 1;
    return 1;
}

// Whether the instruction that Python was called for reads a line that is painted here; the robot then waits for poses.
static int looks(struct robot *r, const struct ground *g)
{
    const struct native *n = r->native;
    u64 instruction = *n->pc | (u64)r->data_port << 32;
    const u64 *fresh = n->fresh;
    while (*fresh && *fresh != instruction)
        fresh++;
    if (!*fresh || *n->deadline <= *n->cycle)
        return 0;
    r->row = r->code->asked(r->camera, r->setting, (i64)*n->cycle, &r->href);
    if (r->row < 0 || !r->fans[r->row] || !settle(r))
        return 0;
    r->tick = r->taken + (i64)*n->noted;
    if (r->tick < g->ticks)
        return 0;
    r->stands = PAINTS;
    return 1;
}

// The line that is read, as `EmulatedBrain._pixels` and `Camera` have it.
static void paint(struct robot *r, const struct ground *g)
{
    i64 start = r->tick * r->quantum - r->on_at;
    const int16_t *noise = r->noise + (r->code->draw(r->generator) >> r->noise_shift);
    f64 quanta = (f64)(r->href - start) / (f64)r->quantum;
    *r->native->now = *r->native->cycle;
    const f64 *before = start > 0 ? g->before : g->now;
    const uint8_t *pixels = r->code->line(r->view, g->now, before, quanta, r->fans[r->row], r->colours, noise);
    if (r->first_strip <= r->row && r->row <= r->last_strip)
        r->strip = r->row;
    r->code->send(r->camera, r->href, pixels);
    *r->native->begins = 0; // the boundary before the instruction has been done
    r->stands = RUNS;
}

// Run a robot until it looks, or Python must go on with it.
static void run(struct robot *r, const struct ground *g)
{
    const struct native *n = r->native;
    if (r->stands == PAINTS)
        paint(r, g);
    while (r->stands == RUNS) {
        r->why = n->entry(n->record, n->env);
        if (r->why == n->interpret ? looks(r, g) : r->why == n->service && probe(r))
            continue;
        *n->begins = 1;
        r->stands = CAME_BACK;
    }
}

// Run robots of a round as long as there are some that nobody has. How many.
static i64 share(struct swarm *s)
{
    i64 left, runs = 0;
    while ((left = __atomic_fetch_sub(&s->left, 1, __ATOMIC_ACQ_REL)) > 0) {
        run(s->ready[left - 1], s->ground);
        runs++;
        __atomic_fetch_add(&s->through, 1, __ATOMIC_RELEASE);
    }
    return runs;
}

static void wait_a_little(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

// Let helpers look. One that is about to sleep sees the new number, or is seen.
static void call(struct swarm *s)
{
    __atomic_fetch_add(&s->rounds, 1, __ATOMIC_SEQ_CST);
    for (i64 i = 0; i < s->helpers; i++)
        if (__atomic_exchange_n(&s->helper[i].sleeps, 0, __ATOMIC_SEQ_CST))
            s->release(s->helper[i].lock);
}

// The life of a helper, a thread. A round does not wait for one that comes late.
void help(struct swarm *s, struct helper *h)
{
    i64 seen = 0, now;
    while (!__atomic_load_n(&s->is_over, __ATOMIC_SEQ_CST)) {
        for (i64 looks = 0; (now = __atomic_load_n(&s->rounds, __ATOMIC_SEQ_CST)) == seen && looks < PATIENCE; looks++)
            wait_a_little();
        if (now != seen) {
            seen = now;
            h->runs += share(s);
            continue;
        }
        __atomic_store_n(&h->sleeps, 1, __ATOMIC_SEQ_CST);
        if (__atomic_load_n(&s->rounds, __ATOMIC_SEQ_CST) == seen ||
            !__atomic_exchange_n(&h->sleeps, 0, __ATOMIC_SEQ_CST))
            s->acquire(h->lock, 1);
    }
}

// No helper is needed any more.
void dismiss(struct swarm *s)
{
    __atomic_store_n(&s->is_over, 1, __ATOMIC_SEQ_CST);
    call(s);
}

// Run all that run, or wait for poses that are there now.
static void run_ready(struct swarm *s)
{
    i64 among = 0;
    for (i64 i = 0; i < s->count; i++) {
        struct robot *r = s->robots[i];
        if (r->stands == RUNS || (r->stands == PAINTS && r->tick <= s->ground->ticks))
            s->ready[among++] = r;
    }
    if (!s->helpers || among < 2) {
        for (i64 i = 0; i < among; i++)
            run(s->ready[i], s->ground);
        return;
    }
    s->through = 0; // nobody has one of an earlier round any more
    __atomic_store_n(&s->left, among, __ATOMIC_RELEASE);
    call(s);
    share(s);
    while (__atomic_load_n(&s->through, __ATOMIC_ACQUIRE) < among)
        wait_a_little();
}

// Quanta that all robots have lived. 0: Python has something to do before.
static int go(struct ground *g, const struct swarm *s, i64 until)
{
    i64 count = until - g->ticks;
    if (count <= 0)
        return 1;
    if (until > g->until)
        return 0;
    g->quanta(g->world, s->speeds, s->room, g->ticks, count, g->wheels, g->row, g->numbers);
    g->before = count > 1 ? g->row + (count - 2) * g->numbers : g->now;
    g->now = g->row + (count - 1) * g->numbers;
    g->row += count * g->numbers;
    g->ticks = until;
    return 1;
}

// Run all until `goal` quanta are over, or until Python is needed: for the robot with the number that is returned, for
// the world.
i64 run_all(struct swarm *s, i64 goal)
{
    for (;;) {
        run_ready(s);
        i64 until = goal, waiting = 0;
        for (i64 i = 0; i < s->count; i++) {
            struct robot *r = s->robots[i];
            if (r->stands == CAME_BACK || (r->stands == LOOKS && r->tick <= s->ground->ticks)) {
                r->stands = AWAY;
                return i;
            }
            if (r->stands != AWAY && r->tick <= until)
                until = r->tick, waiting = 1;
        }
        s->wanted = until;
        if (!go(s->ground, s, until))
            return WORLD;
        if (!waiting)
            return OVER;
    }
}
