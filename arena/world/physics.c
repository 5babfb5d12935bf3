// Quanta of the world in a row: wheel speeds in, poses out. Chipmunk's own functions do the physics; what is set before
// each of its steps is `World`'s rule (world.py). Lengths cm, time s.

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

extern f64 sin(f64);
extern f64 cos(f64);

struct vect {
    f64 x, y;
};

// Functions of the physics library, by address.
struct chipmunk {
    void (*step)(void *space, f64 dt);
    void (*set_velocity)(void *body, struct vect velocity);
    void (*set_turning)(void *body, f64 speed);
    struct vect (*position)(const void *body);
    f64 (*angle)(const void *body);
    void (*set_max_force)(void *joint, f64 force);
    struct vect (*velocity)(const void *body);
    f64 (*turning)(const void *body);
    f64 (*impulse)(void *joint);
    void *(*add)(void *space, void *joint);
    void (*remove)(void *space, void *joint);
    void (*each_arbiter)(void *body, void (*tell)(void *body, void *arbiter, void *data), void *data);
    struct vect (*total_impulse)(const void *arbiter);
};

// A disc that can be pushed. The joints of an object are its friction on the floor. Where everything about it is zero
// they change nothing, to the bit, until something else touches it: then they are out of the solver.
struct disc {
    void *body, *grip, *hold;
    f64 radius;
    struct vect seen; // where it was when somebody last looked for what is near
    i64 is_known, rests, may_rest;
};

struct robot {
    void *body, *moved, *push, *turn; // what is pushed, what the wheels move; no joints: wheels that never slip
    f64 bias[2], noise[2];
    i64 rests;
};

struct world {
    struct chipmunk c;
    void *space;
    f64 dt, axle, thrust, thrust_turning, brake, brake_turning;
    i64 robot_count, object_count;
    struct robot *robots;
    struct disc *discs; // the robots', then the objects
    i64 steps;
};

// What is so near (edge to edge) may be touched before anybody looks again, which is when something has come half as far
// by more than the way of a third: so two of them come nearer by two thirds. cm
static const f64 NEAR = 3, WAY = 1;

// Steps between two looks for objects that may rest.
enum { PATIENCE = 64 };

// Where everything is: x, y, heading of the robots, then x, y of the objects.
void poses(const struct world *w, f64 *out)
{
    for (i64 i = 0; i < w->robot_count; i++) {
        struct vect at = w->c.position(w->robots[i].body);
        *out++ = at.x, *out++ = at.y, *out++ = w->c.angle(w->robots[i].body);
    }
    for (i64 i = 0; i < w->object_count; i++) {
        struct vect at = w->c.position(w->discs[w->robot_count + i].body);
        *out++ = at.x, *out++ = at.y;
    }
}

static void hold(const struct world *w, const struct robot *r)
{
    if (!r->push)
        return;
    w->c.set_max_force(r->push, r->rests ? w->brake : w->thrust);
    w->c.set_max_force(r->turn, r->rests ? w->brake_turning : w->thrust_turning);
}

static f64 square(f64 x)
{
    return x * x;
}

static f64 between(struct vect one, struct vect other)
{
    return square(one.x - other.x) + square(one.y - other.y);
}

static int is_near(const struct disc *one, const struct disc *other)
{
    return between(one->seen, other->seen) <= square(one->radius + other->radius + NEAR);
}

static void rouse(struct world *w, struct disc *d)
{
    d->rests = 0;
    w->c.add(w->space, d->grip), w->c.add(w->space, d->hold);
}

// Before a step: objects near something that moves get their joints back, and those near them.
static void look(struct world *w)
{
    i64 count = w->robot_count + w->object_count, found = 1;
    while (found) {
        found = 0;
        for (i64 i = 0; i < count; i++) {
            struct disc *d = &w->discs[i];
            struct vect at = w->c.position(d->body), by = w->c.velocity(d->body);
            struct vect next = {at.x + by.x * w->dt, at.y + by.y * w->dt};
            if (d->is_known && between(next, d->seen) <= WAY * WAY && !(d->rests && (by.x != 0 || by.y != 0)))
                continue;
            d->seen = at, d->is_known = 1;
            if (d->rests)
                rouse(w, d);
            for (i64 k = w->robot_count; k < count; k++)
                if (w->discs[k].rests && is_near(d, &w->discs[k])) {
                    rouse(w, &w->discs[k]);
                    w->discs[k].is_known = 0; // it looks for what is near itself
                    found = 1;
                }
        }
    }
}

