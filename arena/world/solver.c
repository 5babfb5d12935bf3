// The impulse solver of a step: the same calls in the same order as Chipmunk's loop, without those that change nothing.
//
// An iteration of Chipmunk calls every contact (arbiter) and every joint. Most calls find their bodies as they left
// them, in a state in which they change nothing: a drive that has its speed, an object that lies still. Such a call is
// a function of the velocities of its bodies and of its accumulated impulses only. So a call that has changed neither
// is omitted until another one changes those velocities, and the results are the same to the bit.

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

// The beginnings of structs of the physics library (chipmunk_structs.h), up to the last field that is used here.
struct array {
    int32_t count, room;
    void **items;
};

struct body {
    void *functions[2];
    f64 mass[4], centre[2], position[2];
    u64 velocity[2]; // bit patterns: they are only compared
    f64 force[2], angle;
    u64 turning;
    f64 torque, transform[6];
    void *user_data;
    u64 bias_velocity[2], bias_turning;
};

struct joint;

struct joint_class {
    void (*pre_step)(struct joint *joint, f64 dt);
    void (*apply_cached)(struct joint *joint, f64 share);
    void (*apply)(struct joint *joint, f64 dt);
};

struct joint {
    const struct joint_class *functions;
    void *space;
    struct body *one, *other;
    void *next[2];
    f64 max_force, error_bias, max_bias;
    uint8_t collides;
    void *callbacks[2], *user_data;
    union {
        struct {
            f64 anchors[4], arms[4], matrix[4];
            u64 impulse[2];
        } pivot;
        struct {
            f64 phase, ratio, inverse, moment, bias;
            u64 impulse;
        } gear;
    };
};

struct contact {
    f64 arms[4], mass[2], bounce;
    u64 impulse[3]; // normal, tangential, of the pseudo-velocities
    f64 bias;
    u64 hash;
};

struct arbiter {
    f64 elasticity, friction, surface[2];
    void *data, *shapes[2];
    struct body *one, *other;
    void *threads[4];
    int32_t count;
    struct contact *contacts;
};

struct space {
    int32_t iterations;
    f64 settings[7];
    uint32_t persistence;
    void *user_data;
    uint32_t stamp;
    f64 dt;
    struct array *bodies[4];
    u64 shape_count;
    void *shapes[2];
    struct array *joints, *arbiters;
};

// What a contact or a joint has left behind when it changed nothing: the velocities of its bodies.
struct settled {
    i64 is_settled;
    u64 velocities[12];
};

struct solver {
    void (*apply_arbiter)(struct arbiter *arbiter);
    const struct joint_class *pivot; // class of the joints that hold a point; all others hold an angle
    i64 iterations, room;            // room: capacity of `settled`
    struct settled *settled;         // contacts, then joints
};

static void read_body(const struct body *body, u64 *out)
{
    out[0] = body->velocity[0], out[1] = body->velocity[1], out[2] = body->turning;
    out[3] = body->bias_velocity[0], out[4] = body->bias_velocity[1], out[5] = body->bias_turning;
}

static int are_equal(const u64 *one, const u64 *other, i64 count)
{
    u64 difference = 0;
    for (i64 i = 0; i < count; i++)
        difference |= one[i] ^ other[i];
    return !difference;
}

// Apply a contact. Return whether it has changed anything. Its impulses are compared one contact point after the other.
static int apply_arbiter(const struct solver *s, struct arbiter *arbiter, struct settled *settled)
{
    enum { POINTS = 2 }; // the library makes no more
    u64 before[12], after[12], impulses[POINTS][3];
    read_body(arbiter->one, before), read_body(arbiter->other, before + 6);
    if (settled->is_settled && are_equal(before, settled->velocities, 12))
        return 0;
    for (i64 i = 0; i < arbiter->count && i < POINTS; i++)
        for (i64 k = 0; k < 3; k++)
            impulses[i][k] = arbiter->contacts[i].impulse[k];
    s->apply_arbiter(arbiter);
    read_body(arbiter->one, after), read_body(arbiter->other, after + 6);
    int is_same = arbiter->count <= POINTS && are_equal(before, after, 12);
    for (i64 i = 0; i < arbiter->count && is_same; i++)
        is_same = are_equal(impulses[i], arbiter->contacts[i].impulse, 3);
    settled->is_settled = is_same;
    for (i64 i = 0; i < 12; i++)
        settled->velocities[i] = before[i];
    return !is_same;
}

// Apply a joint. Return whether it has changed anything. The first body of a joint is static or moves as commanded, so
// only the second one's velocity can change.
static int apply_joint(const struct solver *s, struct joint *joint, struct settled *settled, f64 dt)
{
    const struct body *body = joint->other;
    u64 *seen = settled->velocities;
    u64 before[3] = {body->velocity[0], body->velocity[1], body->turning};
    int is_pivot = joint->functions == s->pivot;
    if (settled->is_settled && before[2] == seen[2] && (!is_pivot || (before[0] == seen[0] && before[1] == seen[1])))
        return 0;
    u64 *impulse = is_pivot ? joint->pivot.impulse : &joint->gear.impulse;
    u64 first = impulse[0], second = is_pivot ? impulse[1] : 0;
    joint->functions->apply(joint, dt);
    int is_same = before[0] == body->velocity[0] && before[1] == body->velocity[1] && before[2] == body->turning &&
                  first == impulse[0] && (!is_pivot || second == impulse[1]);
    settled->is_settled = is_same;
    seen[0] = before[0], seen[1] = before[1], seen[2] = before[2];
    return !is_same;
}

// Run all iterations of a step, which the library has done up to its own (it was told to make none).
void solve(const struct solver *s, struct space *space, f64 dt)
{
    struct settled none;
    i64 arbiters = space->arbiters->count, joints = space->joints->count;
    for (i64 i = 0; i < arbiters + joints && i < s->room; i++)
        s->settled[i].is_settled = 0;
    for (i64 n = 0; n < s->iterations; n++) {
        int has_changed = 0;
        for (i64 i = 0; i < arbiters + joints; i++) {
            struct settled *settled = i < s->room ? &s->settled[i] : &none;
            none.is_settled = 0;
            if (i < arbiters)
                has_changed |= apply_arbiter(s, space->arbiters->items[i], settled);
            else
                has_changed |= apply_joint(s, space->joints->items[i - arbiters], settled, dt);
        }
        if (!has_changed)
            return;
    }
}
