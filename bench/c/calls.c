/* Benchmark of calls: recursion, calls through pointers, leaf functions of a few instructions, a deep stack. */
#include <stdint.h>

typedef uint16_t (*step)(uint16_t);

static uint16_t __attribute__((noinline)) twice(uint16_t n)
{
    return (uint16_t)(n << 1);
}

static uint16_t __attribute__((noinline)) mixed(uint16_t n)
{
    return (uint16_t)(twice(n) ^ (n >> 3));
}

static uint16_t __attribute__((noinline)) plus(uint16_t n)
{
    return (uint16_t)(n + 7u);
}

static const step steps[] = {twice, mixed, plus, mixed};

static uint16_t __attribute__((noinline)) fibonacci(uint16_t n)
{
    return n < 2 ? n : (uint16_t)(fibonacci(n - 1) + fibonacci(n - 2));
}

static uint16_t __attribute__((noinline)) deep(uint16_t n)
{
    return n ? (uint16_t)(deep(n - 1) + mixed(n)) : 1;
}

volatile uint16_t result;

int main(void)
{
    for (uint16_t n = 1;; n++) {
        uint16_t value = n;
        for (uint16_t i = 0; i < 64; i++) {
            value = steps[value & 3](value);
        }
        result ^= value ^ fibonacci(12) ^ deep(40);
    }
}
