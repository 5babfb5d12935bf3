/* Ten programs that compute, selected by PROGRAM. Each ends with a jump to itself, where the test starts it again. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

volatile uint32_t result;
static uint32_t state = 1;

static uint32_t draw(void)
{
    state = state * 1664525u + 1013904223u;
    return state >> 8;
}

#if PROGRAM == 0 /* checksums */
static void compute(void)
{
    uint32_t sum = ~0ul;
    for (uint16_t n = 0; n < 200; n++) {
        sum ^= (uint8_t)draw();
        for (uint8_t bit = 0; bit < 8; bit++)
            sum = sum >> 1 ^ (sum & 1 ? 0xEDB88320ul : 0);
    }
    result = sum;
}
#elif PROGRAM == 1 /* sorting by pointers */
static int16_t values[120];
static int compare(const void *a, const void *b)
{
    int16_t x = *(const int16_t *)a, y = *(const int16_t *)b;
    return (x > y) - (x < y);
}
static void compute(void)
{
    for (uint8_t n = 0; n < 120; n++)
        values[n] = (int16_t)draw();
    qsort(values, 120, sizeof *values, compare);
    result = (uint16_t)values[60];
}
#elif PROGRAM == 2 /* software floating point */
static void compute(void)
{
    double x = 0.5;
    for (uint8_t n = 1; n < 40; n++)
        x = sin(x) * sqrt((double)n) + exp(-x) - pow(x + 1.1, 0.3);
    result = (uint32_t)(x * 1e6);
}
#elif PROGRAM == 3 /* 64-bit arithmetic */
static void compute(void)
{
    uint64_t a = 88172645463325252ull;
    for (uint8_t n = 0; n < 60; n++) {
        a ^= a << 13, a ^= a >> 7, a ^= a << 17;
        a += (a * (draw() | 1)) / (draw() | 3) + a % 1000003u;
    }
    result = (uint32_t)a;
}
#elif PROGRAM == 4 /* recursion and function pointers */
static uint16_t fibonacci(uint8_t n)
{
    return n < 2 ? n : fibonacci(n - 1) + fibonacci(n - 2);
}
static uint16_t twice(uint8_t n)
{
    return 2 * n;
}
static uint16_t (*const functions[])(uint8_t) = {fibonacci, twice};
static void compute(void)
{
    for (uint8_t n = 0; n < 14; n++)
        result += functions[draw() & 1](n);
}
#elif PROGRAM == 5 /* text */
static char text[80];
static void compute(void)
{
    snprintf(text, sizeof text, "%d %05u %lx %s %c", (int)draw(), (unsigned)draw() & 0xFFFF, (unsigned long)draw(),
             "kilobot", 'x');
    for (char *at = strtok(text, " "); at != NULL; at = strtok(NULL, " "))
        result += strtol(at, NULL, 10) + strlen(at);
}
#elif PROGRAM == 6 /* bit fields, shifts and tables */
struct packet {
    uint16_t kind : 3, length : 5, flags : 6, more : 2;
} packets[30];
static void compute(void)
{
    for (uint8_t n = 0; n < 30; n++) {
        packets[n].kind = draw(), packets[n].length = draw(), packets[n].flags ^= draw(), packets[n].more++;
        result = (result << (packets[n].length & 7)) ^ (result >> packets[n].kind) ^ packets[n].flags;
    }
}
#elif PROGRAM == 7 /* matrices of signed bytes: MULS, MULSU, FMUL */
static int8_t a[8][8];
static uint8_t b[8][8];
static int16_t c[8][8];
static void compute(void)
{
    for (uint8_t n = 0; n < 64; n++)
        a[n / 8][n % 8] = (int8_t)draw(), b[n / 8][n % 8] = (uint8_t)draw();
    for (uint8_t i = 0; i < 8; i++)
        for (uint8_t j = 0; j < 8; j++) {
            int16_t sum = 0;
            for (uint8_t k = 0; k < 8; k++)
                sum += a[i][k] * b[k][j] - a[k][i] * a[j][k];
            c[i][j] = sum;
        }
    result += (uint16_t)c[3][5];
}
#elif PROGRAM == 8 /* heap */
static void compute(void)
{
    void *held[12] = {0};
    for (uint8_t n = 0; n < 100; n++) {
        uint8_t at = draw() % 12;
        free(held[at]);
        held[at] = malloc(1 + draw() % 40);
        if (held[at] != NULL)
            memset(held[at], n, 1);
    }
    for (uint8_t n = 0; n < 12; n++)
        free(held[n]);
    result++;
}
#else /* a state machine with a wide switch */
static void compute(void)
{
    uint8_t at = 0;
    for (uint16_t n = 0; n < 300; n++) {
        uint8_t in = (uint8_t)draw();
        switch (at) {
        case 0: at = in & 7; break;
        case 1: at = in > 100 ? 2 : 3; result += 5; break;
        case 2: at = (in ^ n) % 9; break;
        case 3: result ^= in; at = 4; break;
        case 4: at = in & 1 ? 5 : 8; break;
        case 5: result <<= 1; at = 6; break;
        case 6: at = 7; result -= n; break;
        case 7: at = in % 5; break;
        default: at = 0; result += 3; break;
        }
    }
}
#endif

int main(void)
{
    for (uint8_t n = 0; n < 3; n++)
        compute();
    return 0;
}
