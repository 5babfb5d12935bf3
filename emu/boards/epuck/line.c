// The bytes a sensor sends for a line of pixels: gains and colour formats (epuck.md §7.4).

#include <stdint.h>

typedef int64_t i64;
typedef double f64;

enum form { RGB565, GREY, YUV };

// ITU-R BT.601 in 1/256.
static int32_t luma(const int32_t *p)
{
    return (77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8;
}

static uint8_t chroma(int32_t difference, int32_t share)
{
    int32_t value = 128 + ((difference * share) >> 8);
    return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
}

// RGB565 is sent high byte first: R4..R0 G5..G3, G2..G0 B4..B0. YUV is U Y V Y, with the chroma of the first pixel of a
// pair.
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
