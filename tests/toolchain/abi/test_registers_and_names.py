"""Preserved registers, names and function pointers between C and assembly, both ways (abi-elf.md §2)."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import run_both

LEVELS = ("-O0", "-Os", "-O2")


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
