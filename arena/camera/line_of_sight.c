// Line-of-sight sensor: the votes of some pixels near the middle of the picture. Compiled together with renderer.c.
// `ReferenceCamera.column` in tests/arena/reference_camera.py is its specification: the same arithmetic for each ray.
//
// A grid over the bodies lets a look test only the bodies near its rays, nearest first, until every ray has ended.

enum { WINDOW = 24 }; // maximum number of rays of a look

// Cells over the centres of all bodies: robots, then objects. Cell n has the bodies numbers[first[n]] to
// numbers[first[n + 1] - 1]. visited[n] is the last look that tested them.
struct grid {
    f64 left, low, cell;    // lower left corner, length of a side
    f64 radius, height;     // of the largest and of the highest body
    i64 columns, rows, robots, bodies, looks;
    i64 *first, *numbers, *visited;
};

static const f64 *centre(const struct grid *g, const f64 *poses, i64 body)
{
    return body < g->robots ? poses + 3 * body : poses + 3 * g->robots + 2 * (body - g->robots);
}

// Return a number as an index from 0 to `end`; 0 if it is not a number.
static i64 clamped(f64 value, i64 end)
{
    return value > (f64)end ? end : value > 0 ? (i64)value : 0;
}

static i64 cell_at(const struct grid *g, const f64 *place)
{
    i64 column = clamped((place[0] - g->left) / g->cell, g->columns - 1);
    return clamped((place[1] - g->low) / g->cell, g->rows - 1) * g->columns + column;
}

// Sort the bodies into cells, at most two cells per body and one more; into one cell if their extent is not a finite
// number.
void fill_grid(struct grid *g, const f64 *poses, i64 robots, i64 objects)
{
    g->robots = robots, g->bodies = robots + objects;
    g->columns = g->rows = 0;
    if (!g->bodies)
        return;
    f64 right = -__builtin_inf(), high = right;
    g->left = g->low = __builtin_inf();
    for (i64 i = 0; i < g->bodies; i++) {
        const f64 *place = centre(g, poses, i);
        g->left = min(g->left, place[0]), right = max(right, place[0]);
        g->low = min(g->low, place[1]), high = max(high, place[1]);
    }
    f64 width = right - g->left, depth = high - g->low, count = (f64)g->bodies;
    g->cell = max(max(sqrt(width * depth / count), (width + depth) / count), 2 * g->radius);
    g->columns = g->rows = 1;
    if (width < __builtin_inf() && depth < __builtin_inf() && g->cell < __builtin_inf())
        g->columns += (i64)(width / g->cell), g->rows += (i64)(depth / g->cell);
    i64 cells = g->columns * g->rows;
    for (i64 i = 0; i <= cells; i++)
        g->first[i] = 0;
    for (i64 i = 0; i < g->bodies; i++)
        g->first[cell_at(g, centre(g, poses, i))]++;
    for (i64 i = 1; i <= cells; i++)
        g->first[i] += g->first[i - 1];
    for (i64 i = g->bodies - 1; i >= 0; i--)
        g->numbers[--g->first[cell_at(g, centre(g, poses, i))]] = i;
}

static f64 wall_depth(const struct view *v, f64 slope)
{
    f64 east = v->cos - slope * v->sin, north = v->sin + slope * v->cos, inf = __builtin_inf();
    if (v->width == inf)
        return inf;
    f64 to_x = east > 0 ? (v->width - v->x) / east : east < 0 ? -v->x / east : inf;
    f64 to_y = north > 0 ? (v->height - v->y) / north : north < 0 ? -v->y / north : inf;
    return max(min(to_x, to_y), v->nearest);
}

// A ray in progress: its direction, `a` is 1 + slope squared, its greatest depth, and the nearest hit so far. A body that
// the ray passes above is no hit, unless the ray has reached the floor before.
struct beam {
    f64 slope, rise, a, reach, wall;
    f64 depth, height;
    i64 class;
};

static void offer_hit(const struct view *v, struct beam *b, f64 depth, f64 height, i64 class)
{
    f64 z = v->camera_height + b->rise * depth;
    if (z >= 0 && z > height)
        return;
    if (depth < b->depth || (depth == b->depth && (height < b->height || (height == b->height && class < b->class))))
        b->depth = depth, b->height = height, b->class = class;
}

// Whether no body beyond `depth` can change what the ray shows; `height` is that of the highest body.
static int has_ended(const struct view *v, const struct beam *b, f64 depth, f64 height)
{
    f64 z = v->camera_height + b->rise * depth;
    if (b->depth < depth || b->reach < depth)
        return 1;
    return b->rise > 0 ? z > height : z < 0 && v->camera_height + b->rise * b->wall < 0;
}

static void test_body(struct view *v, const struct rays *rays, struct beam *beams, const f64 *place,
                      const struct disc *like)
{
    v->disc_count = 0;
    if (like->radius > 0)
        add_disc(v, place[0], place[1], like);
    if (!v->disc_count || !can_hit(v->discs, rays->right_most, rays->left_most))
        return;
    for (struct beam *b = beams; b < beams + rays->count; b++) {
        f64 depth = disc_depth(v, v->discs, b->slope, b->a);
        if (depth > 0 && depth <= b->reach)
            offer_hit(v, b, depth, like->height, like->class);
    }
}

