// Demand lock-step in native code: robots run ahead until they observe the world, and the world follows the slowest.
//
// This is the loop of scheduler.py. A robot's native code runs until a camera line is read, a quantum ends, the CPU is
// probed or infrared sensors need the poses of the next quantum; this file handles these four. For every other exit
// reason Python continues with the robot. Between two steps of the world, robots share only the histories of their
// emitters (light.c), of which others read complete changes only. So several threads can run them.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

// States of a robot, in this order: Python runs it, or it has reached the goal; it can run; it waits for the poses of a
// camera line; Python waits for its poses; its native code has returned with an exit reason for Python; its infrared
// sensors wait for the poses of a quantum.
enum { IN_PYTHON, RUNNABLE, AWAITS_LINE, AWAITS_POSES, RETURNED, AWAITS_QUANTUM };

// Results of `run_all` other than a robot's number.
enum { REACHED = -1, NEEDS_WORLD = -2 };

// Polls of an idle worker before it sleeps. They take longer than a step of the world.
enum { SPINS = 10000 };

// A machine (emu/system/native_handle.py).
struct native {
    i64 (*entry)(void *record, void *env);
    void *record, *env;
    u64 *begins, *limit, *last, *noted, *notes, *fresh, *cycle, *now, *deadline;
    uint32_t *pc;
    uint16_t *mode, *corcon;
    i64 room, interpret, service, awake, trap;
};

// Functions of other source files (line.c, motors.c, renderer.c, wheels.c, numpy's generator, light.c).
struct code {
    i64 (*row_due)(const void *camera, i64 setting, i64 cycle, i64 *href);
    void (*send_line)(const void *camera, i64 href, const uint8_t *pixels);
    const uint8_t *(*render_line)(void *view, const f64 *poses, const f64 *before, f64 quanta, const void *rays,
                                  const int16_t *colours, const int16_t *noise);
    i64 (*steps_by)(const void *pair, i64 now, const u64 *cycles, i64 count, i64 *steps);
    void (*add_steps)(void *drive, i64 first, i64 count, const i64 *steps);
    uint32_t (*draw)(void *generator);
    i64 (*begin_quantum)(void *sensing, const f64 *poses, i64 begin);
};

// A robot. Ticks count quanta since the start of the trial. Cycles count from power-on, at cycle `on_at` of the trial.
struct robot {
    i64 state, tick; // tick: quantum whose poses the robot waits for
    i64 exit_reason; // why the last call of native code returned
    struct native *native;
    const struct code *code;
    i64 quantum, on_at;
    i64 quanta_taken, quanta_reported; // quanta whose end Python has read; quanta whose motor steps the wheels have
    i64 end;                           // cycle at which native code returns to Python
    i64 probe_at, probes, busy_probes; // CPU probes: cycle of the next one; number; number that found the CPU awake
    i64 stuck_since;                   // cycle since which the firmware may be stuck; -1: it is not
    i64 probe_span, report_after;      // bound of the random time between two probes; quanta until steps are reported
    const void *camera;
    i64 data_port; // index of the register from which the picture is read
    void *view;
    const void *const *row_rays; // rays of each row of the picture, for one setting of the camera
    i64 camera_setting;
    i64 strip_first, strip_last, last_strip_row; // rows whose pixels are recorded; the last one rendered, -1: none
    const int16_t *colours, *noise;
    i64 noise_shift; // a random 32-bit number, shifted by this, is the index of a line's first noise value
    const void *pair;
    void *drive, *generator;
    i64 *steps;    // motor steps of the left and the right wheel in each quantum of a run
    i64 row, href; // picture row of the camera line that is to be rendered; cycle of its HREF
    void *sensing;
    i64 senses, sensed_tick; // whether infrared sensors were ever read; last quantum that `begin_quantum` has begun
};

// The world (physics.py).
struct native_world {
    void (*quanta)(void *world, const f64 *const *speeds, i64 room, i64 first, i64 count, f64 *wheels, f64 *out,
                   i64 width);
    void *world;
    f64 *wheels;
    i64 width, ticks, limit;
    f64 *row;
    const f64 *now, *before;
};

// A worker thread. Without work it blocks on `lock`, a lock of the Python runtime that needs no GIL.
struct worker {
    void *lock;
    i64 is_asleep, runs; // runs: robots it has run so far
};

struct scheduler {
    i64 count;
    struct robot *const *robots;
    const f64 *const *speeds;
    i64 room; // capacity of `speeds`, in quanta
    struct native_world *native_world;
    i64 world_goal; // tick to which Python must advance the world
    i64 worker_count;
    struct worker *workers;
    int (*acquire)(void *lock, int waits);
    void (*release)(void *lock);
    // The current round: runnable robots, how many of them no thread has claimed (0 or less: none), how many are done.
    struct robot **ready;
    i64 unclaimed, finished, round, is_stopping;
};

static i64 quantum_end(const struct robot *r, i64 tick)
{
    return (tick + 1) * r->quantum - r->on_at;
}

