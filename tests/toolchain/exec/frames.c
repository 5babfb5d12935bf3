/* Order of accesses to an object, and conditionally chosen addresses of large locals. */
#include "exec.h"

struct rgb { unsigned char r, g, b; };
static struct rgb pixel, red = {1, 2, 3};
unsigned char near_byte;
unsigned near_word;
long near_long;

NOINLINE int copied_member(void) { pixel = red; return pixel.g; }
NOINLINE int stored_through(unsigned char *p) { *p = 7; return near_byte; }
NOINLINE unsigned stored_word(unsigned *p, unsigned *q) { *p = 9; return near_word + *q; }
NOINLINE void set_all(void) { near_byte = 5; near_word = 6; near_long = 7; }
NOINLINE long after_call(void) { near_byte = 1; near_word = 1; set_all(); return near_byte + near_word + near_long; }
NOINLINE unsigned across_barrier(unsigned *p)
{
    unsigned before = near_word;
    *p = 0x55;
    __asm__ volatile("" ::: "memory");
    return near_word - before;
}

TEST(struct_copy_then_member, "6.5.16.1: the stored value is read back") { CHECK(copied_member() == 2); }
TEST(store_then_near_load, "6.5p7: both lvalues designate one object")
{
    near_byte = 1;
    CHECK(stored_through(&near_byte) == 7);
    near_word = 1;
    CHECK(stored_word(&near_word, &near_word) == 18);
}
TEST(call_then_near_load, "5.1.2.3: side effects of a call are complete") { CHECK(after_call() == 18); }
TEST(barrier_then_near_load, "GNU: a memory clobber")
{
    near_word = 0x11;
    CHECK(across_barrier(&near_word) == 0x44);
}

static char *chosen;
NOINLINE void keep(char *p) { chosen = p; }
NOINLINE int which(int c)
{
    char a[40], b[40];
    a[0] = 'a';
    b[0] = 'b';
    char *p = c ? a : b;
    keep(p);
    return *p;
}
NOINLINE int of_three(int c, int d)
{
    int a[50], b[60], e[70];
    a[3] = 1;
    b[3] = 2;
    e[3] = 3;
    int *p = c > 3 ? a : d < 2 ? b : e;
    p[4] = p[3] + 10;
    keep((char *)a), keep((char *)b), keep((char *)e);
    return p[4];
}
NOINLINE int swapped(int c)
{
    int a[40], b[40];
    int *p = a, *q = b;
    if (c) {
        p = b;
        q = a;
    }
    *p = 1;
    *q = 2;
    keep((char *)p), keep((char *)q);
    return a[0] * 10 + b[0];
}
NOINLINE int huge(int c)
{
    int a[500], b[400];
    a[0] = 21;
    b[0] = 42;
    int *p = c ? a : b;
    keep((char *)a), keep((char *)b);
    return *p;
}

TEST(address_by_condition, "6.5.15: the second or the third operand") { CHECK(which(I(1)) == 'a' && which(I(0)) == 'b'); }
TEST(address_by_two_conditions, "6.5.15")
{
    CHECK(of_three(I(4), I(0)) == 11 && of_three(I(0), I(1)) == 12 && of_three(I(0), I(5)) == 13);
}
TEST(two_addresses_by_condition, "6.8.4.1") { CHECK(swapped(I(0)) == 12 && swapped(I(1)) == 21); }
TEST(address_in_a_huge_frame, "6.5.15") { CHECK(huge(I(1)) == 21 && huge(I(0)) == 42); }
