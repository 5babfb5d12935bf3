// Renderer of a robot's camera. tests/arena/reference_camera.py is its specification in Python: the same arithmetic in
// the same order. Lengths cm.
//
// `set_viewpoint` collects the bodies in view for a pose, in the camera frame. The other functions cast rays.

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

extern f64 sin(f64);
extern f64 cos(f64);
extern f64 fabs(f64);
extern f64 sqrt(f64);
extern f64 rint(f64);

enum pixel_class { NOTHING, OBJECT, ROBOT, WALL, FLOOR, ABOVE }; // as in appearance.py

struct disc {
    f64 ahead, left, radius, height; // in a scene's list, `ahead` and `left` hold x and y
    i64 class;
    i64 leds;     // lit LEDs of a robot: bit n is LED n of `led_positions`, the next bit is the body LED
    f64 cos, sin; // cosine and sine of a robot's heading, in the camera frame
};

// Position of an LED on a robot's edge: direction from the centre (forward, left), lowest and highest point.
struct led {
    f64 forward, left, low, high;
};

struct side {
    f64 ax, ay, bx, by, height;
    i64 class;
    f64 range; // greatest distance at which it is visible
};

// A movable polygon: object number `object`, with corners (x, y) around its centre.
struct polygon {
    const f64 *corners;
    i64 count, object;
    f64 height;
    i64 class;
};

struct patch {
    f64 x, y, radius; // radius 0: a polygon
    const f64 *corners;
    i64 count, class;
};

// A camera in a scene. `set_viewpoint` sets the fields from `discs` on.
struct view {
    f64 camera_ahead, camera_height, wall_height, nearest;
    f64 width, height, range, widest, yaw; // width and height are infinite without walls
    i64 own, robots, objects, is_furnished;
    const i64 *lit; // lit LEDs of each robot; null if cameras do not see LEDs
    const struct led *led_positions;
    i64 led_count, led_class, body_class;
    f64 led_cos; // cosine of half the angle of the edge that an LED lights
    struct disc *robot_discs;
    const struct disc *object_discs;
    const struct disc *fixed;
    i64 fixed_count;
    const struct side *outlines;
    i64 outline_count;
    const struct patch *patches;
    i64 patch_count;
    struct disc *discs;
    i64 disc_count;
    struct side *sides;
    i64 side_count;
    const struct polygon *polygons;
    i64 polygon_count;
    f64 x, y, cos, sin;
};

// Rays with their results: the pixel class and the pixel of each. `brightness` are factors of the pixels, null for none.
struct rays {
    const f64 *left, *up;
    i64 count;
    f64 right_most, left_most;
    uint8_t *seen, *pixels;
    const f64 *brightness;
};

static int is_before(const struct disc *one, const struct disc *other)
{
    if (one->ahead != other->ahead)
        return one->ahead < other->ahead;
    if (one->left != other->left)
        return one->left < other->left;
    if (one->radius != other->radius)
        return one->radius < other->radius;
    if (one->height != other->height)
        return one->height < other->height;
    return one->class < other->class;
}

static void sort(struct disc *discs, i64 count)
{
    i64 gap = 1;
    while (gap < count / 3)
        gap = 3 * gap + 1;
    for (; gap; gap /= 3)
        for (i64 i = gap; i < count; i++) {
            struct disc one = discs[i];
            i64 place = i;
            for (; place >= gap && is_before(&one, &discs[place - gap]); place -= gap)
                discs[place] = discs[place - gap];
            discs[place] = one;
        }
}

// Add a disc if a ray of the picture can hit it within range.
static void add_disc(struct view *v, f64 x, f64 y, const struct disc *like)
{
    f64 dx = x - v->x, dy = y - v->y, radius = like->radius;
    f64 ahead = dx * v->cos + dy * v->sin;
    if (!(-radius < ahead && ahead < v->range + radius))
        return;
    f64 left = dy * v->cos - dx * v->sin;
    if (fabs(left) - 1.2 * radius < v->widest * (ahead + radius)) // 1.2: for the slope of a ray to the rim
        v->discs[v->disc_count++] =
            (struct disc){ahead, left, radius, like->height, like->class, like->leds, like->cos, like->sin};
}

// Add a side that may be in view, with its ends in the camera frame.
static void add_side(struct view *v, const struct side *one)
{
    f64 x1 = one->ax - v->x, y1 = one->ay - v->y, x2 = one->bx - v->x, y2 = one->by - v->y;
    struct side turned = {x1 * v->cos + y1 * v->sin, y1 * v->cos - x1 * v->sin, x2 * v->cos + y2 * v->sin,
                          y2 * v->cos - x2 * v->sin, one->height,               one->class, one->range};
    if (turned.ax > 0 || turned.bx > 0)
        v->sides[v->side_count++] = turned;
}

static void add_polygon(struct view *v, const struct polygon *one, const f64 *at, f64 heading)
{
    f64 c = cos(heading), s = sin(heading);
    const f64 *from = one->corners + 2 * (one->count - 1);
    for (const f64 *to = one->corners; to < one->corners + 2 * one->count; from = to, to += 2) {
        struct side side = {at[0] + c * from[0] - s * from[1], at[1] + s * from[0] + c * from[1],
                            at[0] + c * to[0] - s * to[1],     at[1] + s * to[0] + c * to[1],
                            one->height, one->class, v->range};
        add_side(v, &side);
    }
}