static void add_up(void *body, void *arbiter, void *data)
{
    (void)body;
    const struct world *w = *(struct world **)data;
    struct vect impulse = w->c.total_impulse(arbiter);
    if (impulse.x != 0 || impulse.y != 0)
        *(struct world **)data = 0;
}

// Whether the solver leaves everything about an object as it is: zero.
static int is_still(struct world *w, const struct disc *d)
{
    struct vect by = w->c.velocity(d->body);
    if (by.x != 0 || by.y != 0 || w->c.turning(d->body) != 0 || w->c.impulse(d->grip) != 0 ||
        w->c.impulse(d->hold) != 0)
        return 0;
    struct world *none = w;
    w->c.each_arbiter(d->body, add_up, (void *)&none);
    return none != 0;
}

// Objects rest that are still, with nothing near that is awake and does not rest now, too.
static void settle(struct world *w)
{
    i64 count = w->robot_count + w->object_count, changed = 1;
    for (i64 i = w->robot_count; i < count; i++)
        w->discs[i].may_rest = !w->discs[i].rests && is_still(w, &w->discs[i]);
    while (changed) {
        changed = 0;
        for (i64 i = w->robot_count; i < count; i++) {
            if (!w->discs[i].may_rest)
                continue;
            for (i64 k = 0; k < count; k++) {
                const struct disc *other = &w->discs[k];
                if (!other->rests && !other->may_rest && is_near(&w->discs[i], other)) {
                    w->discs[i].may_rest = 0;
                    changed = 1;
                    break;
                }
            }
        }
    }
    for (i64 i = w->robot_count; i < count; i++)
        if (w->discs[i].may_rest) {
            w->discs[i].rests = 1;
            w->c.remove(w->space, w->discs[i].grip), w->c.remove(w->space, w->discs[i].hold);
        }
}

// One quantum with speeds (left, right) of each robot as commanded.
void quantum(struct world *w, const f64 *wheels)
{
    for (i64 i = 0; i < w->robot_count; i++) {
        struct robot *r = &w->robots[i];
        f64 left = wheels[2 * i], right = wheels[2 * i + 1];
        i64 rests = left == 0 && right == 0;
        if (rests != r->rests) {
            r->rests = rests;
            hold(w, r);
        }
        left = left * r->noise[0] * r->bias[0], right = right * r->noise[1] * r->bias[1];
        f64 turn = (right - left) / w->axle, ahead = (left + right) / 2;
        f64 heading = w->c.angle(r->body) + turn * w->dt / 2;
        w->c.set_velocity(r->moved, (struct vect){ahead * cos(heading), ahead * sin(heading)});
        w->c.set_turning(r->moved, turn);
    }
    look(w);
    if (++w->steps % PATIENCE == 0)
        settle(w);
    w->c.step(w->space, w->dt);
}

// Quanta in a row, from number `first` on. Speeds of robot r in quantum n: speeds[r] + 2 (n mod room). What `wheels` and
// `out` hold: speeds of one quantum, poses at the end of each, `numbers` of them.
void quanta(struct world *w, const f64 *const *speeds, i64 room, i64 first, i64 count, f64 *wheels, f64 *out,
            i64 numbers)
{
    for (i64 n = first; n < first + count; n++, out += numbers) {
        for (i64 r = 0; r < w->robot_count; r++)
            wheels[2 * r] = speeds[r][2 * (n % room)], wheels[2 * r + 1] = speeds[r][2 * (n % room) + 1];
        quantum(w, wheels);
        poses(w, out);
    }
}
