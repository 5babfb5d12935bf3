// Bytes of a line of pixels as a sensor sends them: gains and colour formats (epuck.md §7.4).

#include <stdint.h>

typedef int64_t i64;
typedef uint64_t u64;
typedef double f64;

enum form { RGB565, GREY, YUV };

// Luma by ITU-R BT.601, with weights in 1/256.
static int32_t luma(const int32_t *p)
{
    return (77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8;
}

static uint8_t chroma(int32_t difference, int32_t share)
{
    int32_t value = 128 + ((difference * share) >> 8);
    return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
}

// Encode a line. RGB565 is sent high byte first: R4..R0 G5..G3, G2..G0 B4..B0. YUV is sent as U Y V Y, with the chroma
// of the first pixel of each pair.
void encode(const uint8_t *pixels, i64 count, i64 form, const f64 *gains, uint8_t *out)
{
    int32_t red = 0;
    for (i64 i = 0; i < count; i++) {
        int32_t p[3];
        for (i64 c = 0; c < 3; c++) {
            f64 value = pixels[3 * i + c] * gains[c];
            p[c] = value < 255 ? (int32_t)value : 255;
        }
        if (form == RGB565) {
            int32_t word = (p[0] >> 3) << 11 | (p[1] >> 2) << 5 | p[2] >> 3;
            *out++ = (uint8_t)(word >> 8), *out++ = (uint8_t)word;
            continue;
        }
        int32_t grey = luma(p);
        if (form == YUV) {
            *out++ = i % 2 ? chroma(red, 183) : chroma(p[2] - grey, 145);
            red = p[0] - grey;
        }
        *out++ = (uint8_t)grey;
    }
}

// Timing of a frame in the machine's record, in cycles; twin of `FrameTiming` and `Scan` in scan.py.
struct scan {
    i64 frame_tcy, first_href, line_tcy, lines, line_bytes, byte_tcy, vsync_rise, vsync_fall, start;
    uint8_t running;
};

// Camera state for native code that renders lines instead of Python. `Readout.publish` sets the members from `setting`.
struct camera {
    const struct scan *scan;
    const uint8_t *plugged;
    const u64 *lamp, *exposure; // in 1 / `one`
    u64 *from, *to, *byte_tcy;  // cycles in which the recorded line is on the bus
    uint8_t *line;
    i64 setting;    // changes with the members below and with the pixel source; 0: only Python can render
    const i64 *row; // scene row of each line
    i64 count, form;
    f64 gains[3], manual; // manual exposure, less than 0 for an automatic one
    u64 one;
};

// Return the scene row of the line on the bus in a cycle, and set `href` to the cycle in which its HREF rises; as
// `Scan.line_at`. Return -1 if there is no such line, the line is in the record already, `setting` is outdated, or
// automatic exposure is still adapting; Python then renders.
i64 row_on_bus(const struct camera *c, i64 setting, i64 cycle, i64 *href)
{
    const struct scan *s = c->scan;
    i64 since = cycle + s->byte_tcy / 2 - s->start;
    if (!setting || c->setting != setting || !*c->plugged || !s->running || since < 0)
        return -1;
    if ((i64)*c->from <= cycle && cycle < (i64)*c->to)
        return -1;
    if (c->manual < 0 && !(*c->lamp == c->one && *c->exposure == c->one))
        return -1;
    i64 offset = since % s->frame_tcy - s->first_href;
    if (offset < 0)
        return -1;
    i64 line = offset / s->line_tcy, behind = offset % s->line_tcy;
    if (line >= s->lines || behind >= s->line_bytes * s->byte_tcy)
        return -1;
    *href = s->start + since / s->frame_tcy * s->frame_tcy + s->first_href + line * s->line_tcy;
    return c->row[line];
}

// Render a line whose HREF rises in cycle `href` into the record, as `Camera._render` does.
void write_line(const struct camera *c, i64 href, const uint8_t *pixels)
{
    f64 brightness = c->manual < 0 ? 1 : (f64)*c->lamp / (f64)c->one * c->manual;
    f64 gains[3] = {c->gains[0] * brightness, c->gains[1] * brightness, c->gains[2] * brightness};
    encode(pixels, c->count, c->form, gains, c->line);
    i64 begin = href - c->scan->byte_tcy / 2;
    *c->from = (u64)begin;
    *c->to = (u64)(begin + c->count * (c->form == GREY ? 1 : 2) * c->scan->byte_tcy);
    *c->byte_tcy = (u64)c->scan->byte_tcy;
}

// Render the line of a still picture that is on the bus in a cycle. `rows` has the pixels of each scene row in the
// columns of the current settings, 0 for a row that was not read yet. Return whether the line was rendered.
i64 render_still(const struct camera *c, i64 cycle, const uint8_t *const *rows)
{
    i64 href, row = row_on_bus(c, c->setting, cycle, &href);
    if (row < 0 || !rows[row])
        return 0;
    write_line(c, href, rows[row]);
    return 1;
}