// Set the viewpoint to the own pose in `poses`, extrapolated by `quanta` of the motion since `before`. Both tables hold
// x, y, heading of the robots, then x, y of the objects, then headings of the polygons.
static void place_camera(struct view *v, const f64 *poses, const f64 *before, f64 quanta)
{
    const f64 *now = poses + 3 * v->own, *then = before + 3 * v->own;
    f64 x = now[0] + quanta * (now[0] - then[0]), y = now[1] + quanta * (now[1] - then[1]);
    f64 heading = now[2] + quanta * (now[2] - then[2]);
    v->cos = cos(heading), v->sin = sin(heading);
    v->x = x + v->camera_ahead * v->cos, v->y = y + v->camera_ahead * v->sin;
    if (v->yaw != 0)
        v->cos = cos(heading + v->yaw), v->sin = sin(heading + v->yaw);
}

static void collect_sides(struct view *v, const f64 *poses)
{
    const f64 *objects = poses + 3 * v->robots;
    v->side_count = 0;
    for (i64 i = 0; i < v->outline_count; i++)
        add_side(v, &v->outlines[i]);
    for (i64 i = 0; i < v->polygon_count; i++)
        add_polygon(v, &v->polygons[i], objects + 2 * v->polygons[i].object, objects[2 * v->objects + i]);
}

// Set the viewpoint (`place_camera`), and collect what is in view.
void set_viewpoint(struct view *v, const f64 *poses, const f64 *before, f64 quanta)
{
    place_camera(v, poses, before, quanta);
    v->disc_count = 0;
    const f64 *objects = poses + 3 * v->robots;
    for (i64 i = 0; i < v->objects; i++)
        if (v->object_discs[i].radius > 0)
            add_disc(v, objects[2 * i], objects[2 * i + 1], &v->object_discs[i]);
    for (i64 i = 0; i < v->robots; i++) {
        if (i == v->own)
            continue;
        struct disc *robot = &v->robot_discs[i];
        if (v->lit) {
            f64 c = cos(poses[3 * i + 2]), s = sin(poses[3 * i + 2]);
            robot->leds = v->lit[i];
            robot->cos = c * v->cos + s * v->sin, robot->sin = s * v->cos - c * v->sin;
        }
        add_disc(v, poses[3 * i], poses[3 * i + 1], robot);
    }
    sort(v->discs, v->disc_count);
    collect_sides(v, poses);
}

static int contains(const struct patch *patch, f64 x, f64 y)
{
    int inside = 0;
    for (i64 i = 0; i < patch->count; i++) {
        const f64 *one = patch->corners + 2 * i, *other = patch->corners + 2 * ((i + 1) % patch->count);
        if ((one[1] > y) != (other[1] > y) && x < one[0] + (y - one[1]) / (other[1] - one[1]) * (other[0] - one[0]))
            inside = !inside;
    }
    return inside;
}

// Class of the floor where a ray hits it: that of the last patch that covers the point.
static i64 floor_class(const struct view *v, f64 ray, f64 rise)
{
    i64 found = FLOOR;
    if (!v->patch_count)
        return found;
    f64 depth = -v->camera_height / rise;
    f64 x = v->x + depth * (v->cos - ray * v->sin), y = v->y + depth * (v->sin + ray * v->cos);
    for (i64 i = 0; i < v->patch_count; i++) {
        const struct patch *one = &v->patches[i];
        f64 dx = x - one->x, dy = y - one->y;
        if (one->count ? contains(one, x, y) : sqrt(dx * dx + dy * dy) < one->radius)
            found = one->class;
    }
    return found;
}

static f64 max(f64 one, f64 other)
{
    return one > other ? one : other;
}

static f64 min(f64 one, f64 other)
{
    return one < other ? one : other;
}

// Depth at which a ray hits a disc, negative if it does not; `a` is 1 + slope squared.
static f64 disc_depth(const struct view *v, const struct disc *disc, f64 slope, f64 a)
{
    f64 b = disc->ahead + slope * disc->left;
    f64 c = disc->ahead * disc->ahead + disc->left * disc->left - disc->radius * disc->radius;
    f64 root = b * b - a * c;
    if (!(root > 0) || !(b > 0))
        return -1;
    return max((b - sqrt(root)) / a, v->nearest);
}

// Depth at which a ray hits a side, negative if it does not.
static f64 side_depth(const struct view *v, const struct side *side, f64 slope)
{
    f64 across = (side->by - side->ay) - slope * (side->bx - side->ax);
    if (across == 0)
        return -1;
    f64 depth = (side->ax * (side->by - side->ay) - side->ay * (side->bx - side->ax)) / across;
    f64 part = (side->ax * slope - side->ay) / across;
    return depth > 0 && 0 <= part && part <= 1 ? max(depth, v->nearest) : -1;
}

