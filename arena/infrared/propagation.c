// Propagation of infrared light: from robot to robot, and the surface that a sensor faces. propagation.py explains the
// model; the tests have a reference implementation in Python. Lengths cm.

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

extern f64 atan2(f64, f64);
extern f64 cos(f64);
extern f64 exp(f64);
extern f64 fabs(f64);
extern f64 pow(f64, f64);
extern f64 sin(f64);
extern f64 sqrt(f64);

enum { SENSORS = 8, LINES = 4 };
enum { POINTS = 11, SIDE_RAYS = 7 }; // points of the response (ring.c); rays at most on each side of a sensor's axis
static const f64 PI = 3.14159265358979323846;

struct disc {
    f64 x, y, radius, share; // x and y are not set in `robots` and `objects`
};

struct side {
    f64 ax, ay, bx, by, share;
};

// A movable polygon: object number `object`, with corners (x, y) around its centre.
struct polygon {
    const f64 *corners;
    i64 count, object;
    f64 share;
};

struct optics {
    f64 law_counts, law_from, law_power, max_counts, min_counts; // as in propagation.py
    f64 gain, per_emitter, emitter_power, receiver_power;
    f64 width, height, wall_share, range; // width and height are infinite without walls
    f64 bearings[SENSORS];
    const struct disc *robots;
    const struct disc *objects;
    const struct disc *fixed;
    i64 fixed_count;
    const struct side *sides;
    i64 side_count;
    const struct polygon *polygons; // in the order of their headings in the poses; without corners if out of reach
    i64 polygon_count;
    i64 side_rays; // rays on each side of a sensor's axis, up to the angle `half_beam`
    f64 half_beam, near[POINTS], counts[POINTS], slope[POINTS];
};

// Poses of all bodies: x, y, heading of the robots, then x, y of the objects, then headings of the polygons.
struct poses {
    const f64 *values;
    i64 robots, objects;
};

// Disc number `number` of all: the robots, then the objects, then the round obstacles.
static struct disc disc_of(const struct optics *o, const struct poses *p, i64 number)
{
    if (number < p->robots) {
        struct disc robot = o->robots[number];
        robot.x = p->values[3 * number], robot.y = p->values[3 * number + 1];
        return robot;
    }
    number -= p->robots;
    if (number >= p->objects)
        return o->fixed[number - p->objects];
    struct disc object = o->objects[number];
    const f64 *place = p->values + 3 * p->robots + 2 * number;
    object.x = place[0], object.y = place[1];
    return object;
}

// Distance along a ray at which it hits a side, negative if it does not.
static f64 hit_distance(const struct side *s, f64 x, f64 y, f64 east, f64 north)
{
    f64 ex = s->bx - s->ax, ey = s->by - s->ay, across = east * ey - north * ex;
    if (across == 0)
        return -1;
    f64 along = ((s->ax - x) * ey - (s->ay - y) * ex) / across;
    f64 part = ((s->ax - x) * north - (s->ay - y) * east) / across;
    return along > 0 && 0 <= part && part <= 1 ? along : -1;
}

// A ray, and the nearest side that it hits: distance along it, and reflection.
struct ray {
    f64 x, y, east, north, distance, share;
};

static void offer_side(struct ray *ray, const struct side *one)
{
    f64 along = hit_distance(one, ray->x, ray->y, ray->east, ray->north);
    if (along < 0 || along >= ray->distance)
        return;
    f64 dx = one->bx - one->ax, dy = one->by - one->ay;
    ray->distance = along;
    ray->share = one->share * fabs((ray->east * dy - ray->north * dx) / sqrt(dx * dx + dy * dy));
}

// Intersect a ray with all sides of walls, polygonal obstacles and movable polygons.
static void offer_sides(const struct optics *o, const struct poses *p, struct ray *ray)
{
    for (i64 i = 0; i < o->side_count; i++)
        offer_side(ray, &o->sides[i]);
    const f64 *objects = p->values + 3 * p->robots, *headings = objects + 2 * p->objects;
    for (i64 i = 0; i < o->polygon_count; i++) {
        const struct polygon *one = &o->polygons[i];
        if (one->object >= p->objects || !one->count)
            continue;
        const f64 *at = objects + 2 * one->object, *from = one->corners + 2 * (one->count - 1);
        f64 c = cos(headings[i]), s = sin(headings[i]);
        for (const f64 *to = one->corners; to < one->corners + 2 * one->count; from = to, to += 2) {
            struct side side = {at[0] + c * from[0] - s * from[1], at[1] + s * from[0] + c * from[1],
                                at[0] + c * to[0] - s * to[1], at[1] + s * to[0] + c * to[1], one->share};
            offer_side(ray, &side);
        }
    }
}

// Whether a body or wall is between two robots.
static int is_occluded(const struct optics *o, const struct poses *p, i64 own, i64 other)
{
    const f64 *here = p->values + 3 * own, *there = p->values + 3 * other;
    f64 dx = there[0] - here[0], dy = there[1] - here[1], apart2 = dx * dx + dy * dy;
    for (i64 i = 0; i < p->robots + p->objects + o->fixed_count; i++) {
        if (i == own || i == other)
            continue;
        struct disc one = disc_of(o, p, i);
        f64 ox = one.x - here[0], oy = one.y - here[1], along = (ox * dx + oy * dy) / apart2;
        f64 aside_x = along * dx - ox, aside_y = along * dy - oy;
        if (0 < along && along < 1 && aside_x * aside_x + aside_y * aside_y < one.radius * one.radius)
            return 1;
    }
    struct ray ray = {here[0], here[1], dx, dy, 1, 0};
    offer_sides(o, p, &ray);
    return ray.distance < 1;
}

