"""Results, preserved registers, names and function pointers between C and assembly, both ways (abi-elf.md §2)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import run_both

LEVELS = ("-O0", "-Os", "-O2")


@pytest.mark.parametrize("level", LEVELS)
def test_results_come_in_w0_to_w3(level: str, tmp_path: Path) -> None:
    """Results of 8 to 64 bits, float and double are in W0 to W3 (abi-elf.md §2.3).

    The upper byte of an 8-bit result is undefined.
    """
    c_text = """
signed char r8(void); unsigned char u8(void); int r16(void); long r32(void); long long r64(void);
float rf(void); double rd(void); int check(void);
signed char c8(void) { return -3; }
int c16(void) { return 0x1234; }
long c32(void) { return 0x12345678L; }
long long c64(void) { return 0x123456789ABCDEF0LL; }
float cf(void) { return -2.0f; }
double cd(void) { return 1.5; }
int main(void)
{
    if (r8() != -2 || u8() != 200) return 1;
    if (r16() != 0x4321) return 2;
    if (r32() != 0x11112222L) return 3;
    if (r64() != 0x1111222233334444LL) return 4;
    if (rf() != 1.0f) return 5;
    if (rd() != 1.0) return 6;
    return check();
}
"""
    s_text = """
        .global _r8
_r8:    mov #0x55FE,w0
        return
        .global _u8
_u8:    mov #0x55C8,w0
        return
        .global _r16
_r16:   mov #0x4321,w0
        return
        .global _r32
_r32:   mov #0x2222,w0
        mov #0x1111,w1
        return
        .global _r64
_r64:   mov #0x4444,w0
        mov #0x3333,w1
        mov #0x2222,w2
        mov #0x1111,w3
        return
        .global _rf
_rf:    clr w0
        mov #0x3F80,w1
        return
        .global _rd
_rd:    clr w0
        clr w1
        clr w2
        mov #0x3FF0,w3
        return
        .macro expect reg, value, status
        mov #\\value,w7
        mov #\\status,w6
        cp \\reg,w7
        bra nz,fail
        .endm
        .global _check
_check: rcall _c8
        and #0xFF,w0
        expect w0,0xFD,7
        rcall _c16
        expect w0,0x1234,8
        rcall _c32
        expect w0,0x5678,9
        expect w1,0x1234,9
        rcall _c64
        expect w0,0xDEF0,10
        expect w1,0x9ABC,10
        expect w2,0x5678,10
        expect w3,0x1234,10
        rcall _cf
        expect w0,0,11
        expect w1,0xC000,11
        rcall _cd
        expect w2,0,12
        expect w3,0x3FF8,12
        retlw #0,w0
fail:   mov w6,w0
        return
"""
    assert run_both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_struct_results_go_through_a_hidden_pointer_in_w0(level: str, tmp_path: Path) -> None:
    """Struct results of any size are returned through a hidden pointer in W0; other arguments start at W1.

    Source: abi-elf.md §2.2 rule 7 and §2.3.
    """
    c_text = """
struct one { char a; };
struct three { int a, b, c; };
extern struct one make_one(int x);
extern struct three make_three(int x, long y);
extern int check(void);
struct one c_one(int x) { struct one r = {(char)(x + 1)}; return r; }
struct three c_three(int x, long y) { struct three r = {x, (int)y, (int)(y >> 16)}; return r; }
int main(void)
{
    struct one o = make_one(5);
    struct three t = make_three(7, 0x20003L);
    if (o.a != 15 || t.a != 7 || t.b != 3 || t.c != 2) return 1;
    return check();
}
"""
    s_text = """
        .global _make_one
_make_one:
        add w1,#10,w1
        mov.b w1,[w0]
        return
        .global _make_three
_make_three:
        mov w1,[w0]                     ; x in W1, y in W2:W3
        mov w2,[w0+2]
        mov w3,[w0+4]
        return
        .section .nbss,bss,near
room:   .space 6
        .section .text,code
        .global _check
_check: mov #room,w0
        mov #40,w1
        rcall _c_one
        mov #room,w1
        mov.b [w1],w0
        ze w0,w0
        mov #41,w2
        cp w0,w2
        bra nz,1f
        mov #room,w0
        mov #11,w1
        mov #0x2222,w2
        mov #0x3333,w3
        rcall _c_three
        mov #room,w1
        mov [w1],w0
        cp w0,#11
        bra nz,1f
        mov [w1+2],w0
        mov #0x2222,w2
        cp w0,w2
        bra nz,1f
        mov [w1+4],w0
        mov #0x3333,w2
        cp w0,w2
        bra nz,1f
        retlw #0,w0
