/* Inline assembly: operands, clobbers, and the device builtins. */
#include "exec.h"

#include <dspic30f6014a.h>

TEST(output_operand, "GNU C") { int r; __asm__("mov #1234,%0" : "=r"(r)); CHECK(r == 1234); }
TEST(input_and_output, "GNU C") { int r; __asm__("add %1,%2,%0" : "=r"(r) : "r"(I(30)), "r"(I(12))); CHECK(r == 42); }
TEST(read_write_operand, "GNU C") { int r = I(5); __asm__("sl %0,%0" : "+r"(r)); CHECK(r == 10); }
TEST(immediate_operand, "GNU C") { int r = I(7); __asm__("add #%1,%0" : "+r"(r) : "i"(100)); CHECK(r == 107); }
TEST(matching_constraint, "GNU C") { int r; __asm__("com %1,%0" : "=r"(r) : "0"(I(0x00FF))); CHECK(r == (int)0xFF00); }
TEST(early_clobber, "GNU C") { int lo, hi; __asm__("mov %2,%0\n\tadd %3,#1,%1" : "=&r"(lo), "=&r"(hi) : "r"(I(3)), "r"(I(4))); CHECK(lo == 3 && hi == 5); }
TEST(several_instructions, "GNU C") { int r; __asm__("mov #0x0F0F,w0\n\tmov #0x00FF,w1\n\tand w0,w1,%0" : "=r"(r) : : OS_W0, OS_W1); CHECK(r == 0x0F); }
TEST(clobbered_registers_are_kept_out, "GNU C")
{
    int a = I(1), b = I(2), c = I(3), d = I(4);
    __asm__ volatile("clr w0\n\tclr w1\n\tclr w2\n\tclr w3\n\tclr w4\n\tclr w5\n\tclr w6\n\tclr w7" : : : OS_W0, OS_W1, OS_W2, OS_W3, OS_W4, OS_W5, OS_W6, OS_W7);
    CHECK(a == 1 && b == 2 && c == 3 && d == 4);
}
TEST(inputs_stay_out_of_clobbered_registers, "GNU C")
{
    int a = I(21), b = I(4), sum = 0;
    __asm__ volatile("clr w0\n\tclr w1\n\tadd %1,%2,w0\n\tadd w0,w1,%0" : "=r"(sum) : "r"(a), "r"(b) : OS_W0, OS_W1);
    CHECK(sum == 25);
}
TEST(clobbered_saved_registers_are_saved, "GNU C")
{
    int a = I(1);
    __asm__ volatile("setm w8\n\tsetm w9\n\tsetm w12" : : : OS_W8, OS_W9, OS_W12);
    CHECK(a == 1);
}
static int shared;
TEST(memory_clobber, "GNU C") { shared = 1; __asm__ volatile("mov #77,w0\n\tmov w0,[%0]" : : "r"(&shared) : "memory", OS_W0); CHECK(shared == 77); }
TEST(pointer_operand, "GNU C") { int v[2] = {I(5), I(6)}, r; __asm__ volatile("mov [%1+2],%0" : "=r"(r) : "r"(v) : "memory"); CHECK(r == 6); }
TEST(condition_of_loop_in_assembly, "GNU C")
{
    int n = I(10), sum = 0;
    __asm__ volatile("1:\n\tadd %1,%0,%1\n\tdec %0,%0\n\tbra nz,1b" : "+r"(n), "+r"(sum) : : "cc");
    CHECK(n == 0 && sum == 55);
}
TEST(builtin_nop_and_disi, "abi-elf.md 2.9") { __builtin_nop(); __builtin_disi(3); __builtin_clrwdt(); Nop(); CHECK(1); }
TEST(disi_counts, "isa.md 12") { unsigned before, after; __builtin_disi(100); before = DISICNT; after = DISICNT; DISICNT = 0; CHECK(before > after && after > 80); }
TEST(builtin_multiplies, "abi-elf.md 2.9") { CHECK(__builtin_mulss(I(-3), I(4)) == -12 && __builtin_muluu(U(60000), U(3)) == 180000ul && __builtin_mulsu(I(-2), U(60000)) == -120000L && __builtin_mulus(U(60000), I(-2)) == -120000L); }
TEST(builtin_divides, "abi-elf.md 2.9") { CHECK(__builtin_divsd(L(-100000), I(7)) == -14285 && __builtin_modsd(L(-100000), I(7)) == -5 && __builtin_divud(UL(100000), U(7)) == 14285 && __builtin_modud(UL(100000), U(7)) == 5); }
TEST(builtin_divide_with_remainder, "abi-elf.md 2.9") { int r; unsigned u; CHECK(__builtin_divmodsd(L(100000), I(-7), &r) == -14285 && r == 5 && __builtin_divmodud(UL(4000000), U(1000), &u) == 4000 && u == 0); }
TEST(builtin_fraction_divide, "isa.md 6.7") { CHECK(__builtin_divf(I(0x1000), I(0x4000)) == 0x2000); }
TEST(table_read, "abi-elf.md 2.9")
{
    static const unsigned table[2] = {0x1234, 0x5678};
    const unsigned *p = table;
    unsigned page = TBLPAG, offset = (unsigned)(uintptr_t)p;
    TBLPAG = PSVPAG >> 1;
    unsigned value = __builtin_tblrdl((offset & 0x7FFF) | (PSVPAG & 1 ? 0x8000u : 0));
    TBLPAG = page;
    CHECK(value == 0x1234);
}
TEST(bit_toggle, "abi-elf.md 2.9") { unsigned v = U(1); __builtin_btg(&v, 15); __builtin_btg(&v, 0); CHECK(v == 0x8000u); }
TEST(osccon_writes, "dspic30f6014a.md 3") { unsigned before = OSCCON; __builtin_write_OSCCONL(OSCCONL); __builtin_write_OSCCONH((unsigned)OSCCON >> 8); CHECK(OSCCON == before); }
TEST(isr_state, "abi-elf.md 2.9") { int was = (int)__builtin_get_isr_state(); __builtin_set_isr_state(5); int now = (int)__builtin_get_isr_state(); __builtin_set_isr_state((unsigned)was); CHECK(was == 0 && now == 5 && SRbits.IPL == 0); }
TEST(register_bit_fields, "dspic30f6014a.md 6") { LATBbits.LATB3 = 1; int set = LATBbits.LATB3; LATBbits.LATB3 = 0; CHECK(set == 1 && LATBbits.LATB3 == 0 && sizeof T1CONbits == 2); }
TEST(register_wide_fields, "dspic30f6014a.md 7") { T1CONbits.TCKPS = (unsigned)I(2); CHECK(T1CON == 0x20 && T1CONbits.TCKPS1 == 1 && T1CONbits.TCKPS0 == 0); T1CON = 0; }
TEST(register_macros, "XC16 headers") { _T1IP = 5; int priority = _T1IP; _T1IP = 4; CHECK(priority == 5 && (IPC0 >> 12) == 4); }
