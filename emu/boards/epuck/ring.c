// Levels of the eight infrared sensors (epuck.md §5, §10): ambient light, minus the own emitter's reflection times the
// settled share, minus external light, plus noise. Levels are in the unit of the ADC: counts << 4.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

extern f64 exp(f64);
extern f64 rint(f64);

enum { SENSORS = 8, LINES = 4, FIRST_CHANNEL = 8, FULL = 4095 };
static const f64 ROOT_3 = 1.73205080756887729353;

struct light; // defined by the provider of the external light

// The first eight members are byte offsets in the machine's record. `past_*` apply before cycle `begin`.
struct ring {
    i64 ambient, reflection, lit, since, from, tau, seed, strength;
    f64 decayed; // Tcy after which a switch has no effect, at any clock
    f64 noise_counts, noise_share;
    i64 begin;
    uint16_t past_ambient[SENSORS], past_reflection[SENSORS];
    f64 (*outside)(const struct light *, i64 sensor, i64 cycle); // counts to subtract; null: none
    const struct light *light;
};

// Settled share of a line's receivers at a cycle, 0 to 1.
f64 settled(const uint8_t *record, const struct ring *r, i64 line, i64 cycle)
{
    f64 target = record[r->lit + line] ? 1 : 0, tau = *(const f64 *)(record + r->tau);
    i64 age = cycle - ((const i64 *)(record + r->since))[line];
    if ((f64)age > r->decayed)
        return target;
    f64 start = ((const uint16_t *)(record + r->from))[line] / 65535.0;
    return target + (start - target) * exp((f64)(age > 0 ? -age : 0) / tau);
}

// Noise of a channel at a cycle with a standard deviation; equal to emu/boards/noise.py.
static f64 noise(const uint8_t *record, const struct ring *r, i64 channel, i64 cycle, f64 deviation)
{
    u64 strength = *(const u64 *)(record + r->strength);
    if (!strength)
        return 0;
    u64 x = *(const u64 *)(record + r->seed) + ((u64)cycle << 8 | (u64)channel) * 0x9E3779B97F4A7C15;
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9;
    x = (x ^ x >> 27) * 0x94D049BB133111EB;
    x ^= x >> 31;
    u64 sum = (x & 0xFFFF) + (x >> 16 & 0xFFFF) + (x >> 32 & 0xFFFF) + (x >> 48);
    return ((f64)sum / 65536.0 - 2) * ROOT_3 * deviation * ((f64)strength / 65536.0);
}

// Level of an ADC channel at a cycle.
i64 level(const uint8_t *record, const struct ring *r, i64 channel, i64 cycle)
{
    i64 sensor = channel - FIRST_CHANNEL, is_past = cycle < r->begin;
    const uint16_t *ambient = is_past ? r->past_ambient : (const uint16_t *)(record + r->ambient);
    const uint16_t *reflection = is_past ? r->past_reflection : (const uint16_t *)(record + r->reflection);
    f64 light = r->outside ? r->outside(r->light, sensor, cycle) : 0;
    f64 lowered = reflection[sensor] * settled(record, r, sensor % LINES, cycle);
    f64 deviation = r->noise_share * lowered > r->noise_counts ? r->noise_share * lowered : r->noise_counts;
    f64 raw = rint(ambient[sensor] - lowered - light + noise(record, r, channel, cycle, deviation));
    return (raw < 0 ? 0 : raw > FULL ? FULL : (i64)raw) << 4;
}
