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
    void *const *objects;
};

// Where everything is: x, y, heading of the robots, then x, y of the objects.
void poses(const struct world *w, f64 *out)
{
    for (i64 i = 0; i < w->robot_count; i++) {
        struct vect at = w->c.position(w->robots[i].body);
        *out++ = at.x, *out++ = at.y, *out++ = w->c.angle(w->robots[i].body);
    }
    for (i64 i = 0; i < w->object_count; i++) {
        struct vect at = w->c.position(w->objects[i]);
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