1:      retlw #2,w0
"""
    assert run_both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_c_functions_preserve_w8_to_w14_and_balance_w15(level: str, tmp_path: Path) -> None:
    """C functions preserve W8 to W14 and balance W15 (abi-elf.md §2.1).

    Assembly calls a C function with many live values.
    """
    c_text = """
volatile int sink;
extern int check(void);
int leaf(int x) { return x + sink; }
int busy(int a, int b, int c, int d)
{
    int e = a * b, f = c * d, g = a + d, h = b - c, i = a ^ c;
    for (int k = 0; k < 3; k++) {
        e += leaf(f); f -= leaf(g); g ^= leaf(h); h += leaf(i); i -= leaf(a); a += b; b ^= c; c -= d; d += a;
    }
    int array[5] = {e, f, g, h, i};
    for (int k = 0; k < 5; k++) sink += array[(k + a) & 3];
    return a + b + c + d + e + f + g + h + i;
}
int main(void) { return check(); }
"""
    registers = range(8, 15)
    s_text = (
        "        .global _check\n_check:\n"
        + "".join(f"        mov w{r},[w15++]\n" for r in registers)
        + "".join(f"        mov #0x7A{r:02X},w{r}\n" for r in registers)
        + "        mov w15,_before\n        mov #1,w0\n        mov #2,w1\n        mov #3,w2\n        mov #4,w3\n"
        + "        rcall _busy\n        mov _before,w1\n        sub w15,w1,w0\n        bra nz,1f\n"
        + "".join(f"        mov #0x7A{r:02X},w1\n        sub w{r},w1,w0\n        bra nz,1f\n" for r in registers)
        + "1:\n"
        + "".join(f"        mov [--w15],w{r}\n" for r in reversed(registers))
        + "        return\n        .section .nbss,bss,near\n        .align 2\n_before: .space 2\n"
    )
    assert run_both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_c_expects_calls_to_change_w0_to_w7_and_rcount(level: str, tmp_path: Path) -> None:
    """C code expects that calls change W0 to W7 and RCOUNT (abi-elf.md §2.1).

    The callee changes all registers that it may change.
    """
    c_text = """
extern void ruin(void);
int main(void)
{
    volatile int seed = 3;
    int a = seed, b = seed * 2;
    long c = seed * 100000L;
    long long d = seed * 10000000000LL;
    int buffer[20];
    for (int i = 0; i < 20; i++) buffer[i] = i + seed;
    int copy[20];
    ruin();
    __builtin_memcpy(copy, buffer, sizeof copy);
    ruin();
    if (a != 3 || b != 6 || c != 300000L || d != 30000000000LL) return 1;
    for (int i = 0; i < 20; i++) { ruin(); if (copy[i] != i + a) return 2; }
    return 0;
}
"""
    s_text = (
        "        .global _ruin\n_ruin:\n"
        + "".join(f"        mov #0xBAD{r},w{r}\n" for r in range(8))
        + "        mov w0,_RCOUNT\n        mov #0x0F,w0\n        mov.b WREG,_SR\n        return\n"
    )
    assert run_both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_names_get_an_underscore_in_both_directions(level: str, tmp_path: Path) -> None:
    """C names get an underscore in assembly, in both directions (abi-elf.md §2.6).

    This holds for functions, variables and constants, which assembly reads through the PSV window.
    """
    c_text = """
int shared = 5;
const int table[3] = {10, 20, 30};
extern int from_assembly;
extern int twice(void);
int main(void) { from_assembly += 1; return twice() == 2 * 5 + 30 + 8 ? 0 : twice(); }
"""
    s_text = """
        .global _twice
_twice: mov #_shared,w1
        mov [w1],w0
        add w0,w0,w0
        mov #psvoffset(_table),w1
        add w0,[++w1],w2                ; skip: pointer to table[1]
        inc2 w1,w1
        add w0,[w1],w0
        mov #_from_assembly,w1
        add w0,[w1],w0
        return
        .section .ndata,data,near
        .global _from_assembly
        .align 2
_from_assembly: .word 7
"""
    assert run_both(tmp_path, level, c_text, s_text) == 0


@pytest.mark.parametrize("level", LEVELS)
def test_function_pointers_cross_the_border(level: str, tmp_path: Path) -> None:
    """Function pointers are handles in C and in assembly: each can call the other's (abi-elf.md §1.5)."""
    c_text = """
typedef int (*function)(int);
extern function give(void);
extern int use(function f);
int triple(int x) { return 3 * x; }
int main(void) { return give()(5) == 6 && use(triple) == 21 ? 0 : 1; }
"""
    s_text = """
        .global _give
_give:  mov #handle(_plus_one),w0
        return
_plus_one:
        inc w0,w0
        return
        .global _use
_use:   mov w0,w4
        mov #7,w0
        call w4
        return
"""
    assert run_both(tmp_path, level, c_text, s_text) == 0
