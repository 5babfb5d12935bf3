// Light of other robots' emitters at an infrared sensor, for emu/boards/epuck/ring.c. channel.py has the histories of
// the emitters, propagation.py their strength at the sensors, ring.py loss, ripple and noise.

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
static const f64 TAU = 6.28318530717958647693;

// Changes of a robot's pulse lines: lit[0] before the first change, lit[n + 1] after change n; begun[n]: the cycle at
// which the transmission of change n began.
struct history {
    const i64 *cycles, *begun;
    const uint8_t *lit;
    i64 count, cached_at; // cached levels: at the cycle of a change
    f64 cached[LINES];
};

// Response of the receivers: a first-order low-pass with time constant `tau`, settled after `settled` cycles.
struct receivers {
    f64 tau;
    i64 settled;
};

// Number of changes at or before a cycle.
static i64 changes_by(const struct history *t, i64 cycle)
{
    i64 low = 0, high = t->count;
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

// Cache the levels at change `place`, from the changes shortly before it.
static void cache_levels(struct history *t, const struct receivers *r, i64 place)
{
    i64 first = changes_by(t, t->cycles[place] - r->settled);
    for (i64 line = 0; line < LINES; line++)
        t->cached[line] = steady(t->lit[first], line);
    for (i64 i = first; i < place; i++)
        settle(t->cached, t->lit[i + 1], t->cycles[i + 1] - t->cycles[i], r->tau);
    t->cached_at = t->cycles[place];
}

// Levels of the receivers at a cycle, for each line: 0 dark, 1 settled at full light.
void levels(struct history *t, const struct receivers *r, i64 cycle, f64 *found)
{
    i64 index = changes_by(t, cycle), age = index ? cycle - t->cycles[index - 1] : r->settled;
    if (age >= r->settled) {
        for (i64 line = 0; line < LINES; line++)
            found[line] = steady(t->lit[index], line);
        return;
    }
    if (t->cached_at != t->cycles[index - 1])
        cache_levels(t, r, index - 1);
    for (i64 line = 0; line < LINES; line++)
        found[line] = t->cached[line];
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
    struct history *history;
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
    i64 lost_seen, lost_period; // a lost transmission is seen for `lost_seen` cycles in each `lost_period`
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
