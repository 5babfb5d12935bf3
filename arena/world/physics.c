// Quanta of the world in a row: wheel speeds in, poses out. Chipmunk's own functions do the physics; this file sets the
// bodies before each step, by the rules of `World` (physics.py). Lengths cm, time s.

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
    void (*each_arbiter)(void *body, void (*visit)(void *body, void *arbiter, void *data), void *data);
    struct vect (*total_impulse)(const void *arbiter);
};

// A pushable body. Its two joints model friction on the floor. While its velocities and impulses are zero and no moving
// body is near, the joints are removed from the solver: the result is bit-identical. A push adds them again.
struct disc {
    void *body, *slide_joint, *spin_joint;
    f64 radius;
    struct vect checked_at; // position at the last check of its neighbours
    i64 is_checked, is_resting, can_rest;
};

// How the commanded values (left, right) move a robot: `Drive` of robot_kind.py.
struct drive {
    f64 axle; // distance between the wheels; 0: vibration motors
    f64 ahead, turn, leg_back, leg_aside;
    f64 thrust, thrust_torque, brake, brake_torque;
};

struct robot {
    void *body, *driven_body, *push_joint, *turn_joint; // pushed body, body that the drive moves; null joints: no slip
    const struct drive *drive;
    f64 bias[2], noise[2];
    i64 is_braked;
};

struct world {
    struct chipmunk c;
    void *space;
    f64 dt;
    i64 robot_count, object_count;
    struct robot *robots;
    struct disc *discs; // discs of the robots, then of the objects; for a polygon its circumscribed circle
    i64 steps;
    void **polygons; // bodies of the objects that are polygons
    i64 polygon_count;
    void (*solve)(const void *solver, void *space, f64 dt); // null: `step` has solved
    const void *solver;
};

// Distances in cm. Bodies whose edges are nearer than NEAR may touch before the next check. A body is checked again
// after it has moved by WAY, a third of NEAR, so two bodies approach by at most two thirds of NEAR between checks.
static const f64 NEAR = 3, WAY = 1;

// Steps between two searches for objects that can rest.
enum { REST_PERIOD = 64 };

// Write the pose of every body: x, y, heading of the robots, then x, y of the objects, then the headings of the polygons.
void read_poses(const struct world *w, f64 *out)
{
    for (i64 i = 0; i < w->robot_count; i++) {
        struct vect at = w->c.position(w->robots[i].body);
        *out++ = at.x, *out++ = at.y, *out++ = w->c.angle(w->robots[i].body);
    }
    for (i64 i = 0; i < w->object_count; i++) {
        struct vect at = w->c.position(w->discs[w->robot_count + i].body);
        *out++ = at.x, *out++ = at.y;
    }
    for (i64 i = 0; i < w->polygon_count; i++)
        *out++ = w->c.angle(w->polygons[i]);
}

// Limit the joints of a robot to the force of its drive or of its brakes.
static void set_grip(const struct world *w, const struct robot *r)
{
    if (!r->push_joint)
        return;
    const struct drive *d = r->drive;
    w->c.set_max_force(r->push_joint, r->is_braked ? d->brake : d->thrust);
    w->c.set_max_force(r->turn_joint, r->is_braked ? d->brake_torque : d->thrust_torque);
}

static f64 square(f64 x)
{
    return x * x;
}

static f64 distance_squared(struct vect one, struct vect other)
{
    return square(one.x - other.x) + square(one.y - other.y);
}

static int is_near(const struct disc *one, const struct disc *other)
{
    return distance_squared(one->checked_at, other->checked_at) <= square(one->radius + other->radius + NEAR);
}

static void wake(struct world *w, struct disc *d)
{
    d->is_resting = 0;
    w->c.add(w->space, d->slide_joint), w->c.add(w->space, d->spin_joint);
}

// Before a step: wake resting objects near a body that moves, and in turn the objects near those.
static void wake_neighbours(struct world *w)
{
    i64 count = w->robot_count + w->object_count, found = 1;
    while (found) {
        found = 0;
        for (i64 i = 0; i < count; i++) {
            struct disc *d = &w->discs[i];
            struct vect at = w->c.position(d->body), by = w->c.velocity(d->body);
            struct vect next = {at.x + by.x * w->dt, at.y + by.y * w->dt};
            i64 is_pushed = d->is_resting && (by.x != 0 || by.y != 0);
            if (d->is_checked && distance_squared(next, d->checked_at) <= WAY * WAY && !is_pushed)
                continue;
            d->checked_at = at, d->is_checked = 1;
            if (d->is_resting)
                wake(w, d);
            for (i64 k = w->robot_count; k < count; k++)
                if (w->discs[k].is_resting && is_near(d, &w->discs[k])) {
                    wake(w, &w->discs[k]);
                    w->discs[k].is_checked = 0; // its neighbours are checked in the next pass
                    found = 1;
                }
        }
    }
}

