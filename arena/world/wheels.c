// Steps of a robot's motors to the speeds of its wheels, quantum after quantum.

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

// Counts (left, right) of the last quanta lie in a ring of `most`, speeds in one of `room`; `rates` makes a speed of the
// steps of n quanta.
struct drive {
    i64 room, most, filled, newest;
    i64 *counts;
    const f64 *rates;
    f64 *speeds;
};

void turned(struct drive *d, i64 first, i64 count, const i64 *steps)
{
    for (i64 i = 0; i < count; i++) {
        d->newest = (d->newest + 1) % d->most;
        if (d->filled < d->most)
            d->filled++;
        i64 oldest = (d->newest - (d->filled - 1) + d->most) % d->most;
        for (i64 side = 0; side < 2; side++) {
            i64 now = steps[2 * i + side];
            d->counts[2 * d->newest + side] = now;
            i64 made = now - d->counts[2 * oldest + side];
            d->speeds[2 * ((first + i) % d->room) + side] = (f64)made * d->rates[d->filled - 1];
        }
    }
}