static f64 beam(f64 angle, f64 power)
{
    f64 facing = cos(angle);
    return facing > 0 ? pow(facing, power) : power == 0;
}

// Compute what robot `own` receives of another robot's light: counts of each pulse line, then shares of the own sensors.
// Return 0 if it receives nothing.
i64 signal(const struct optics *o, const struct poses *p, i64 own, i64 other, f64 *found)
{
    const f64 *here = p->values + 3 * own, *there = p->values + 3 * other;
    f64 dx = there[0] - here[0], dy = there[1] - here[1], beyond = sqrt(dx * dx + dy * dy) - o->law_from;
    f64 strength = beyond > 0 ? o->law_counts * pow(beyond, o->law_power) : o->max_counts;
    strength = o->gain * (strength < o->max_counts ? strength : o->max_counts);
    if (strength < o->min_counts || is_occluded(o, p, own, other))
        return 0;
    f64 towards = atan2(dy, dx);
    for (i64 line = 0; line < LINES; line++) {
        f64 back = towards + PI - there[2];
        found[line] = strength * o->per_emitter * (beam(back + o->bearings[line], o->emitter_power) +
                                                   beam(back + o->bearings[line + LINES], o->emitter_power));
    }
    for (i64 sensor = 0; sensor < SENSORS; sensor++)
        found[LINES + sensor] = beam(towards - here[2] + o->bearings[sensor], o->receiver_power);
    return 1;
}

static f64 wall_distance(f64 at, f64 direction, f64 size)
{
    if (direction == 0 || size == __builtin_inf())
        return __builtin_inf();
    return ((direction > 0 ? size : 0) - at) / direction;
}

// Compute what a ray hits: cm from the robot's edge, and reflection as a share of white paper's; infinity and 0 out of
// range.
static void cast(const struct optics *o, const struct poses *p, i64 own, f64 angle, f64 *found)
{
    const f64 *here = p->values + 3 * own;
    f64 x = here[0], y = here[1], east = cos(angle), north = sin(angle);
    f64 to_x = wall_distance(x, east, o->width), to_y = wall_distance(y, north, o->height);
    struct ray ray = {x, y, east, north, to_x < to_y ? to_x : to_y, 0};
    ray.share = o->wall_share * fabs(to_x < to_y ? east : north);
    offer_sides(o, p, &ray);
    f64 distance = ray.distance, share = ray.share;
    for (i64 i = 0; i < p->robots + p->objects + o->fixed_count; i++) {
        if (i == own)
            continue;
        struct disc one = disc_of(o, p, i);
        f64 dx = one.x - x, dy = one.y - y, along = dx * east + dy * north;
        f64 root = one.radius * one.radius - (dx * dx + dy * dy - along * along);
        if (root > 0 && along > 0 && along - sqrt(root) < distance) {
            distance = along - sqrt(root);
            share = one.share * sqrt(root) / one.radius;
        }
    }
    f64 radius = o->robots[own].radius, gap = distance - radius > 0 ? distance - radius : 0;
    found[0] = gap <= o->range ? gap : __builtin_inf();
    found[1] = gap <= o->range ? share : 0;
}

// Reflection of a white surface in counts, as `reflection_at` of analog.py.
static f64 response(const struct optics *o, f64 millimetres)
{
    i64 after = 0;
    while (after < POINTS && o->near[after] < millimetres)
        after++;
    if (after == POINTS)
        return 0;
    return after ? o->counts[after - 1] * exp(o->slope[after - 1] * (millimetres - o->near[after - 1])) : o->counts[0];
}

// Compute the surface that a sensor faces, as `cast`. Several rays become one surface at the distance of the nearest
// hit. Its share is the sum of their reflections, divided by that of a white wall across the axis there; at most 1.
static void surface(const struct optics *o, const struct poses *p, i64 own, i64 sensor, f64 *found)
{
    f64 axis = p->values[3 * own + 2] - o->bearings[sensor], nearest = __builtin_inf(), sum = 0, white = 0;
    f64 rays[2 * SIDE_RAYS + 1][2], radius = o->robots[own].radius;
    i64 sides = o->side_rays;
    if (!sides) {
        cast(o, p, own, axis, found);
        return;
    }
    for (i64 i = -sides; i <= sides; i++) {
        f64 *ray = rays[i + sides];
        cast(o, p, own, axis + o->half_beam * (f64)i / (f64)sides, ray);
        nearest = ray[0] < nearest ? ray[0] : nearest;
    }
    for (i64 i = -sides; i <= sides && nearest < __builtin_inf(); i++) {
        f64 facing = cos(o->half_beam * (f64)i / (f64)sides);
        white += facing * response(o, 10 * (i ? (radius + nearest) / facing - radius : nearest));
        sum += rays[i + sides][1] * response(o, 10 * rays[i + sides][0]);
    }
    found[0] = nearest, found[1] = white > 0 ? sum < white ? sum / white : 1 : 0;
}

// Compute `surface` for all sensors in turn.
void surfaces(const struct optics *o, const struct poses *p, i64 own, f64 *found)
{
    for (i64 sensor = 0; sensor < SENSORS; sensor++)
        surface(o, p, own, sensor, found + 2 * sensor);
}