// Callback for `each_arbiter`: clear *data if the contact has an impulse.
static void find_impulse(void *body, void *arbiter, void *data)
{
    (void)body;
    const struct world *w = *(struct world **)data;
    struct vect impulse = w->c.total_impulse(arbiter);
    if (impulse.x != 0 || impulse.y != 0)
        *(struct world **)data = 0;
}

// Whether all velocities and impulses of an object are zero, so that the solver leaves it as it is.
static int is_still(struct world *w, const struct disc *d)
{
    struct vect by = w->c.velocity(d->body);
    if (by.x != 0 || by.y != 0 || w->c.turning(d->body) != 0 || w->c.impulse(d->slide_joint) != 0 ||
        w->c.impulse(d->spin_joint) != 0)
        return 0;
    struct world *none = w;
    w->c.each_arbiter(d->body, find_impulse, (void *)&none);
    return none != 0;
}

// Put to rest every object that is still and has only resting bodies near it.
static void put_to_rest(struct world *w)
{
    i64 count = w->robot_count + w->object_count, changed = 1;
    for (i64 i = w->robot_count; i < count; i++)
        w->discs[i].can_rest = !w->discs[i].is_resting && is_still(w, &w->discs[i]);
    while (changed) {
        changed = 0;
        for (i64 i = w->robot_count; i < count; i++) {
            if (!w->discs[i].can_rest)
                continue;
            for (i64 k = 0; k < count; k++) {
                const struct disc *other = &w->discs[k];
                if (!other->is_resting && !other->can_rest && is_near(&w->discs[i], other)) {
                    w->discs[i].can_rest = 0;
                    changed = 1;
                    break;
                }
            }
        }
    }
    for (i64 i = w->robot_count; i < count; i++)
        if (w->discs[i].can_rest) {
            w->discs[i].is_resting = 1;
            w->c.remove(w->space, w->discs[i].slide_joint), w->c.remove(w->space, w->discs[i].spin_joint);
        }
}

// Velocity of a body in its own frame, cm/s and rad/s.
struct twist {
    f64 ahead, aside, turn;
};

// Twist of a robot for its commanded values. A single vibration motor turns the robot about the leg on the other side.
static struct twist twist_of(const struct drive *d, f64 left, f64 right)
{
    if (d->axle > 0)
        return (struct twist){(left + right) / 2, 0, (right - left) / d->axle};
    f64 turn = d->turn * (left - right), leg = turn < 0 ? -d->leg_aside : d->leg_aside;
    return (struct twist){d->ahead * (left < right ? left : right) + turn * leg, turn * d->leg_back, turn};
}

// Run one quantum with the commanded values (left, right) of each robot.
void run_quantum(struct world *w, const f64 *wheels)
{
    for (i64 i = 0; i < w->robot_count; i++) {
        struct robot *r = &w->robots[i];
        f64 left = wheels[2 * i], right = wheels[2 * i + 1];
        i64 is_braked = left == 0 && right == 0;
        if (is_braked != r->is_braked) {
            r->is_braked = is_braked;
            set_grip(w, r);
        }
        left = left * r->noise[0] * r->bias[0], right = right * r->noise[1] * r->bias[1];
        struct twist by = twist_of(r->drive, left, right);
        f64 heading = w->c.angle(r->body) + by.turn * w->dt / 2, east = cos(heading), north = sin(heading);
        struct vect velocity = {by.ahead * east, by.ahead * north};
        if (by.aside != 0)
            velocity.x -= by.aside * north, velocity.y += by.aside * east;
        w->c.set_velocity(r->driven_body, velocity);
        w->c.set_turning(r->driven_body, by.turn);
    }
    wake_neighbours(w);
    if (++w->steps % REST_PERIOD == 0)
        put_to_rest(w);
    w->c.step(w->space, w->dt);
    if (w->solve)
        w->solve(w->solver, w->space, w->dt);
}

// Run `count` quanta from number `first` on. Speeds of robot r in quantum n: speeds[r] + 2 (n mod room). `wheels` is
// room for the speeds of one quantum; `out` gets the poses at the end of each, `width` numbers per quantum.
void run_quanta(struct world *w, const f64 *const *speeds, i64 room, i64 first, i64 count, f64 *wheels, f64 *out,
                i64 width)
{
    for (i64 n = first; n < first + count; n++, out += width) {
        for (i64 r = 0; r < w->robot_count; r++)
            wheels[2 * r] = speeds[r][2 * (n % room)], wheels[2 * r + 1] = speeds[r][2 * (n % room) + 1];
        run_quantum(w, wheels);
        read_poses(w, out);
    }
}