// A fixed disc in the camera frame.
static struct disc in_camera_frame(const struct view *v, const struct disc *fixed)
{
    f64 dx = fixed->ahead - v->x, dy = fixed->left - v->y;
    struct disc found = *fixed;
    found.ahead = dx * v->cos + dy * v->sin, found.left = dy * v->cos - dx * v->sin;
    return found;
}

// Whether a ray with a slope from `right` to `left` may hit a disc; also true for some rays that miss it.
static int can_hit(const struct disc *disc, f64 right, f64 left)
{
    return disc->left - 1.1 * disc->radius <= left * disc->ahead &&
           disc->left + 1.1 * disc->radius >= right * disc->ahead;
}

// A pixel in progress: the slope upwards of its ray, the depth of the nearest hit so far, and the class seen there.
struct pixel {
    f64 rise, blocked;
    i64 seen;
};

// Record a hit if it is nearer than all before and the body is tall enough. Return whether it is.
static int occlude(const struct view *v, struct pixel *p, f64 depth, f64 height, i64 class)
{
    f64 z = v->camera_height + p->rise * depth;
    if (!(z <= height && depth < p->blocked))
        return 0;
    p->seen = z < 0 ? FLOOR : class;
    p->blocked = depth;
    return 1;
}

// Class of the point where a ray hits a robot with lit LEDs.
static i64 robot_class(const struct view *v, const struct disc *robot, f64 slope, f64 rise, f64 depth)
{
    f64 z = v->camera_height + rise * depth, ahead = depth - robot->ahead, left = slope * depth - robot->left;
    f64 forward = ahead * robot->cos + left * robot->sin, aside = left * robot->cos - ahead * robot->sin;
    for (i64 i = 0; i < v->led_count; i++) {
        const struct led *one = &v->led_positions[i];
        if (robot->leds >> i & 1 && one->low <= z && z <= one->high &&
            forward * one->forward + aside * one->left >= robot->radius * v->led_cos)
            return v->led_class;
    }
    return robot->leds >> v->led_count & 1 ? v->body_class : robot->class;
}

// Set the pixel class of each ray.
void classify_rays(const struct view *v, const struct rays *rays)
{
    int is_walled = v->width < __builtin_inf();
    f64 east = 1 / max(v->width - v->x, v->nearest), west = is_walled ? -1 / max(v->x, v->nearest) : 0;
    f64 north = 1 / max(v->height - v->y, v->nearest), south = is_walled ? -1 / max(v->y, v->nearest) : 0;
    f64 over = v->wall_height - v->camera_height;
    for (i64 i = 0; i < rays->count; i++) {
        f64 slope = rays->left[i], a = 1 + slope * slope, length = sqrt(a);
        f64 near = max(max(v->cos * east + -v->sin * east * slope, v->cos * west + -v->sin * west * slope),
                       max(v->sin * north + v->cos * north * slope, v->sin * south + v->cos * south * slope));
        near = min(near, 1 / v->nearest);
        struct pixel p = {rays->up[i], v->is_furnished ? 1 / max(near, 1e-12) : __builtin_inf(), WALL};
        if (p.rise > over * near || (!is_walled && p.rise == 0))
            p.seen = ABOVE;
        else if (p.rise < -v->camera_height * near)
            p.seen = FLOOR;
        for (i64 d = 0; d < v->disc_count; d++) {
            if (!can_hit(&v->discs[d], rays->right_most, rays->left_most))
                continue;
            f64 depth = disc_depth(v, &v->discs[d], slope, a);
            if (depth > 0 && depth * length <= v->range &&
                occlude(v, &p, depth, v->discs[d].height, v->discs[d].class) && v->discs[d].leds && p.seen != FLOOR)
                p.seen = robot_class(v, &v->discs[d], slope, p.rise, depth);
        }
        for (i64 d = 0; d < v->fixed_count; d++) {
            struct disc disc = in_camera_frame(v, &v->fixed[d]);
            f64 depth = disc_depth(v, &disc, slope, a);
            if (depth > 0)
                occlude(v, &p, depth, disc.height, disc.class);
        }
        for (i64 s = 0; s < v->side_count; s++) {
            f64 depth = side_depth(v, &v->sides[s], slope);
            if (depth > 0 && depth * length <= v->sides[s].range)
                occlude(v, &p, depth, v->sides[s].height, v->sides[s].class);
        }
        rays->seen[i] = (uint8_t)(p.seen == FLOOR ? floor_class(v, slope, p.rise) : p.seen);
    }
}

// Render a line of the picture from a pose and return its pixels. `noise` has one value per colour of each pixel.
const uint8_t *render_line(struct view *v, const f64 *poses, const f64 *before, f64 quanta, const struct rays *rays,
                    const int16_t *colours, const int16_t *noise)
{
    set_viewpoint(v, poses, before, quanta);
    classify_rays(v, rays);
    for (i64 i = 0; i < rays->count; i++)
        for (i64 c = 0; c < 3; c++) {
            i64 value = colours[3 * rays->seen[i] + c];
            if (rays->brightness)
                value = (i64)rint((f64)value * rays->brightness[i]);
            value += noise[3 * i + c];
            rays->pixels[3 * i + c] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
        }
    return rays->pixels;
}
