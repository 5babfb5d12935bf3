/* Structures and unions: layout, copying, passing, nesting. */
#include "exec.h"

#include <stddef.h>
#include <string.h>

struct small { char a; int b; };
struct pair { int x, y; };
struct mixed { char a; long b; char c; };
struct big { int values[12]; char tag; };

TEST(layout, "abi-elf.md 1.2")
{
    CHECK(sizeof(struct small) == 4 && offsetof(struct small, b) == 2);
    CHECK(sizeof(struct { char a, b, c; }) == 3 && sizeof(struct mixed) == 8 && offsetof(struct mixed, c) == 6);
}
TEST(packed_layout, "abi-elf.md 1.2")
{
    struct packed { char a; int b; long c; } __attribute__((packed));
    CHECK(sizeof(struct packed) == 7 && offsetof(struct packed, b) == 1 && offsetof(struct packed, c) == 3);
}
TEST(packed_access, "abi-elf.md 1.2")
{
    struct __attribute__((packed)) packed { char a; int b; long c; };
    volatile struct packed p = {1, 0x1234, 0x56789ABCL};
    CHECK(p.b == 0x1234 && p.c == 0x56789ABCL);
    p.b = 0x4321;
    p.c = -2;
    CHECK(p.a == 1 && p.b == 0x4321 && p.c == -2);
}
TEST(assignment_copies, "C11 6.5.16.1p2")
{
    struct pair a = {I(1), I(2)}, b;
    b = a;
    a.x = 9;
    CHECK(b.x == 1 && b.y == 2);
}
TEST(assignment_of_large_struct, "C11 6.5.16.1p2")
{
    struct big a, b;
    for (int i = 0; i < 12; i++)
        a.values[i] = I(i * i);
    a.tag = 'q';
    b = a;
    a.values[11] = 0;
    CHECK(b.values[0] == 0 && b.values[5] == 25 && b.values[11] == 121 && b.tag == 'q');
}
static NOINLINE struct pair swap_pair(struct pair p) { struct pair r = {p.y, p.x}; return r; }
TEST(pass_and_return_by_value, "C11 6.5.2.2p4")
{
    struct pair p = {I(3), I(4)}, q = swap_pair(p);
    CHECK(q.x == 4 && q.y == 3 && p.x == 3);
}
static NOINLINE struct big fill(int start, char tag)
{
    struct big b;
    for (int i = 0; i < 12; i++)
        b.values[i] = start + i;
    b.tag = tag;
    return b;
}
static NOINLINE long total(struct big b, int scale)
{
    long sum = 0;
    for (int i = 0; i < 12; i++)
        sum += b.values[i];
    return sum * scale + b.tag;
}
TEST(large_struct_result_and_argument, "C11 6.5.2.2p4") { CHECK(total(fill(I(10), 'A'), I(2)) == 2 * 186 + 65); }
static NOINLINE void change(struct pair p) { p.x = 100; p.y = 200; (void)p; }
TEST(argument_is_a_copy, "C11 6.5.2.2p4")
{
    struct pair p = {I(1), I(2)};
    change(p);
    CHECK(p.x == 1 && p.y == 2);
}
TEST(member_of_returned_struct, "C11 6.5.2.3") { CHECK(swap_pair((struct pair){I(5), I(6)}).x == 6 && fill(I(1), 'b').values[3] == 4); }
TEST(nested_structs, "C11 6.7.2.1")
{
    struct { struct pair a; struct { struct pair b; long c; } in; } s = {{1, 2}, {{3, 4}, 5}};
    s.in.b.y = I(44);
    CHECK(s.a.x == 1 && s.in.b.x == 3 && s.in.b.y == 44 && s.in.c == 5);
}
TEST(anonymous_members, "C11 6.7.2.1p13")
{
    struct { int a; union { int b; char c[2]; }; struct { int d; }; } s = {1, {0x4142}, {3}};
    CHECK(s.c[0] == 0x42 && s.c[1] == 0x41 && s.d == 3 && s.b == 0x4142);
}
TEST(array_of_structs, "C11 6.7.6.2")
{
    struct mixed table[4];
    for (int i = 0; i < 4; i++)
        table[i] = (struct mixed){(char)i, 100000L * i, (char)-i};
    int k = I(3);
    CHECK(table[k].a == 3 && table[k].b == 300000L && table[k].c == -3 && table[k - 1].b == 200000L);
}
TEST(struct_of_arrays, "C11 6.7.6.2")
{
    struct { char name[6]; int marks[3]; } s = {"abcde", {7, 8, 9}};
    int k = I(2);
    CHECK(s.name[k] == 'c' && s.marks[k] == 9 && s.name[5] == 0);
    s.marks[k] += 10;
    CHECK(s.marks[2] == 19 && s.marks[1] == 8);
}
TEST(pointer_to_member, "C11 6.5.3.2")
{
    struct mixed m = {1, 2, 3};
    long *volatile p = &m.b;
    *p = 70000L;
    char *volatile q = &m.c;
    *q = 9;
    CHECK(m.b == 70000L && m.a == 1 && m.c == 9);
}
struct node { struct node *next; int value; };
TEST(linked_list, "C11 6.7.2.1p3")
{
    struct node n[5];
    for (int i = 0; i < 5; i++)
        n[i] = (struct node){i < 4 ? &n[i + 1] : 0, i * 3};
    int sum = 0;
    for (struct node *volatile at = n; at; at = at->next)
        sum += at->value;
    CHECK(sum == 30);
}
TEST(list_reversal, "C11 6.5.2.3")
{
    struct node n[4], *head = n, *out = 0;
    for (int i = 0; i < 4; i++)
        n[i] = (struct node){i < 3 ? &n[i + 1] : 0, i};
    while (head) {
        struct node *next = head->next;
        head->next = out;
        out = head;
        head = next;
    }
    CHECK(out == &n[3] && out->next->next->next->value == 0 && n[0].next == 0);
}
TEST(union_overlay, "C11 6.7.2.1p16")
{
    union { unsigned long l; unsigned u[2]; unsigned char c[4]; } v;
    v.l = UL(0x12345678);
    CHECK(v.u[0] == 0x5678 && v.u[1] == 0x1234 && v.c[0] == 0x78 && v.c[3] == 0x12 && sizeof v == 4);
    v.c[1] = 0xFF;
    CHECK(v.l == 0x1234FF78ul);
}
TEST(union_layout, "abi-elf.md 1.2") { CHECK(sizeof(union { char a; long b; char c[5]; }) == 6 && sizeof(union { char a, b; }) == 1); }
TEST(union_of_float_and_bits, "C11 6.5.2.3p3")
{
    union { float f; unsigned long l; } v;
    v.f = F(1.0f);
    CHECK(v.l == 0x3F800000ul);
    v.l = UL(0xC0000000);
    CHECK(v.f == -2.0f);
}
TEST(union_passed_by_value, "C11 6.5.2.2p4")
{
    union word { int i; char c[2]; } w;
    w.i = I(0x0102);
    union word v = w;
    w.c[0] = 9;
    CHECK(v.c[0] == 2 && v.c[1] == 1 && w.i == 0x0109);
}
TEST(compound_literal, "C11 6.5.2.5")
{
    struct pair *p = &(struct pair){I(8), I(9)};
    int *a = (int[]){I(1), I(2), I(3)};
    CHECK(p->x == 8 && p->y == 9 && a[2] == 3);
}
TEST(designated_initialisers, "C11 6.7.9p17")
{
    struct { int a, b[4]; struct pair p; } s = {.p.y = 7, .b = {[2] = 5}, .a = 1};
    CHECK(s.a == 1 && s.b[0] == 0 && s.b[2] == 5 && s.b[3] == 0 && s.p.x == 0 && s.p.y == 7);
}
TEST(partial_initialiser_zeroes_the_rest, "C11 6.7.9p21")
{
    struct big b = {{1, 2}, 0};
    int sum = 0;
    for (int i = 2; i < 12; i++)
        sum |= b.values[i];
    CHECK(b.values[1] == 2 && sum == 0 && b.tag == 0);
}
TEST(flexible_array_member, "C11 6.7.2.1p18")
{
    struct flex { int count; char data[]; };
    static union { struct flex f; char room[10]; } u;
    u.f.count = 4;
    memcpy(u.f.data, "wxyz", 5);
    CHECK(sizeof(struct flex) == 2 && u.room[2] == 'w' && u.f.data[3] == 'z');
}
TEST(struct_comparison_by_memcmp, "C11 6.2.6.1")
{
    struct pair a = {I(1), I(2)}, b = {I(1), I(2)}, c = {I(1), I(3)};
    CHECK(memcmp(&a, &b, sizeof a) == 0 && memcmp(&a, &c, sizeof a) < 0);
}
TEST(self_assignment_and_swap, "C11 6.5.16.1")
{
    struct big a = fill(I(1), 'a'), b = fill(I(100), 'b'), t;
    t = a;
    a = b;
    b = t;
    CHECK(a.values[0] == 100 && b.values[0] == 1 && a.tag == 'b' && b.tag == 'a');
}
TEST(const_struct_in_flash, "abi-elf.md 1.4")
{
    static const struct mixed table[3] = {{1, 100000L, 2}, {3, 200000L, 4}, {5, 300000L, 6}};
    struct mixed copy = table[I(1)];
    CHECK(copy.a == 3 && copy.b == 200000L && copy.c == 4 && table[I(2)].b == 300000L);
}
TEST(conditional_of_structs, "C11 6.5.15p5")
{
    struct pair a = {1, 2}, b = {3, 4}, r = I(0) ? a : b;
    CHECK(r.x == 3 && (I(1) ? a : b).y == 2);
}
TEST(odd_sized_struct, "abi-elf.md 1.2")
{
    struct rgb { unsigned char r, g, b; } a[3] = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, c;
    c = a[I(1)];
    a[2] = c;
    CHECK(c.g == 5 && a[2].r == 4 && a[2].b == 6 && sizeof a == 9);
}

struct mixture { int a; char b, c; long d; };
NOINLINE long read_only(struct mixture m) { return m.a + m.b * 3 + m.c * 5 + m.d; }
NOINLINE long across_a_call(struct mixture m) { long first = read_only(m); return first + m.c + m.d; }
NOINLINE int changed(struct mixture m, int n) { while (n--) m.a += m.b; return m.a; }
NOINLINE int walked(struct mixture m) { int s = 0; for (unsigned k = 0; k < sizeof m; k++) s += ((unsigned char *)&m)[k]; return s; }

TEST(struct_parameters_in_registers, "6.9.1p10: a parameter is an object of its own, however it is used")
{
    struct mixture m = {(int)I(1000), (char)I(-3), (char)I(7), L(70000)};
    CHECK(read_only(m) == 1000 - 9 + 35 + 70000);
    CHECK(across_a_call(m) == 71026 + 7 + 70000);
    CHECK(changed(m, (int)I(4)) == 988 && m.a == 1000);
    CHECK(walked(m) == 3 + 232 + 253 + 7 + 112 + 17 + 1);
}
