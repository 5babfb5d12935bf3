/* Pointers, arrays, pointer arithmetic, function pointers. */
#include "exec.h"

#include <stddef.h>

static int numbers[8] = {0, 10, 20, 30, 40, 50, 60, 70};

TEST(array_decays, "C11 6.3.2.1p3") { int *p = numbers; CHECK(p[I(3)] == 30 && *(p + 4) == 40 && 5 [p] == 50); }
TEST(pointer_difference, "C11 6.5.6p9")
{
    int *volatile p = &numbers[6], *volatile q = &numbers[1];
    CHECK(p - q == 5 && q - p == -5 && sizeof(p - q) == 2);
}
TEST(pointer_difference_of_wide_elements, "C11 6.5.6p9")
{
    long a[5];
    struct { char c[6]; } s[4];
    long *volatile p = &a[4];
    void *volatile q = &s[3];
    CHECK(p - a == 4 && (struct { char c[6]; } *)0 == 0 && (char *)q - (char *)s == 18);
}
TEST(pointer_comparison, "C11 6.5.8p5")
{
    int *volatile p = &numbers[2], *volatile q = &numbers[5];
    CHECK(p < q && q > p && p != q && p + 3 == q && p <= p && numbers + 8 > q);
}
TEST(null_pointer, "C11 6.3.2.3p3")
{
    int *volatile p = 0;
    CHECK(!p && p == NULL && (uintptr_t)p == 0);
    p = numbers;
    CHECK(p != NULL && !!p);
}
TEST(pre_and_post_increment, "C11 6.5.2.4")
{
    int *p = numbers + I(0);
    CHECK(*p++ == 0 && *p == 10 && *++p == 20 && *p-- == 20 && *--p == 0 && p == numbers);
}
TEST(increment_of_pointee, "C11 6.5.3.2")
{
    int value = I(5), *volatile p = &value;
    ++*p;
    (*p)++;
    *p += 10;
    CHECK(value == 17 && (*p)-- == 17 && value == 16);
}
TEST(copy_loop_postincrement, "C11 6.5.2.4")
{
    char from[] = "pointer", to[8], *d = to;
    const char *s = from;
    while ((*d++ = *s++) != 0) {
    }
    CHECK(to[0] == 'p' && to[6] == 'r' && to[7] == 0 && d - to == 8);
}
TEST(byte_access_of_word, "C11 6.3.2.3p7")
{
    unsigned value = U(0xABCD);
    unsigned char *p = (unsigned char *)&value;
    CHECK(p[0] == 0xCD && p[1] == 0xAB);
    p[1] = 0x12;
    CHECK(value == 0x12CD);
}
TEST(pointer_to_pointer, "C11 6.5.3.2")
{
    int a = 1, b = 2, *p = &a, **volatile pp = &p;
    **pp = 5;
    *pp = &b;
    **pp = 7;
    CHECK(a == 5 && b == 7 && p == &b);
}
TEST(array_of_pointers, "C11 6.7.6.2")
{
    int a = 1, b = 2, c = 3, *table[3] = {&a, &b, &c};
    for (int i = 0; i < 3; i++)
        *table[i] *= 10;
    CHECK(a == 10 && b == 20 && c == 30 && *table[I(1)] == 20);
}
TEST(two_dimensional_array, "C11 6.5.2.1p3")
{
    int m[3][4];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 4; c++)
            m[r][c] = r * 10 + c;
    int r = I(2), c = I(3);
    CHECK(m[r][c] == 23 && m[1][0] == 10 && *(*(m + 2) + 1) == 21 && sizeof m == 24 && sizeof m[0] == 8);
}
TEST(pointer_to_array, "C11 6.7.6.1")
{
    char grid[3][5] = {"abcd", "efgh", "ijkl"}, (*p)[5] = grid;
    p += I(1);
    CHECK((*p)[2] == 'g' && p[1][3] == 'l' && sizeof *p == 5);
}
static NOINLINE long sum_rows(long m[][3], int rows)
{
    long sum = 0;
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < 3; c++)
            sum += m[r][c];
    return sum;
}
TEST(array_parameter, "C11 6.7.6.3p7")
{
    long m[2][3] = {{1, 2, 3}, {40000, 50000, 60000}};
    CHECK(sum_rows(m, I(2)) == 150006L);
}
TEST(negative_index, "C11 6.5.2.1p2") { int *p = numbers + 5; CHECK(p[I(-3)] == 20 && p[-1] == 40 && *(p - I(5)) == 0); }
TEST(index_by_every_type, "C11 6.5.2.1p2") { CHECK(numbers[UC(2)] == 20 && numbers[C(3)] == 30 && numbers[L(4)] == 40 && numbers[LL(5)] == 50); }
TEST(char_array_walk, "C11 6.5.6")
{
    static const char text[] = "hello, world";
    unsigned hash = 5381;
    for (const char *p = text; *p; p++)
        hash = hash * 33 + (unsigned char)*p;
    unsigned want = 5381;
    for (int i = 0; i < 12; i++)
        want = want * 33u + (unsigned)text[i];
    CHECK(hash == want);
}
TEST(void_pointer_round_trip, "C11 6.3.2.3p1")
{
    long value = L(123456);
    void *volatile p = &value;
    long *q = p;
    CHECK(*q == 123456L);
}
TEST(const_and_ram_pointers_mix, "abi-elf.md 1.4")
{
    static const int in_flash[3] = {7, 8, 9};
    int in_ram[3] = {1, 2, 3};
    const int *volatile p[2] = {in_flash, in_ram};
    CHECK(p[I(0)][2] == 9 && p[I(1)][2] == 3);
}
TEST(restrict_pointers, "C11 6.7.3.1")
{
    int a[4] = {1, 2, 3, 4}, b[4];
    int *restrict p = a, *restrict q = b;
    for (int i = 0; i < 4; i++)
        q[i] = p[3 - i];
    CHECK(b[0] == 4 && b[3] == 1);
}
TEST(far_offsets, "C11 6.5.2.1")
{
    static unsigned char buffer[1200];
    unsigned char *p = buffer;
    int k = I(0);
    p[k + 1100] = 77;
    p[k + 511] = 55;
    p[k + 512] = 56;
    CHECK(buffer[1100] == 77 && p[511] == 55 && p[512] == 56 && *(p + 1100) == 77);
}
static int add(int a, int b) { return a + b; }
static int sub(int a, int b) { return a - b; }
static int mul(int a, int b) { return a * b; }
static int (*const operations[])(int, int) = {add, sub, mul};
TEST(function_pointer_table, "C11 6.5.2.2") { CHECK(operations[I(0)](7, 3) == 10 && operations[I(1)](7, 3) == 4 && operations[I(2)](7, 3) == 21); }
TEST(function_pointer_variable, "C11 6.3.2.3p8")
{
    int (*volatile f)(int, int) = add;
    CHECK(f(1, 2) == 3);
    f = &sub;
    CHECK((*f)(1, 2) == -1 && (**f)(5, 2) == 3 && f != add && f == sub);
}
static NOINLINE int apply(int (*f)(int, int), int a, int b) { return f(a, b); }
TEST(function_pointer_argument, "C11 6.5.2.2") { CHECK(apply(I(1) ? mul : add, 6, 7) == 42 && apply(add, 6, 7) == 13); }
typedef int (*operation)(int, int);
static NOINLINE operation choose(char symbol) { return symbol == '+' ? add : symbol == '-' ? sub : symbol == '*' ? mul : 0; }
TEST(function_pointer_result, "C11 6.7.6.3") { CHECK(choose((char)I('+'))(2, 3) == 5 && choose((char)I('*'))(2, 3) == 6 && choose((char)I('?')) == 0); }
struct object { const struct methods *methods; int state; };
struct methods { int (*get)(const struct object *); void (*set)(struct object *, int); };
static int get_plain(const struct object *o) { return o->state; }
static int get_double(const struct object *o) { return 2 * o->state; }
static void set(struct object *o, int v) { o->state = v; }
static const struct methods plain = {get_plain, set}, doubled = {get_double, set};
TEST(virtual_calls, "C11 6.5.2.2")
{
    struct object o[2] = {{&plain, 0}, {&doubled, 0}};
    for (int i = 0; i < 2; i++)
        o[i].methods->set(&o[i], I(21));
    CHECK(o[0].methods->get(&o[0]) == 21 && o[1].methods->get(&o[1]) == 42);
}
static int depth;
static void callback(void (*next)(void)) { depth++; if (next) next(); }
static void second(void) { depth += 10; }
TEST(callback_chain, "C11 6.5.2.2")
{
    void (*volatile f)(void) = second;
    depth = 0;
    callback(f);
    callback(0);
    CHECK(depth == 12);
}