static void test_cell(struct view *v, const f64 *poses, const struct rays *rays, struct beam *beams, struct grid *g,
                      i64 cell)
{
    if (g->visited[cell] == g->looks)
        return;
    g->visited[cell] = g->looks;
    for (i64 i = g->first[cell]; i < g->first[cell + 1]; i++) {
        i64 body = g->numbers[i];
        if (body != v->own)
            test_body(v, rays, beams, centre(g, poses, body),
                      body < g->robots ? &v->robot_discs[body] : &v->object_discs[body - g->robots]);
    }
}

// Test the cells with bodies whose centres are between two depths, and whose discs the rays can hit.
static void test_band(struct view *v, const f64 *poses, const struct rays *rays, struct beam *beams, struct grid *g,
                      f64 from, f64 to)
{
    f64 side = 1.2 * g->radius; // a wider margin than in `can_hit`
    f64 corners[4][2] = {{from, min(rays->right_most * from, rays->right_most * to) - side},
                         {to, min(rays->right_most * from, rays->right_most * to) - side},
                         {from, max(rays->left_most * from, rays->left_most * to) + side},
                         {to, max(rays->left_most * from, rays->left_most * to) + side}};
    f64 west = __builtin_inf(), south = west, east = -west, north = -west;
    for (int i = 0; i < 4; i++) {
        f64 x = v->x + corners[i][0] * v->cos - corners[i][1] * v->sin;
        f64 y = v->y + corners[i][0] * v->sin + corners[i][1] * v->cos;
        west = min(west, x), east = max(east, x), south = min(south, y), north = max(north, y);
    }
    i64 first = clamped((west - g->left) / g->cell, g->columns), last = clamped((east - g->left) / g->cell, g->columns);
    i64 low = clamped((south - g->low) / g->cell, g->rows), high = clamped((north - g->low) / g->cell, g->rows);
    for (i64 row = low; row <= high && row < g->rows; row++)
        for (i64 column = first; column <= last && column < g->columns; column++)
            test_cell(v, poses, rays, beams, g, row * g->columns + column);
}

// Greatest depth of a point of the grid.
static f64 end_of_grid(const struct view *v, const struct grid *g)
{
    f64 right = g->left + (f64)g->columns * g->cell, high = g->low + (f64)g->rows * g->cell;
    return ((v->cos > 0 ? right : g->left) - v->x) * v->cos + ((v->sin > 0 ? high : g->low) - v->y) * v->sin;
}

static void test_bodies(struct view *v, const f64 *poses, const struct rays *rays, struct beam *beams, struct grid *g)
{
    f64 from = -1.1 * g->radius, step = g->cell, end = min(end_of_grid(v, g), v->range + 1.1 * g->radius);
    g->looks++;
    if (g->columns * g->rows == 1) {
        test_cell(v, poses, rays, beams, g, 0);
        return;
    }
    for (i64 open = 1; open && from <= end; from += step) {
        test_band(v, poses, rays, beams, g, from, from + step);
        open = 0;
        for (i64 i = 0; i < rays->count; i++)
            open += !has_ended(v, &beams[i], from + step - 1.1 * g->radius, g->height);
    }
}

static void test_fixed(struct view *v, const struct rays *rays, struct beam *beams)
{
    for (struct beam *b = beams; b < beams + rays->count; b++) {
        for (i64 s = 0; s < v->side_count; s++) {
            f64 depth = side_depth(v, &v->sides[s], b->slope);
            if (depth > 0 && depth <= v->sides[s].range / sqrt(b->a))
                offer_hit(v, b, depth, v->sides[s].height, v->sides[s].class);
        }
        for (i64 d = 0; d < v->fixed_count; d++) {
            struct disc disc = in_camera_frame(v, &v->fixed[d]);
            f64 depth = disc_depth(v, &disc, b->slope, b->a);
            if (depth > 0)
                offer_hit(v, b, depth, disc.height, disc.class);
        }
    }
}

static i64 class_of(const struct view *v, const struct beam *b)
{
    int hits = b->depth < __builtin_inf();
    f64 z = v->camera_height + b->rise * (hits ? b->depth : b->wall);
    if (z < 0)
        return floor_class(v, b->slope, b->rise);
    return hits ? b->class : z <= v->wall_height ? WALL : ABOVE;
}

// Return the votes of the rays: 256 times those that show an object, plus those that show a robot. The viewpoint is as
// in `set_viewpoint`; the grid was filled from the same poses. `sensor_classes` maps each pixel class to the class that
// the sensor takes it for.
i64 look(struct view *v, const f64 *poses, const f64 *before, f64 quanta, const struct rays *rays, struct grid *g,
         const uint8_t *sensor_classes)
{
    struct beam beams[WINDOW];
    place_camera(v, poses, before, quanta);
    collect_sides(v, poses);
    for (i64 i = 0; i < rays->count; i++) {
        f64 slope = rays->left[i], a = 1 + slope * slope, inf = __builtin_inf();
        beams[i] = (struct beam){slope, rays->up[i], a, v->range / sqrt(a), wall_depth(v, slope), inf, inf, 0};
    }
    test_fixed(v, rays, beams);
    if (g->columns)
        test_bodies(v, poses, rays, beams, g);
    i64 votes = 0;
    for (i64 i = 0; i < rays->count; i++) {
        i64 seen = sensor_classes[class_of(v, &beams[i])];
        votes += seen == OBJECT ? 256 : seen == ROBOT;
    }
    return votes;
}
