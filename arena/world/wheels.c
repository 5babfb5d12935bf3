// Motor steps of a robot to its wheel speeds, quantum after quantum.

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

// Step counts (left, right) of the last quanta are in a ring of `window`, speeds in one of `room`. `rates[n]` is the
// speed of one step in n quanta.
struct drive {
    i64 room, window, filled, newest;
    i64 *counts;
    const f64 *rates;
    f64 *speeds;
};

// Add the steps at the ends of `count` quanta from number `first` on, and compute the speeds in them.
void add_steps(struct drive *d, i64 first, i64 count, const i64 *steps)
{
    for (i64 i = 0; i < count; i++) {
        d->newest = (d->newest + 1) % d->window;
        if (d->filled < d->window)
            d->filled++;
        i64 oldest = (d->newest - (d->filled - 1) + d->window) % d->window;
        for (i64 side = 0; side < 2; side++) {
            i64 now = steps[2 * i + side];
            d->counts[2 * d->newest + side] = now;
            i64 made = now - d->counts[2 * oldest + side];
            d->speeds[2 * ((first + i) % d->room) + side] = (f64)made * d->rates[d->filled - 1];
        }
    }
}
