/* Compares __format_double, strtod and strtof, compiled for the host, with the host's printf and strtod, byte for byte.
 * argv: number of random values per function, seed. On a difference it prints the value and exits with status 1. */
#include "format.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

double rt_strtod(const char *text, char **end);
float rt_strtof(const char *text, char **end);

static char *at;
static void store(sink_t *sink, char character)
{
    *at++ = character;
    sink->count++;
}

void __format_pad(sink_t *sink, char character, int count)
{
    while (count-- > 0)
        sink->put(sink, character);
}

static uint64_t state;
static uint64_t random64(void) /* xorshift64* */
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 0x2545F4914F6CDD1Du;
}
static unsigned below(unsigned n) { return (unsigned)(random64() >> 33) % n; }

/* Returns a random number: any exponent, short decimals, ties, integers, subnormals. */
static double number(void)
{
    uint64_t bits = random64();
    double any;
    switch (below(6)) {
    case 0: return (int)below(100000) / (double)(1 << below(20));
    case 1: return ((int)below(20001) - 10000) / 1000.0;
    case 2: return (double)below(1u << 31) * below(1u << 31);
    case 3: return 0.5 * below(40);
    case 4: bits &= 0x800FFFFFFFFFFFFFu >> below(40);
    }
    memcpy(&any, &bits, sizeof any);
    return any;
}

static int print_one(void)
{
    static const char letters[] = "-+ #0", conversions[] = "feEgGF";
    static const unsigned char flags[] = {LEFT, PLUS, SPACE, ALTERNATE, ZERO};
    char format[40] = "%", want[2000], got[2000];
    spec_t spec = {0, conversions[below(6)], 0, -1};
    int length = 1;
    for (int i = 0; i < 5; i++)
        if (!below(4)) {
            format[length++] = letters[i];
            spec.flags |= flags[i];
        }
    if (below(3)) {
        spec.width = 1 + (int)below(30);
        length += sprintf(format + length, "%d", spec.width);
    }
    if (below(4)) {
        spec.precision = (int)below(below(40) ? 25 : 400);
        length += sprintf(format + length, ".%d", spec.precision);
    }
    sprintf(format + length, "%c", spec.conversion);
    double value = number();
    sprintf(want, format, value);
    sink_t sink = {store, NULL, NULL, 0};
    at = got;
    __format_double(&sink, &spec, value);
    *at = 0;
    if (strcmp(want, got) == 0)
        return 0;
    printf("%s of %a: host [%s], ours [%s]\n", format, value, want, got);
    return 1;
}

static void some_text(char *text)
{
    static const char *const odd[] = {
        "inf", "-INFINITY", "nan", "nan(12_a)b", "nan(1", "1e-45", "3.4028236e38", "0x1p-150", "0x1.8p-150", "0x", "0x.p1", "1e", "1e+", "-.5", "5.", ".", "-", "  +7.25xyz", "0x1.8p3q", "infx",
        "0e999999", "1e99999", "1e-99999", "0x1.fffffffffffff8p0", "0x1.fffffffffffff7ffffp0", "0x1p-1075",
        "0x1.8p-1075", "0x1.8p-1074", "0x123456789abcdef123456789p-1100", "2.2250738585072011e-308", "4.9e-324",
        "2.4703282292062327e-324", "2.4703282292062328e-324", "1.7976931348623158e308", "1.7976931348623159e308"};
    double value = number();
    if (below(2)) /* within the range of float */
        value = ldexp(frexp(value, &(int){0}), (int)below(300) - 160);
    switch (below(6)) {
    case 5: /* the midpoint of two floats, or a little above or below it */
        value = isfinite(value) ? fabs((float)value) : 1;
        sprintf(text, "%.200g", (value + nextafterf((float)value, 0)) / 2);
        if (strchr(text, '.') && !strchr(text, 'e') && below(2))
            strcat(text, "00000000001");
        break;
    case 0: sprintf(text, "%.*g", (int)below(20) + 1, value); break;
    case 1: sprintf(text, "%a", value); break;
    case 2: strcpy(text, odd[below(sizeof odd / sizeof *odd)]); break;
    case 3: /* the midpoint of two neighbouring doubles, or a little above it */
        value = isfinite(value) ? fabs(value) : 1;
        sprintf(text, "%.1100Lg", ((long double)value + nextafter(value, 0)) / 2);
        if (below(2) && strchr(text, '.') && !strchr(text, 'e'))
            strcat(text, "1");
        break;
    default: {
        for (unsigned k = below(40); k; k--)
            *text++ = (char)('0' + below(10));
        *text++ = '.';
        for (unsigned k = below(40) + 1; k; k--)
            *text++ = (char)('0' + below(10));
        *text = 0;
        if (below(3))
            sprintf(text, "e%d", (int)below(700) - 350);
    }
    }
}

static int read_one(void)
{
    char text[2000], *host_end, *our_end;
    some_text(text);
    float host_single = strtof(text, &host_end), single = rt_strtof(text, &our_end);
    if (host_end != our_end || (memcmp(&host_single, &single, sizeof single) != 0 && !(isnan(host_single) && isnan(single)))) {
        printf("strtof(\"%s\"): host %a after %ld, ours %a after %ld\n", text, host_single, (long)(host_end - text), single,
               (long)(our_end - text));
        return 1;
    }
    double host = strtod(text, &host_end), ours = rt_strtod(text, &our_end);
    if (host_end == our_end && (memcmp(&host, &ours, sizeof host) == 0 || (isnan(host) && isnan(ours))))
        return 0;
    printf("strtod(\"%s\"): host %a after %ld, ours %a after %ld\n", text, host, (long)(host_end - text), ours,
           (long)(our_end - text));
    return 1;
}

int main(int argc, char **argv)
{
    long count = argc > 1 ? atol(argv[1]) : 1000, failures = 0;
    state = (argc > 2 ? strtoull(argv[2], NULL, 0) : 1) * 2 + 1;
    for (long i = 0; i < count && failures < 10; i++)
        failures += print_one() + read_one();
    printf("%ld numbers, %ld failures\n", count, failures);
    return failures != 0;
}
