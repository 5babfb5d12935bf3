// Light of other robots' emitters at an infrared sensor, for emu/boards/epuck/ring.c. channel.py has the histories of
// the emitters, propagation.py their strength at the sensors, ring.py loss, ripple and noise. This file also
// updates all sensors of a robot at the start of a quantum.
//
// One thread appends to a history while others read older changes of it. So `count` includes complete changes only.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

extern f64 cos(f64);
extern f64 exp(f64);
extern f64 log(f64);
extern f64 sin(f64);
extern f64 sqrt(f64);

enum { LINES = 4, SENSORS = 8 };
enum { WAITING = 1 }; // state of an idle converter (emu/peripherals/adc/rules.py); higher ones sample and convert
static const f64 TAU = 6.28318530717958647693;

// Changes of a robot's pulse lines: lit[0] before the first change, lit[n + 1] after change n; begun[n]: the cycle at
// which the transmission of change n began; levels[LINES * n]: the receivers' levels at its cycle.
struct history {
    i64 *cycles, *begun;
    f64 *levels;
    uint8_t *lit;
    i64 room, count;
};

// Response of the receivers: a first-order low-pass with time constant `tau`, settled after `settled` cycles. After more
// than `gap` cycles of darkness, light is another transmission.
struct receivers {
    f64 tau;
    i64 settled;
    f64 gap;
};

static i64 count_of(const struct history *t)
{
    return __atomic_load_n(&t->count, __ATOMIC_ACQUIRE);
}

