/* Runs of bit-fields above 128 bits without a boundary on a whole byte: every field keeps its value when others change. */
#include "exec.h"

#define VALUE 0x123456789ABCDull

TEST(run_130_bits, "abi-elf.md 1.3")
{
    static struct { unsigned long long stamp : 49, lat : 35, lon : 35, fix : 11; } a;
    a.stamp = ULL(VALUE), a.lat = ULL(0x5A5A5A5A5), a.lon = 3, a.fix = U(0x555), a.lat++;
    CHECK(a.stamp == (VALUE & ((1ull << 49) - 1)) && a.lat == 0x5A5A5A5A6 && a.lon == 3 && a.fix == 0x555);
}
TEST(run_of_two_64_bit_fields, "abi-elf.md 1.3")
{
    struct __attribute__((packed)) { unsigned id : 11; unsigned long long data : 64, mask : 64; unsigned crc : 15; } b;
    b.id = U(0x5A5), b.data = ~ULL(VALUE), b.mask = ULL(VALUE) << 13, b.crc = U(0x7001), b.mask ^= 1;
    CHECK(b.id == 0x5A5 && b.data == ~VALUE && b.mask == (VALUE << 13 ^ 1) && b.crc == 0x7001);
}
TEST(run_in_a_volatile_object, "abi-elf.md 1.3")
{
    static volatile struct { unsigned long long a : 60, b : 50, c : 30; } c;
    c.a = VALUE, c.b = ULL(VALUE) >> 3, c.c = 0x2AAAAAAA, c.b |= 1;
    CHECK(c.a == VALUE && c.b == ((VALUE >> 3 & ((1ull << 50) - 1)) | 1) && c.c == 0x2AAAAAAA);
}
TEST(run_in_an_array_of_packed_structs, "abi-elf.md 1.3")
{
    static struct __attribute__((packed)) { unsigned long s0 : 19, s1 : 19, s2 : 19, s3 : 19, s4 : 19, s5 : 19, s6 : 19; } d[3];
    for (int i = 0; i < 3; i++)
        d[i].s0 = i, d[i].s3 = 0x7FFFF - i, d[i].s6 = i + 7, d[i].s5 = d[i].s3 + 1, d[i].s6 ^= 0x40000;
    for (int i = 0; i < I(3); i++) {
        CHECK(d[i].s0 == i && d[i].s3 == 0x7FFFF - i && d[i].s6 == (0x40000 | (i + 7)) && !d[i].s1);
        CHECK(d[i].s5 == ((0x80000 - i) & 0x7FFFF));
    }
}
struct mixed {
    signed long long a : 33;
    long b : 23;
    signed c : 5;
    long long d : 61;
    unsigned e : 1;
    signed long long f : 40;
    unsigned long long g : 64;
    unsigned char h;
};
NOINLINE static long long change(struct mixed *p, long long f)
{
    p->f = f, p->b = -1234567l, p->f++, p->d -= f, p->e = !p->e;
    return p->f;
}
TEST(signed_fields_behind_a_pointer, "abi-elf.md 1.3")
{
    static struct mixed e;
    e.a = LL(-5), e.c = -3, e.g = ULL(VALUE), e.h = 9, e.d = 1ll << 50;
    CHECK(change(&e, LL(-77)) == -76);
    CHECK(e.a == -5 && e.b == -1234567l && e.c == -3 && e.d == (1ll << 50) + 77 && e.e == 1 && e.f == -76);
    struct mixed copy = e;
    copy.f = LL(5);
    CHECK(copy.g == VALUE && copy.h == 9 && copy.f == 5 && e.f == -76);
}
