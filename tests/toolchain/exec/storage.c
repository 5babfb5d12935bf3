/* Storage: statics, initialisers, const tables through the PSV window, strings, linkage, alignment. */
#include "exec.h"

#include <string.h>

int zeroed;
int initialised = 1234;
static long static_long = -70000L;
static unsigned char bytes[5] = {1, 2, 3};
char message[] = "writable";
const char *const names[] = {"zero", "one", "two", "three"};
static const int squares[] = {0, 1, 4, 9, 16, 25, 36, 49, 64, 81};
static const long longs[] = {100000L, -200000L, 300000L};
static const signed char signed_bytes[] = {-1, -2, 127, -128};
static const long long wide[] = {0x123456789ABCLL, -1};
static const float reals[] = {0.5f, -2.0f, 1e10f};
static const double doubles[] = {0.1, -3.25};
int *const address = &initialised;
static int *const inner = &initialised + 0;
static char *middle = message + 3;

TEST(zero_initialised, "C11 6.7.9p10") { CHECK(*(volatile int *)&zeroed == 0); static long l; static char *p; CHECK(l == 0 && p == 0); }
TEST(initialised_data, "C11 6.7.9p4") { CHECK(*(volatile int *)&initialised == 1234 && *(volatile long *)&static_long == -70000L); }
TEST(array_rest_is_zero, "C11 6.7.9p21") { volatile unsigned char *b = bytes; CHECK(b[0] == 1 && b[2] == 3 && b[3] == 0 && b[4] == 0); }
TEST(string_in_array_is_writable, "C11 6.7.9p14") { volatile char *m = message; m[0] = 'W'; CHECK(m[0] == 'W' && m[7] == 'e' && m[8] == 0 && sizeof message == 9); m[0] = 'w'; }
TEST(address_constants, "C11 6.6p9") { CHECK(*address == 1234 && inner == &initialised && *middle == 't'); }
static NOINLINE int counter(void) { static int count = 5; return count++; }
TEST(function_static_keeps_its_value, "C11 6.2.4p3") { int first = counter(); CHECK(counter() == first + 1 && counter() == first + 2); }
static NOINLINE int *other_counter(void) { static int count; count += 10; return &count; }
TEST(function_statics_are_distinct, "C11 6.2.2p6") { int *p = other_counter(); int v = *p; counter(); CHECK(*other_counter() == v + 10 && p == other_counter()); }
TEST(const_int_table, "abi-elf.md 1.4") { CHECK(squares[I(0)] == 0 && squares[I(7)] == 49 && squares[UC(9)] == 81); }
TEST(const_long_table, "abi-elf.md 1.4") { CHECK(longs[I(0)] == 100000L && longs[I(1)] == -200000L && longs[I(2)] == 300000L); }
TEST(const_byte_table, "abi-elf.md 1.4") { CHECK(signed_bytes[I(0)] == -1 && signed_bytes[I(1)] == -2 && signed_bytes[I(2)] == 127 && signed_bytes[I(3)] == -128); }
TEST(const_wide_table, "abi-elf.md 1.4") { CHECK(wide[I(0)] == 0x123456789ABCLL && wide[I(1)] == -1); }
TEST(const_float_tables, "abi-elf.md 1.4") { CHECK(reals[I(1)] == -2.0f && reals[I(2)] == 1e10f && doubles[I(0)] == 0.1 && doubles[I(1)] == -3.25); }
TEST(const_string_table, "C11 6.4.5p6") { CHECK(strcmp(names[I(2)], "two") == 0 && names[I(3)][4] == 'e' && strlen(names[I(1)]) == 3); }
TEST(const_sum_loop, "abi-elf.md 1.4") { int sum = 0; for (int i = 0; i < I(10); i++) sum += squares[i]; CHECK(sum == 285); }
TEST(copy_const_to_ram, "abi-elf.md 1.4") { int copy[10]; memcpy(copy, squares, sizeof copy); CHECK(copy[9] == 81 && copy[3] == 9); }
TEST(compare_const_with_ram, "abi-elf.md 1.4") { char ram[] = "three"; CHECK(memcmp(ram, names[I(3)], 6) == 0); }
TEST(two_dimensional_const, "abi-elf.md 1.4")
{
    static const unsigned char font[3][5] = {{1, 2, 3, 4, 5}, {6, 7, 8, 9, 10}, {11, 12, 13, 14, 15}};
    CHECK(font[I(2)][I(3)] == 14 && font[I(1)][0] == 6);
}
TEST(const_structs_with_pointers, "abi-elf.md 1.4")
{
    static const struct { const char *name; int value; const int *data; } items[] = {{"a", 1, squares}, {"bc", 2, squares + 4}};
    CHECK(items[I(1)].name[1] == 'c' && items[I(1)].data[1] == 25 && items[I(0)].value == 1);
}
TEST(const_pointer_walk, "abi-elf.md 1.4") { const int *p = squares + I(2), *end = squares + 5; int sum = 0; while (p != end) sum += *p++; CHECK(sum == 4 + 9 + 16); }
TEST(string_literals_with_escapes, "C11 6.4.4.4") { const char *volatile s = "\x41\102\n\\\"\0z"; CHECK(s[0] == 'A' && s[1] == 'B' && s[2] == 10 && s[3] == '\\' && s[4] == '"' && s[5] == 0 && s[6] == 'z'); }
TEST(string_concatenation, "C11 6.4.5p5") { const char *volatile s = "ab" "cd" "\x01" "2"; CHECK(s[3] == 'd' && s[4] == 1 && s[5] == '2' && sizeof("ab" "cd") == 5); }
TEST(character_constants, "C11 6.4.4.4") { CHECK('a' == 97 && '\377' == -1 && sizeof 'a' == 2 && L'x' == 120); }
TEST(local_array_initialiser, "C11 6.7.9p6") { int a[] = {I(1), I(2), I(3)}, n = sizeof a / sizeof *a; CHECK(n == 3 && a[2] == 3); char s[8] = "hey"; CHECK(s[3] == 0 && s[7] == 0); }
TEST(local_initialisers_run_each_time, "C11 6.2.4p6") { int total = 0; for (int i = 0; i < 3; i++) { int v = 5; v += i; total += v; } CHECK(total == 18); }
TEST(register_objects, "C11 6.7.1p6") { register int i = I(3); register long l = L(100000); CHECK(i * 2 == 6 && l + i == 100003L); }
extern int declared_later;
TEST(extern_declaration, "C11 6.2.2p4") { CHECK(*(volatile int *)&declared_later == 77); }
int declared_later = 77;
int tentative;
int tentative;
TEST(tentative_definitions, "C11 6.9.2p2") { CHECK(*(volatile int *)&tentative == 0); }
TEST(alignment_of_objects, "C11 6.7.5") { static char c1; static _Alignas(8) char c2; static long l; CHECK(((uintptr_t)&c2 & 7) == 0 && ((uintptr_t)&l & 1) == 0 && _Alignof(long) == 2 && (uintptr_t)&c1 != 0); }
TEST(char_after_odd_array, "abi-elf.md 1.1") { static char odd[3] = "ab"; static int word = 0x1234; CHECK(*(volatile int *)&word == 0x1234 && ((uintptr_t)&word & 1) == 0 && odd[1] == 'b'); }
TEST(large_array_clears_and_fills, "C11 6.7.9p10") { static int big[300]; for (int i = 0; i < 300; i++) { CHECK(big[i] == 0); big[i] = i; } CHECK(big[299] == 299); }
TEST(generic_selection, "C11 6.5.1.1p3") { CHECK(_Generic(1L, int: 1, long: 2, default: 3) == 2 && _Generic('a', char: 1, int: 2) == 2 && _Generic(1.0f, float: 4, double: 5) == 4); }
TEST(typeof_and_sizeof, "C11 6.5.3.4p2") { int calls = 0; CHECK(sizeof(calls++) == 2 && calls == 0); __typeof__(1L) v = L(5); CHECK(sizeof v == 4); }
TEST(static_assertion, "C11 6.7.10p3") { _Static_assert(sizeof(int) == 2, "16-bit int"); CHECK(1); }
static inline int twice(int x) { return 2 * x; }
TEST(inline_function, "C11 6.7.4p6") { CHECK(twice(I(21)) == 42); }
__attribute__((weak)) int weak_value(void) { return 3; }
TEST(weak_definition, "GNU C") { CHECK(weak_value() == 3); }
extern int missing(void) __attribute__((weak));
TEST(undefined_weak_is_null, "abi-elf.md 5") { int (*volatile f)(void) = missing; CHECK(f == 0); }
TEST(volatile_reads_are_not_merged, "C11 6.7.3p7") { volatile int v = 1; int a = v; v = 2; int b = v; CHECK(a == 1 && b == 2 && v + v == 4); }
static volatile unsigned char port;
TEST(volatile_read_modify_write, "C11 6.7.3p7") { port = 0; port |= 0x80; port |= 1; port &= (unsigned char)~0x80; port ^= 3; CHECK(port == 2); }
TEST(volatile_bits_of_a_word, "C11 6.7.3p7") { static volatile unsigned reg; reg = 0; reg |= 1u << 15; reg |= 1u << 4; reg &= ~(1u << 15); reg ^= 1; CHECK(reg == 0x11 && (reg & (1u << 4)) && !(reg & 0x8000u)); }
TEST(volatile_pointer_access, "C11 6.7.3p5") { static unsigned place; volatile unsigned *p = &place; *p = 5; *p = *p + 1; CHECK(*p == 6 && place == 6); }
TEST(volatile_struct_member, "C11 6.7.3p9") { static volatile struct { int a; long b; } s; s.a = 3; s.b = 400000L; CHECK(s.a == 3 && s.b == 400000L); }
TEST(volatile_32_and_64, "C11 6.7.3p7") { volatile long l = 0x12345678; volatile long long q = 0x123456789ABCDEFll; l++; q--; CHECK(l == 0x12345679 && q == 0x123456789ABCDEEll); }
TEST(loop_on_volatile, "C11 6.7.3p7") { volatile int n = 5; int turns = 0; while (n) { n--; turns++; } CHECK(turns == 5); }
TEST(sfr_bits, "dspic30f6014a.md 1") { extern volatile unsigned T1CON_shadow; CHECK(T1CON_shadow == 0); T1CON_shadow |= 0x8000u; CHECK(T1CON_shadow == 0x8000u); T1CON_shadow = 0; }
volatile unsigned T1CON_shadow;
