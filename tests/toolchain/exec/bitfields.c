/* Bit-fields: layout (abi-elf.md §1.3), reading, writing, promotion. */
#include "exec.h"

#include <string.h>

TEST(layout_int_fields, "abi-elf.md 1.3")
{
    struct { int a : 3; int b : 5; int c : 9; } s = {1, 2, 3};
    CHECK(sizeof s == 4 && memcmp(&s, "\x11\x00\x03\x00", 4) == 0);
}
TEST(layout_char_fields, "abi-elf.md 1.3")
{
    struct { unsigned char a : 3; unsigned char b : 6; } s = {1, 2};
    CHECK(sizeof s == 2 && memcmp(&s, "\x01\x02", 2) == 0);
}
TEST(layout_long_then_int, "abi-elf.md 1.3")
{
    struct { long a : 20; int b : 4; } s = {0x12345, 5};
    CHECK(sizeof s == 4 && memcmp(&s, "\x45\x23\x51\x00", 4) == 0);
}
TEST(layout_char_then_int_field, "abi-elf.md 1.3")
{
    struct { char c; int x : 4; } s = {0x11, 2};
    CHECK(sizeof s == 2 && memcmp(&s, "\x11\x02", 2) == 0);
}
TEST(layout_wide_field, "abi-elf.md 1.3")
{
    struct { unsigned long long q : 40; unsigned r : 10; } s = {0x123456789Aull, 0x155};
    CHECK(sizeof s == 8 && memcmp(&s, "\x9a\x78\x56\x34\x12\x00\x55\x01", 8) == 0);
}
TEST(zero_width_starts_a_unit, "C11 6.7.2.1p12")
{
    struct { int a : 4; int : 0; int b : 4; } s = {1, 2};
    CHECK(sizeof s == 4 && memcmp(&s, "\x01\x00\x02\x00", 4) == 0);
}
TEST(unsigned_field_wraps, "C11 6.7.2.1p10")
{
    struct { unsigned a : 3; unsigned b : 4; } s = {0, 0};
    s.a = U(9);
    s.b = U(15);
    s.b++;
    CHECK(s.a == 1 && s.b == 0);
}
TEST(signed_field_sign_extends, "C11 6.7.2.1p10")
{
    struct { int a : 3; int b : 5; } s;
    s.a = I(-1);
    s.b = I(-16);
    CHECK(s.a == -1 && s.b == -16 && s.a + s.b == -17);
}
TEST(plain_int_field_is_signed, "abi-elf.md 1.1")
{
    struct { int a : 1; } s;
    s.a = 1;
    CHECK(s.a == -1);
}
TEST(neighbours_are_untouched, "C11 6.7.2.1p11")
{
    struct { unsigned a : 5, b : 6, c : 5; } s = {0x1F, 0, 0x1F};
    s.b = U(0x2A);
    CHECK(s.a == 0x1F && s.b == 0x2A && s.c == 0x1F);
    s.b = 0;
    CHECK(s.a == 0x1F && s.c == 0x1F);
}
TEST(single_bits_set_and_clear, "C11 6.7.2.1p9")
{
    struct { unsigned a : 1, b : 1, c : 1, : 4, d : 1, e : 1; } s = {0};
    s.b = 1;
    s.d = I(1);
    s.e = 1;
    CHECK(!s.a && s.b && !s.c && s.d && s.e);
    s.b = 0;
    s.d = (unsigned)I(2);
    CHECK(!s.b && !s.d && s.e);
}
TEST(bit_copies, "C11 6.7.2.1p9")
{
    volatile struct { unsigned a : 1, b : 1, c : 14; } s = {1, 0, 0x1234};
    s.b = s.a;
    s.a = !s.a;
    CHECK(s.b == 1 && s.a == 0 && s.c == 0x1234);
}
TEST(long_fields_cross_words, "C11 6.7.2.1p11")
{
    struct { unsigned long a : 12, b : 12, c : 8; } s = {0};
    s.b = UL(0xABC);
    s.a = UL(0x123);
    s.c = UL(0x7F);
    CHECK(s.a == 0x123 && s.b == 0xABC && s.c == 0x7F);
    s.b += 0x555;
    CHECK(s.a == 0x123 && s.b == 0x011 && s.c == 0x7F);
}
TEST(signed_long_field, "C11 6.7.2.1p10")
{
    struct { long a : 20, b : 12; } s;
    s.a = L(-300000);
    s.b = L(-2000);
    CHECK(s.a == -300000 && s.b == -2000);
}
TEST(long_long_field_40_bits, "C11 6.7.2.1")
{
    struct { long long a : 40, b : 24; } s;
    s.a = LL(-500000000000ll);
    s.b = LL(-8000000);
    CHECK(s.a == -500000000000ll && s.b == -8000000);
    s.a >>= 4;
    CHECK(s.a == -31250000000ll && s.b == -8000000);
}
TEST(bool_fields, "C11 6.7.2.1p5")
{
    struct { _Bool a : 1, b : 1; unsigned c : 6; } s = {0, 1, 33};
    s.a = I(4);
    CHECK(s.a == 1 && s.b == 1 && s.c == 33);
}
TEST(promotion_of_unsigned_field, "C11 6.3.1.1p2")
{
    struct { unsigned a : 5; } s = {3};
    CHECK(s.a - 5 < 0 && -s.a == -3 && ~s.a == -4);
}
TEST(promotion_of_full_width_field, "C11 6.3.1.1p2")
{
    struct { unsigned a : 16; } s = {3};
    CHECK(s.a - 5 > 0);
}
TEST(compound_assignment, "C11 6.5.16.2")
{
    struct { unsigned a : 4; int b : 6; } s = {7, -3};
    s.a *= 3;
    s.b <<= 2;
    CHECK(s.a == 5 && s.b == -12);
    s.a ^= 0xF;
    s.b /= 5;
    CHECK(s.a == 10 && s.b == -2);
}
TEST(assignment_value_is_the_stored_one, "C11 6.5.16p3")
{
    struct { unsigned a : 3; } s;
    int value = s.a = (unsigned)I(13);
    CHECK(value == 5);
}
struct packet { unsigned kind : 3, length : 5; unsigned char body[3]; };
static struct packet packets[3];
TEST(fields_in_arrays, "C11 6.7.2.1")
{
    for (int i = 0; i < 3; i++) {
        packets[i].kind = (unsigned)I(i + 1);
        packets[i].length = (unsigned)I(10 * i);
        packets[i].body[2] = (unsigned char)I(0x80 + i);
    }
    CHECK(packets[0].kind == 1 && packets[2].kind == 3 && packets[1].length == 10 && packets[2].length == 20);
    CHECK(packets[1].body[2] == 0x81);
}
TEST(fields_through_pointer, "C11 6.5.2.3")
{
    struct packet *volatile p = &packets[1];
    p->length = 31;
    p->kind = 7;
    p->kind -= 2;
    CHECK(packets[1].length == 31 && packets[1].kind == 5);
}
TEST(compare_fields, "C11 6.5.9")
{
    volatile struct { unsigned a : 7, b : 9; } s = {100, 100}, t = {100, 101};
    CHECK(s.a == s.b && s.b < t.b && s.a == t.a && t.b > t.a);
}
TEST(volatile_union_of_word_and_bits, "XC16 header style")
{
    volatile union { unsigned word; struct { unsigned on : 1, : 3, rate : 2, : 9, run : 1; }; } r = {0};
    r.rate = 2;
    r.run = 1;
    CHECK(r.word == 0x8020u);
    r.word |= 1;
    CHECK(r.on == 1);
    r.run = 0;
    CHECK(r.word == 0x0021);
}
