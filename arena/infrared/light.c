// Light of other robots' emitters as a sensor sees it, for the sensors of the ring (emu/boards/epuck/ring.c): what was
// switched when (ether.py), what of it reaches whom (optics.py), and what infrared.py adds to it.

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

// A robot's pulse lines: lit[0] before the first switch, lit[n + 1] behind switch n; when its transmission began.
struct track {
    const i64 *cycles, *begun;
    const uint8_t *lit;
    i64 count, known; // the cycle of a switch, and how far receivers had followed in it
    f64 followed[LINES];
};

// How receivers follow: first order; what is longer ago is forgotten.
struct receivers {
    f64 tau;
    i64 settled;
};

// Switches at or before a cycle.
static i64 switches_by(const struct track *t, i64 cycle)
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

static void follow(f64 *shares, unsigned lit, i64 age, f64 tau)
{
    f64 left = exp((f64)-age / tau);
    for (i64 line = 0; line < LINES; line++)
        shares[line] = steady(lit, line) + (shares[line] - steady(lit, line)) * left;
}

// How far receivers had followed when a switch was made, from those shortly before it.
static void follow_to(struct track *t, const struct receivers *r, i64 place)
{
    i64 first = switches_by(t, t->cycles[place] - r->settled);
    for (i64 line = 0; line < LINES; line++)
        t->followed[line] = steady(t->lit[first], line);
    for (i64 i = first; i < place; i++)
        follow(t->followed, t->lit[i + 1], t->cycles[i + 1] - t->cycles[i], r->tau);
    t->known = t->cycles[place];
}

// Of each line how far receivers have followed it in a cycle.
void shares(struct track *t, const struct receivers *r, i64 cycle, f64 *found)
{
    i64 index = switches_by(t, cycle), age = index ? cycle - t->cycles[index - 1] : r->settled;
    if (age >= r->settled) {
        for (i64 line = 0; line < LINES; line++)
            found[line] = steady(t->lit[index], line);
        return;
    }
    if (t->known != t->cycles[index - 1])
        follow_to(t, r, index - 1);
    for (i64 line = 0; line < LINES; line++)
        found[line] = t->followed[line];
    follow(found, t->lit[index], age, r->tau);
}

// 64 bits of a seed, channel and cycle, as emu/boards/noise.py has them.
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

// A robot whose light may arrive: counts of each of its lines, shares of the own sensors.
struct heard {
    f64 counts[LINES], shares[SENSORS];
    i64 robot;
    struct track *track;
};

struct moment {
    i64 count;
    const struct heard *heard;
};

// What shines on a robot. Its board's cycles are `on_at` behind, light is `late`; before cycle `begin` it was `past`.
struct light {
    struct receivers receivers;
    i64 on_at, late, begin;
    struct moment now, past;
    f64 lost_share, ripple_counts, ripple, noise_counts;
    i64 lost_seen, lost_period; // cycles: of a lost transmission so many are seen, in each so many
    u64 seed;
};

// Whether another robot's transmission is lost here, and this is not one of the moments in which it is seen.
static int misses(const struct light *l, const struct heard *other, i64 now)
{
    const struct track *t = other->track;
    i64 then = now - l->late, index = switches_by(t, then), begun = index ? t->begun[index - 1] : then;
    if ((then - begun) % l->lost_period < l->lost_seen)
        return 0;
    return uniform(l->seed + (u64)other->robot, SENSORS, begun) < l->lost_share;
}

// Counts taken off a sensor in a cycle of the board.
f64 light(const struct light *l, i64 sensor, i64 cycle)
{
    const struct moment *m = cycle < l->begin ? &l->past : &l->now;
    i64 now = l->on_at + cycle;
    f64 sum = 0;
    for (const struct heard *other = m->heard; other != m->heard + m->count; other++) {
        f64 lit[LINES], counts = 0;
        if (other->shares[sensor] == 0 || (l->lost_share != 0 && misses(l, other, now)))
            continue;
        shares(other->track, &l->receivers, now - l->late, lit);
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