// Number of changes at or before a cycle.
i64 changes_by(const struct history *t, i64 cycle)
{
    i64 low = 0, high = count_of(t);
    while (low < high) {
        i64 middle = (low + high) / 2;
        if (t->cycles[middle] <= cycle)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static f64 steady(unsigned lit, i64 line)
{
    return lit >> line & 1;
}

// Advance the receivers' levels by `age` cycles; `lit`: bit mask of the emitter lines that are on.
static void settle(f64 *levels, unsigned lit, i64 age, f64 tau)
{
    f64 left = exp((f64)-age / tau);
    for (i64 line = 0; line < LINES; line++)
        levels[line] = steady(lit, line) + (levels[line] - steady(lit, line)) * left;
}

// Append a change: `line` is `lit` from a cycle on. Needs room for it. Return 0 if there is too little room for another
// change of each line.
i64 append(struct history *t, const struct receivers *r, i64 cycle, i64 line, i64 lit)
{
    i64 count = t->count, first = changes_by(t, cycle - r->settled);
    unsigned before = t->lit[count];
    int is_new = !count || (!before && (f64)(cycle - t->cycles[count - 1]) > r->gap);
    t->cycles[count] = cycle;
    t->begun[count] = is_new ? cycle : t->begun[count - 1];
    t->lit[count + 1] = (uint8_t)(lit ? before | 1U << line : before & ~(1U << line));
    f64 *levels = t->levels + LINES * count;
    for (i64 one = 0; one < LINES; one++)
        levels[one] = steady(t->lit[first], one);
    for (i64 i = first; i < count; i++)
        settle(levels, t->lit[i + 1], t->cycles[i + 1] - t->cycles[i], r->tau);
    __atomic_store_n(&t->count, count + 1, __ATOMIC_RELEASE);
    return count + 1 + LINES <= t->room;
}

// A robot's own light, for the native code of its board, which is powered on at cycle `on_at` of the trial.
struct emission {
    struct history *history;
    const struct receivers *receivers;
    i64 on_at;
};

// Append a change at a cycle of the board. Return 0 if Python must make room for the next one.
i64 emit(const struct emission *e, i64 line, i64 lit, i64 cycle)
{
    struct history *t = e->history;
    i64 at = e->on_at + cycle;
    i64 last = t->count ? t->cycles[t->count - 1] : -1;
    if (at < last || (at == last && (t->lit[t->count] >> line & 1) == lit))
        return 1; // a replay: the history already has this edge
    return append(t, e->receivers, at, line, lit);
}

// Whether other robots receive no light of a robot from cycle `first` to `last` of the trial.
i64 is_dark(const struct history *t, const struct receivers *r, i64 first, i64 last)
{
    i64 index = changes_by(t, last);
    return !t->lit[index] && (!index || t->cycles[index - 1] <= first - r->settled);
}

// Levels of the receivers at a cycle, for each line: 0 dark, 1 settled at full light.
void levels(const struct history *t, const struct receivers *r, i64 cycle, f64 *found)
{
    i64 index = changes_by(t, cycle), age = index ? cycle - t->cycles[index - 1] : r->settled;
    if (age >= r->settled) {
        for (i64 line = 0; line < LINES; line++)
            found[line] = steady(t->lit[index], line);
        return;
    }
    for (i64 line = 0; line < LINES; line++)
        found[line] = t->levels[LINES * (index - 1) + line];
    settle(found, t->lit[index], age, r->tau);
}

// Hash of a seed, channel and cycle to 64 bits, the same as in emu/boards/noise.py.
static u64 mixed(u64 seed, u64 channel, u64 cycle)
{
    u64 x = seed + (cycle << 8 | channel) * 0x9E3779B97F4A7C15;
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9;
    x = (x ^ x >> 27) * 0x94D049BB133111EB;
    return x ^ x >> 31;
}

static f64 gaussian(u64 seed, i64 channel, i64 cycle)
{
    u64 x = mixed(seed, (u64)channel, (u64)cycle);
    return sqrt(-2 * log((f64)((x >> 32) + 1) / 4294967296.0)) * cos(TAU / 4294967296.0 * (f64)(x & 0xFFFFFFFF));
}

static f64 uniform(u64 seed, i64 channel, i64 cycle)
{
    return (f64)(mixed(seed, (u64)channel, (u64)cycle) >> 11) / 9007199254740992.0;
}

// A robot whose light can arrive: counts of each of its lines, share of each own sensor.
struct source {
    f64 counts[LINES], shares[SENSORS];
    i64 robot;
    const struct history *history;
};

struct source_list {
    i64 count;
    const struct source *sources;
};

// The light at one robot. Its board is powered on at cycle `on_at` of the trial; light arrives `delay` cycles late. From
// cycle `begin` of the board the sources are `now`, before it `past`.
struct light {
    struct receivers receivers;
    i64 on_at, delay, begin;
    struct source_list now, past;
    f64 lost_share, ripple_counts, ripple, noise_counts;
    i64 lost_seen, lost_period; // a lost transmission is visible in the first `lost_seen` of every `lost_period` cycles
    u64 seed;
};

// Whether a transmission of another robot is lost here and invisible at this cycle.
static int is_lost(const struct light *l, const struct source *other, i64 now)
{
    const struct history *t = other->history;
    i64 then = now - l->delay, index = changes_by(t, then), begun = index ? t->begun[index - 1] : then;
    if ((then - begun) % l->lost_period < l->lost_seen)
        return 0;
    return uniform(l->seed + (u64)other->robot, SENSORS, begun) < l->lost_share;
}

// Counts by which the light lowers a sensor at a cycle of the board.
f64 light(const struct light *l, i64 sensor, i64 cycle)
{
    const struct source_list *m = cycle < l->begin ? &l->past : &l->now;
    i64 now = l->on_at + cycle;
    f64 sum = 0;
    for (const struct source *other = m->sources; other != m->sources + m->count; other++) {
        f64 lit[LINES], counts = 0;
        if (other->shares[sensor] == 0 || (l->lost_share != 0 && is_lost(l, other, now)))
            continue;
        levels(other->history, &l->receivers, now - l->delay, lit);
        for (i64 line = 0; line < LINES; line++)
            counts += other->counts[line] * lit[line];
        sum += other->shares[sensor] * counts;
    }
    if (l->ripple_counts != 0)
        sum += l->ripple_counts * sin(l->ripple * (f64)now);
    if (l->noise_counts != 0)
        sum += l->noise_counts * gaussian(l->seed, sensor, now);
    return sum;
}

// Poses of all bodies (propagation.c).
struct poses {
    const f64 *values;
    i64 robots, objects;
};

// The infrared sensors of robot number `robot` in the world. The functions are those of propagation.c and ring.c.
struct sensing {
    i64 (*signal)(const void *optics, const struct poses *poses, i64 own, i64 other, f64 *found);
    void (*surfaces)(const void *optics, const struct poses *poses, i64 own, f64 *found);
    void (*start_segment)(uint8_t *record, void *ring, i64 cycle);
    void (*reflect)(uint8_t *record, const void *ring, i64 sensor, f64 millimetres, f64 share);
    uint8_t *record;
    void *ring;
    const uint8_t *adc_state;         // state of the converter
    const u64 *adc_mark, *adc_frozen; // cycle at which this state began; cycle at which the converter's clock stopped
    const void *optics;
    struct poses *poses;
    struct light *light;
    const struct history *const *histories; // emitter histories of all robots
    struct source *banks[2];                // sources in this and in the last quantum, each with room for all robots
    i64 robot, quantum;
    i64 is_stale, has_lamps; // whether no sensor was converted in this quantum; whether room light depends on the pose
    i64 begin;               // cycle of the board at which this quantum begins
};

// Find the robots whose light can arrive in the quantum from cycle `begin` of the board on.
static void find_sources(struct sensing *s, i64 begin)
{
    struct light *l = s->light;
    struct source *bank = s->banks[1];
    i64 then = l->on_at + begin - l->delay, count = 0;
    s->banks[1] = s->banks[0], s->banks[0] = bank;
    for (i64 other = 0; other < s->poses->robots; other++) {
        if (other == s->robot || is_dark(s->histories[other], &l->receivers, then, then + s->quantum))
            continue;
        if (!s->signal(s->optics, s->poses, s->robot, other, bank[count].counts))
            continue;
        bank[count].robot = other, bank[count].history = s->histories[other];
        count++;
    }
    l->begin = begin, l->past = l->now;
    l->now.count = count, l->now.sources = bank;
}

// Set the reflections and the light of other robots from cycle `begin` of the board on.
void sense(struct sensing *s, i64 begin)
{
    f64 found[2 * SENSORS];
    s->surfaces(s->optics, s->poses, s->robot, found);
    for (i64 sensor = 0; sensor < SENSORS; sensor++)
        s->reflect(s->record, s->ring, sensor, 10 * found[2 * sensor], found[2 * sensor + 1]);
    find_sources(s, begin);
    s->is_stale = 0;
}

// Begin a quantum with these poses at cycle `begin` of the board, as InfraredRing.begin_quantum. Return 0 without any
// effect if Python must do so.
i64 begin_quantum(struct sensing *s, const f64 *poses, i64 begin)
{
    int is_pending = *s->adc_state > WAITING && *s->adc_frozen == UINT64_MAX;
    if (!is_pending && s->is_stale) {
        s->begin = begin;
        return 1;
    }
    if (!is_pending || s->is_stale || s->has_lamps || (i64)*s->adc_mark < s->begin)
        return 0;
    s->begin = begin, s->poses->values = poses;
    s->start_segment(s->record, s->ring, begin);
    sense(s, begin);
    return 1;
}
