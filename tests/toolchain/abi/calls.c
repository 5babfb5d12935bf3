/* C half of the calling-convention tests: main returns the number of the first violated rule, or 0. */
#include <stdarg.h>
#include <stdint.h>

extern uint16_t probe_regs[8], probe_stack[10], probe_result[4];
void probe(void);
int call_mixed(void), call_chars(void), call_variadic(void), call_struct(void), call_preserved(void);

struct pair { int a, b; };
struct odd { char a, b, c; };
struct four { int a[4]; };
struct chars { char a[4]; };
struct three { int a, b, c; };
struct eight { int a[8]; };
struct nine { int a[9]; };

#define CALL(type) (*(__typeof__(type) volatile *)&(__typeof__(type)){(type)probe})
#define R(k, v) (probe_regs[k] == (uint16_t)(v))
#define LO(k, v) ((probe_regs[k] & 0xFF) == (v))
#define S(k, v) (probe_stack[k] == (uint16_t)(v))

static int mixed(void)
{
    CALL(void (*)(int, long, int, long, int, int, int))(0x11, 0x22220033, 0x44, 0x55550066, 0x77, 0x88, 0x99);
    return R(0, 0x11) && R(2, 0x33) && R(3, 0x2222) && R(1, 0x44) && R(4, 0x66) && R(5, 0x5555) && R(6, 0x77) &&
           R(7, 0x88) && S(0, 0x99);
}

static int ten(void)
{
    CALL(void (*)(int, int, int, int, int, int, int, int, int, int))(1, 2, 3, 4, 5, 6, 7, 8, 9, 10);
    return R(0, 1) && R(7, 8) && S(0, 9) && S(1, 10);
}

static int back_fill(void)
{
    CALL(void (*)(int, int, int, long long, long, int))(1, 2, 3, 0x4444333322221111, 0x66665555, 7);
    return R(0, 1) && R(1, 2) && R(2, 3) && R(4, 0x1111) && R(7, 0x4444) && R(3, 7) && S(0, 0x6666) && S(1, 0x5555);
}

static int structs(void)
{
    CALL(void (*)(int, struct pair, int))(1, (struct pair){2, 3}, 4);
    if (!(R(0, 1) && R(2, 2) && R(3, 3) && R(1, 4)))
        return 0;
    CALL(void (*)(int, struct chars, int))(1, (struct chars){{2, 3, 4, 5}}, 6);
    if (!(R(0, 1) && R(1, 0x0302) && R(2, 0x0504) && R(3, 6)))
        return 0;
    CALL(void (*)(int, struct three, int))(1, (struct three){2, 3, 4}, 5);
    if (!(R(0, 1) && R(1, 2) && R(2, 3) && R(3, 4) && R(4, 5)))
        return 0;
    CALL(void (*)(int, struct four, int))(1, (struct four){{2, 3, 4, 5}}, 6);
    return R(0, 1) && R(4, 2) && R(7, 5) && R(1, 6);
}

static int large_structs(void)
{
    CALL(void (*)(struct eight, int))((struct eight){{1, 2, 3, 4, 5, 6, 7, 8}}, 9);
    if (!(R(0, 1) && R(7, 8) && S(0, 9)))
        return 0;
    CALL(void (*)(struct nine, int))((struct nine){{1, 2, 3, 4, 5, 6, 7, 8, 9}}, 10);
    return R(0, 10) && S(8, 1) && S(0, 9);
}

static int odd_struct(void)
{
    CALL(void (*)(struct odd, int))((struct odd){1, 2, 3}, 4);
    return R(0, 0x0201) && LO(1, 3) && R(2, 4);
}

static int bytes(void)
{
    CALL(void (*)(char, _Bool, unsigned char))(-2, 1, 200);
    return LO(0, 0xFE) && LO(1, 1) && LO(2, 200);
}

static int floats(void)
{
    CALL(void (*)(float, int, float, double, int))(1.0f, 2, -2.0f, 1.0, 3);
    return R(0, 0) && R(1, 0x3F80) && R(2, 2) && R(4, 0) && R(5, 0xC000) && R(3, 3) && S(0, 0x3FF0) && S(3, 0);
}

static int variadic(void)
{
    CALL(void (*)(int, ...))(1, 2, 0x44443333L, 'c');
    return S(0, 1) && S(1, 2) && S(2, 0x4444) && S(3, 0x3333) && S(4, 'c');
}

static int results(void)
{
    probe_result[0] = 0x81, probe_result[1] = 2, probe_result[2] = 3, probe_result[3] = 4;
    return CALL(int (*)(void))() == 0x81 && CALL(long (*)(void))() == 0x20081 &&
           CALL(long long (*)(void))() == 0x0004000300020081 && CALL(signed char (*)(void))() == (signed char)0x81 &&
           CALL(_Bool (*)(void))() == 1;
}

static int narrow_result(void)
{
    probe_result[0] = 0xAA7F;
    return CALL(signed char (*)(void))() == 0x7F && CALL(unsigned char (*)(void))() == 0x7F;
}

static int hidden_pointer(void)
{
    struct odd q = CALL(struct odd (*)(int))(5);
    (void)q;
    return probe_regs[0] >= 0x800 && R(1, 5);
}

int c_mixed(int a, long b, int c, long d, int e, int f, int g)
{
    return a == 0x1111 && b == 0x33332222 && c == 0x4444 && d == 0x66665555 && e == 0x0E0E && f == 0x0F0F && g == 0x7777;
}

int c_chars(signed char a, unsigned char b, _Bool c) { return a == -2 && b == 200 && c == 1; }

int c_variadic(int n, ...)
{
    va_list list;
    va_start(list, n);
    int first = va_arg(list, int);
    long second = va_arg(list, long);
    va_end(list);
    return n == 2 && first == 0x1234 && second == 0x55556666;
}

int c_struct(struct pair p, struct odd q, int r)
{
    return p.a == 0x1111 && p.b == 0x2222 && q.a == 1 && q.b == 2 && q.c == 3 && r == 0x4444;
}

/* A function that uses every register. */
long c_busy(void)
{
    volatile int in[16] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
    int a = in[0], b = in[1], c = in[2], d = in[3], e = in[4], f = in[5], g = in[6], h = in[7], i = in[8], j = in[9];
    probe();
    return (long)a * b + (long)c * d + (long)e * f + (long)g * h + (long)i * j + in[15];
}

int main(void)
{
    static int (*const rules[])(void) = {
        mixed, ten, back_fill, structs, large_structs, odd_struct, bytes, floats, variadic, results, narrow_result,
        hidden_pointer, call_mixed, call_chars, call_variadic, call_struct,
    };
    for (unsigned k = 0; k < sizeof rules / sizeof *rules; k++)
        if (!rules[k]())
            return k + 1;
    return call_preserved() ? 99 : 0;
}