// The number that numpy's `integers(end)` would draw next: Lemire's method on 32 bits.
static i64 random_below(const struct robot *r, u64 end)
{
    for (;;) {
        u64 drawn = r->code->draw(r->generator) * end;
        if ((drawn & 0xFFFFFFFF) >= (1ULL << 32) % end)
            return (i64)(drawn >> 32);
    }
}

// Report the motor steps of finished quanta to the wheels. Return 0 if Python must first forward pin changes.
static int report_steps(struct robot *r)
{
    const struct native *n = r->native;
    i64 count = r->quanta_taken + (i64)*n->noted - r->quanta_reported;
    if (count <= 0)
        return 1;
    *n->now = *n->cycle;
    const u64 *ends = n->notes + (r->quanta_reported - r->quanta_taken);
    if (!r->pair || !r->code->steps_by(r->pair, (i64)*n->cycle, ends, count, r->steps))
        return 0;
    r->code->add_steps(r->drive, r->quanta_reported, count, r->steps);
    r->quanta_reported += count;
    return 1;
}

// Set the cycle at which native code returns to this file: the next CPU probe, the end of the run, or the end of the
// quantum if infrared sensors are read.
static void set_limit(const struct robot *r, i64 tick)
{
    const struct native *n = r->native;
    i64 last = r->probe_at < r->end ? r->probe_at : r->end, cut = quantum_end(r, tick);
    *n->last = (u64)(r->senses && cut < last ? cut : last);
    *n->limit = (u64)(cut < last ? cut : last);
    *n->begins = 1;
}

// At the limit: probe whether the CPU is awake, and wait for the poses of the next quantum, if these are due. Return 0
// if Python must continue: the limit is another one, or the firmware may be stuck.
static int pass_limit(struct robot *r)
{
    struct native *n = r->native;
    i64 now = (i64)*n->cycle, tick = r->quanta_taken + (i64)*n->noted;
    int awake = *n->mode == n->awake, is_probed = now >= r->probe_at, is_cut = r->senses && now >= quantum_end(r, tick);
    if (!*n->last || now < (i64)*n->last || !(is_probed || is_cut) || now >= r->end)
        return 0;
    if (*n->corcon & n->trap)
        return 0;
    for (; quantum_end(r, tick) <= now; tick++) {
        if ((i64)*n->noted == n->room)
            return 0;
        n->notes[(*n->noted)++] = (u64)now;
    }
    if ((is_cut || tick - r->quanta_reported >= r->report_after) && !report_steps(r))
        return 0;
    if (is_probed) {
        r->probes++, r->busy_probes += awake, r->stuck_since = -1;
        r->probe_at = now + 1 + random_below(r, (u64)r->probe_span);
    }
    if (is_cut)
        r->tick = tick, r->state = AWAITS_QUANTUM;
    else
        set_limit(r, tick);
    return 1;
}

// Begin the quantum whose poses the robot has awaited, unless Python must do so.
static void begin_quantum(struct robot *r, const struct native_world *g)
{
    const struct native *n = r->native;
    i64 begin = (i64)*n->cycle + 1;
    *n->begins = 1;
    r->state = RETURNED;
    if (r->tick < g->ticks || *n->deadline < (u64)begin)
        return;
    *n->now = *n->cycle;
    if (!r->code->begin_quantum(r->sensing, g->now, begin))
        return;
    r->sensed_tick = r->tick;
    r->state = RUNNABLE;
    set_limit(r, r->tick);
}

// Whether the next instruction reads a camera line that this file can render. If so, the robot waits for its poses.
static int wait_for_line(struct robot *r, const struct native_world *g)
{
    const struct native *n = r->native;
    u64 instruction = *n->pc | (u64)r->data_port << 32;
    const u64 *fresh = n->fresh;
    while (*fresh && *fresh != instruction)
        fresh++;
    if (!*fresh || *n->deadline <= *n->cycle)
        return 0;
    r->row = r->code->row_due(r->camera, r->camera_setting, (i64)*n->cycle, &r->href);
    if (r->row < 0 || !r->row_rays[r->row] || !report_steps(r))
        return 0;
    r->tick = r->quanta_taken + (i64)*n->noted;
    if (r->tick < g->ticks)
        return 0;
    r->state = AWAITS_LINE;
    return 1;
}

// Render the camera line that is read, as `FirmwareController._pixels` and `Camera` do.
static void render_line(struct robot *r, const struct native_world *g)
{
    i64 start = r->tick * r->quantum - r->on_at;
    const int16_t *noise = r->noise + (r->code->draw(r->generator) >> r->noise_shift);
    f64 quanta = (f64)(r->href - start) / (f64)r->quantum;
    *r->native->now = *r->native->cycle;
    const f64 *before = start > 0 ? g->before : g->now;
    const void *rays = r->row_rays[r->row];
    const uint8_t *pixels = r->code->render_line(r->view, g->now, before, quanta, rays, r->colours, noise);
    if (r->strip_first <= r->row && r->row <= r->strip_last)
        r->last_strip_row = r->row;
    r->code->send_line(r->camera, r->href, pixels);
    *r->native->begins = 0; // the boundary before the instruction has been executed
    r->state = RUNNABLE;
}

