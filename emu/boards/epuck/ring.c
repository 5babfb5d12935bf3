// Levels of the eight infrared sensors (epuck.md §5, §10): ambient light, minus the own emitter's reflection times the
// settled share, minus external light, plus noise. Levels are in the unit of the ADC: counts << 4.
//
// A conversion is computed some time after the cycle in which it samples. An edge of a pulse line from native code
// therefore waits in `edges` until a conversion samples after it.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

extern f64 exp(f64);
extern f64 rint(f64);

enum { SENSORS = 8, LINES = 4, FIRST_CHANNEL = 8, FULL = 4095 };
enum { POINTS = 11 };            // of the response to a surface: distance in mm, counts, slope of their logarithm
enum { EDGES = 128, MANY = 64 }; // room for waiting edges, and number above which Python must apply them
static const f64 ROOT_3 = 1.73205080756887729353;

struct light; // both are defined by the provider of the external light
struct emission;

// The first eleven members are byte offsets in the machine's record. `native` points to `Pins.native_cell` of each line's
// port: the pins whose edges native code passes to `edge`. `past_*` apply before cycle `begin`.
struct ring {
    i64 ambient, reflection, lit, since, from, tau, seed, strength, edges, edge_count, native[LINES];
    i64 port[LINES], pin[LINES]; // port and mask of each pulse line
    f64 decayed; // Tcy after which a switch has no effect, at any clock
    f64 noise_counts, noise_share;
    i64 begin;
    uint16_t past_ambient[SENSORS], past_reflection[SENSORS];
    f64 (*outside)(const struct light *, i64 sensor, i64 cycle); // counts to subtract; null: none
    const struct light *light;
    i64 (*emit)(struct emission *, i64 line, i64 lit, i64 cycle); // host code for each edge; 0: the next is for Python
    struct emission *emission;
    f64 near[POINTS], counts[POINTS], slope[POINTS];
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

// Apply the waiting edges up to a cycle. Every pending conversion must sample at this cycle or later.
void apply_edges(uint8_t *record, const struct ring *r, i64 cycle)
{
    u64 *edges = (u64 *)(record + r->edges), *count = (u64 *)(record + r->edge_count), done = 0;
    for (; done < *count && (i64)(edges[done] >> 8) <= cycle; done++) {
        i64 line = edges[done] >> 1 & (LINES - 1), at = (i64)(edges[done] >> 8);
        ((uint16_t *)(record + r->from))[line] = (uint16_t)rint(settled(record, r, line, at) * 65535);
        ((i64 *)(record + r->since))[line] = at;
        record[r->lit + line] = edges[done] & 1;
    }
    if (!done)
        return;
    *count -= done;
    for (u64 i = 0; i < *count + done; i++)
        edges[i] = i < *count ? edges[i + done] : 0;
}

// Handle an edge on pins of a port for native code (Pins.handle_natively). The pins have `levels` from a cycle on.
i64 edge(uint8_t *record, const struct ring *r, i64 port, i64 changed, i64 levels, i64 cycle)
{
    u64 *edges = (u64 *)(record + r->edges), *count = (u64 *)(record + r->edge_count);
    int is_full = 0;
    for (i64 line = 0; line < LINES; line++) {
        if (r->port[line] != port || !(changed & r->pin[line]))
            continue;
        i64 lit = (levels & r->pin[line]) != 0;
        edges[(*count)++] = (u64)(cycle << 8 | line << 1 | lit);
        is_full |= !r->emit(r->emission, line, lit, cycle) || *count > MANY;
    }
    for (i64 line = 0; is_full && line < LINES; line++)
        *(u64 *)(record + r->native[line]) &= ~(u64)r->pin[line];
    return 0;
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

// Start a segment: reflections and ambient light set from now on apply to conversions that sample at `cycle` or later.
void start_segment(const uint8_t *record, struct ring *r, i64 cycle)
{
    r->begin = cycle;
    for (i64 sensor = 0; sensor < SENSORS; sensor++) {
        r->past_ambient[sensor] = ((const uint16_t *)(record + r->ambient))[sensor];
        r->past_reflection[sensor] = ((const uint16_t *)(record + r->reflection))[sensor];
    }
}

// Set the reflection of a sensor that faces a surface, as `reflection_at` of analog.py.
void reflect(uint8_t *record, const struct ring *r, i64 sensor, f64 millimetres, f64 share)
{
    f64 counts = r->counts[0];
    i64 after = 0;
    while (after < POINTS && r->near[after] < millimetres)
        after++;
    if (after == POINTS)
        counts = 0;
    else if (after)
        counts = r->counts[after - 1] * exp(r->slope[after - 1] * (millimetres - r->near[after - 1]));
    ((uint16_t *)(record + r->reflection))[sensor] = (uint16_t)rint(counts * share);
}

// Level of an ADC channel at a cycle, which must not precede that of the last call.
i64 level(uint8_t *record, const struct ring *r, i64 channel, i64 cycle)
{
    apply_edges(record, r, cycle);
    i64 sensor = channel - FIRST_CHANNEL, is_past = cycle < r->begin;
    const uint16_t *ambient = is_past ? r->past_ambient : (const uint16_t *)(record + r->ambient);
    const uint16_t *reflection = is_past ? r->past_reflection : (const uint16_t *)(record + r->reflection);
    f64 light = r->outside ? r->outside(r->light, sensor, cycle) : 0;
    f64 lowered = reflection[sensor] * settled(record, r, sensor % LINES, cycle);
    f64 deviation = r->noise_share * lowered > r->noise_counts ? r->noise_share * lowered : r->noise_counts;
    f64 raw = rint(ambient[sensor] - lowered - light + noise(record, r, channel, cycle, deviation));
    return (raw < 0 ? 0 : raw > FULL ? FULL : (i64)raw) << 4;
}