// Run a robot until it waits for poses or Python must continue with it.
static void run_robot(struct robot *r, const struct native_world *g)
{
    const struct native *n = r->native;
    if (r->state == AWAITS_LINE)
        render_line(r, g);
    if (r->state == AWAITS_QUANTUM)
        begin_quantum(r, g);
    while (r->state == RUNNABLE) {
        r->exit_reason = n->entry(n->record, n->env);
        if (r->exit_reason == n->interpret ? wait_for_line(r, g) : r->exit_reason == n->service && pass_limit(r))
            continue;
        *n->begins = 1;
        r->state = RETURNED;
    }
}

// Claim and run robots of the round until all are claimed. Return how many this thread has run.
static i64 run_share(struct scheduler *s)
{
    i64 unclaimed, runs = 0;
    while ((unclaimed = __atomic_fetch_sub(&s->unclaimed, 1, __ATOMIC_ACQ_REL)) > 0) {
        run_robot(s->ready[unclaimed - 1], s->native_world);
        runs++;
        __atomic_fetch_add(&s->finished, 1, __ATOMIC_RELEASE);
    }
    return runs;
}

static void spin_pause(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

// Announce a round to the workers. A worker that is about to sleep either sees the new number or is found asleep.
static void wake_workers(struct scheduler *s)
{
    __atomic_fetch_add(&s->round, 1, __ATOMIC_SEQ_CST);
    for (i64 i = 0; i < s->worker_count; i++)
        if (__atomic_exchange_n(&s->workers[i].is_asleep, 0, __ATOMIC_SEQ_CST))
            s->release(s->workers[i].lock);
}

// Main function of a worker thread. A round does not wait for a worker that wakes late.
void worker_main(struct scheduler *s, struct worker *w)
{
    i64 seen = 0, now;
    while (!__atomic_load_n(&s->is_stopping, __ATOMIC_SEQ_CST)) {
        for (i64 spin = 0; (now = __atomic_load_n(&s->round, __ATOMIC_SEQ_CST)) == seen && spin < SPINS; spin++)
            spin_pause();
        if (now != seen) {
            seen = now;
            w->runs += run_share(s);
            continue;
        }
        __atomic_store_n(&w->is_asleep, 1, __ATOMIC_SEQ_CST);
        if (__atomic_load_n(&s->round, __ATOMIC_SEQ_CST) == seen ||
            !__atomic_exchange_n(&w->is_asleep, 0, __ATOMIC_SEQ_CST))
            s->acquire(w->lock, 1);
    }
}

// Let all workers return from `worker_main`.
void stop_workers(struct scheduler *s)
{
    __atomic_store_n(&s->is_stopping, 1, __ATOMIC_SEQ_CST);
    wake_workers(s);
}

// Run every robot that is runnable, or that waits for poses already computed.
static void run_ready(struct scheduler *s)
{
    i64 count = 0;
    for (i64 i = 0; i < s->count; i++) {
        struct robot *r = s->robots[i];
        int awaits = r->state == AWAITS_LINE || r->state == AWAITS_QUANTUM;
        if (r->state == RUNNABLE || (awaits && r->tick <= s->native_world->ticks))
            s->ready[count++] = r;
    }
    if (!s->worker_count || count < 2) {
        for (i64 i = 0; i < count; i++)
            run_robot(s->ready[i], s->native_world);
        return;
    }
    s->finished = 0; // no thread still runs a robot of an earlier round
    __atomic_store_n(&s->unclaimed, count, __ATOMIC_RELEASE);
    wake_workers(s);
    run_share(s);
    while (__atomic_load_n(&s->finished, __ATOMIC_ACQUIRE) < count)
        spin_pause();
}

// Advance the world to tick `until`. Return 0 if Python must do so.
static int step_world(struct native_world *g, const struct scheduler *s, i64 until)
{
    i64 count = until - g->ticks;
    if (count <= 0)
        return 1;
    if (until > g->limit)
        return 0;
    g->quanta(g->world, s->speeds, s->room, g->ticks, count, g->wheels, g->row, g->width);
    g->before = count > 1 ? g->row + (count - 2) * g->width : g->now;
    g->now = g->row + (count - 1) * g->width;
    g->row += count * g->width;
    g->ticks = until;
    return 1;
}

// Run robots and world until `goal` quanta are over or Python is needed. Return the number of the robot that needs
// Python, NEEDS_WORLD or REACHED.
i64 run_all(struct scheduler *s, i64 goal)
{
    for (;;) {
        run_ready(s);
        i64 until = goal, is_waiting = 0;
        for (i64 i = 0; i < s->count; i++) {
            struct robot *r = s->robots[i];
            if (r->state == RETURNED || (r->state == AWAITS_POSES && r->tick <= s->native_world->ticks)) {
                r->state = IN_PYTHON;
                return i;
            }
            if (r->state != IN_PYTHON && r->tick <= until)
                until = r->tick, is_waiting = 1;
        }
        s->world_goal = until;
        if (!step_world(s->native_world, s, until))
            return NEEDS_WORLD;
        if (!is_waiting)
            return REACHED;
    }
}
