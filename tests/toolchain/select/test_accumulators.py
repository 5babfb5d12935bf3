"""Accumulator variables and DSP builtins, compatible with XC16 (abi-elf.md §2.9)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

MODES = [(level, lto) for level in ("-O0", "-Os", "-O2") for lto in ("-flto", "-fno-lto")]
PROGRAM = r"""
#include <p30F6014A.h>
#include <stddef.h>
int __attribute__((space(xmemory))) xs[4] = {16384, 8192, -16384, 32767};
int __attribute__((space(ymemory))) ys[4] = {16384, 16384, 16384, 16384};
volatile register int g asm("B");
int dot(void)
{
    register int a asm("A");
    int *x = xs, *y = ys, xv, yv, i;
    a = __builtin_clr_prefetch(&x, &xv, 2, &y, &yv, 2, 0, 0);
    for (i = 0; i < 3; i++)
        a = __builtin_mac(a, xv, yv, &x, &xv, 2, &y, &yv, 2, 0, 0);
    a = __builtin_mac(a, xv, yv, NULL, NULL, 0, NULL, NULL, 0, NULL, 0);
    return __builtin_sacr(a, 0);
}
int more(void)
{
    register int a asm("A") = __builtin_lac(100, 0);
    int r, w;
    g = __builtin_lac(50, 0);
    a = __builtin_addab(a, g);
    if (__builtin_sac(a, 0) != 150) return 1;
    g = __builtin_subab(g, a);
    if (__builtin_sac(g, 0) != -100) return 2;
    a = __builtin_sftac(a, -1);
    if (__builtin_sac(a, 0) != 300) return 3;
    a = __builtin_add(a, 7, 0);
    if ((r = __builtin_sac(a, 0)) != 307) return 4;
    a = __builtin_mpy(16384, 100, 0, 0, 0, 0, 0, 0);
    if (__builtin_sac(a, 0) != 50) return 5;
    a = __builtin_msc(a, 16384, 20, 0, 0, 0, 0, 0, 0, &w, g);
    if (w != -100) return 6;
    if (__builtin_sac(a, 0) != 40) return 7;
    a = __builtin_mpyn(16384, 100, 0, 0, 0, 0, 0, 0);
    if (__builtin_sac(a, 0) != -50) return 8;
    int *x = xs, *y = ys, d = 0;
    a = __builtin_ed(d, &x, 2, &y, 2, &d);
    a = __builtin_edac(a, d, &x, 2, &y, 2, &d);
    if (d != 8192 - 16384 || x != xs + 2 || y != ys + 2) return 9;
    a = __builtin_edac(a, d, &x, 2, &y, 2, &d);
    if (__builtin_sacr(a, 0) != 2048) return 10;
    __builtin_movsac(&x, &r, -2, 0, 0, 0, &w, a);
    if (r != 32767 || w != 2048 || x != xs + 2) return 11;
    if (__builtin_fbcl(0x0100) != -6) return 12;
    if (__builtin_divsd(-70000L, 3) != -23333) return 13;
    a = __builtin_clr();
    return __builtin_sac(a, 0);
}
int main(void)
{
    CORCON = (CORCON & 4) | 0xE0;
    int r = more();
    if (r) return r;
    return dot() == 16384/2 + 8192/2 - 16384/2 + 16384 ? 0 : 20;
}
"""
INTERRUPT = r"""
#include <p30F6014A.h>
volatile int seen;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{
    register int a asm("A");
    a = __builtin_lac(1234, 0);
    a = __builtin_sftac(a, -4);
    seen = __builtin_sac(a, 0);
    IFS0bits.T1IF = 0;
}
int main(void)
{
    register int a asm("A");
    register int b asm("B");
    CORCON = (CORCON & 4) | 0xE0;
    a = __builtin_lac(100, 0);
    b = __builtin_lac(200, 0);
    IEC0bits.T1IE = 1;
    IFS0bits.T1IF = 1;
    while (!seen) {}
    return seen == 1234 << 4 && __builtin_sac(a, 0) == 100 && __builtin_sac(b, 0) == 200 ? 0 : 1;
}
"""


@pytest.mark.parametrize(("level", "lto"), MODES)
def test_every_builtin_does_what_its_instruction_does(level: str, lto: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, lto, "-Wall", "-Werror", "-fverify-machine")
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 0


@pytest.mark.parametrize(("level", "lto"), MODES)
def test_an_interrupt_function_keeps_the_accumulators_it_uses(level: str, lto: str, tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(INTERRUPT)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, lto)
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 0


def test_a_tap_takes_one_instruction(tmp_path: Path) -> None:
    """A filter tap takes one instruction: the loop of `dot` is MAC with both prefetches."""
    (tmp_path / "a.c").write_text(PROGRAM)
    assert build([tmp_path / "a.c"], tmp_path / "a.s", "-Os", "-S").status == 0
    text = (tmp_path / "a.s").read_text()
    loop = re.search(r"bra \S+\n(\S+):\n\tmac w4\*w5,A,\[w8\]\+=2,w4,\[w10\]\+=2,w5\n", text)
    assert loop is not None


WRONG = {
    "a = 5;": "accumulator 'a' takes the result of a DSP builtin only",
    "x = a;": "accumulator 'a' can only be an argument of a DSP builtin",
    "a = __builtin_lac(x, 9);": "9 is out of range (-8 to 7)",
    "a = __builtin_lac(x, x);": "'x' must be a number from -8 to 7",
    "a = __builtin_mac(a, x, x);": "__builtin_mac takes 11 arguments, 3 found",
    "a = __builtin_mpy(x, x, &p, &x, 3, 0, 0, 0);": "a prefetch moves its pointer by an even number of bytes",
    "x = __builtin_sac(x, 0);": "'x' is not an accumulator variable",
    "a = __builtin_nothing();": "there is no DSP builtin '__builtin_nothing'",
}


@pytest.mark.parametrize("statement", WRONG)
def test_misuse_names_its_line(statement: str, tmp_path: Path) -> None:
    source = tmp_path / "a.c"
    source.write_text(
        f'int x, *p;\nint main(void)\n{{\n    register int a asm("A");\n    {statement}\n    return 0;\n}}\n'
    )
    built = build([source], tmp_path / "a.elf")
    assert built.status == 2
    assert f"{source}:5: error: {WRONG[statement]}" in built.messages
    assert not (tmp_path / "a.elf").exists()


def test_a_structure_chosen_by_a_branch_is_a_value_like_others(tmp_path: Path) -> None:
    """A structure may be chosen by a branch: two asm statements with several results meet in one phi."""
    source = r"""
    volatile int c = 1;
    int main(void)
    {
        int a, b;
        if (c)
            __asm__ volatile("mov #3,%0\n\tmov #4,%1" : "=&r"(a), "=&r"(b));
        else
            __asm__ volatile("mov #5,%0\n\tmov #6,%1" : "=&r"(a), "=&r"(b));
        return a * 10 + b;
    }
    """
    (tmp_path / "a.c").write_text(source)
    for level in ("-O0", "-Os", "-O2"):
        assert build([tmp_path / "a.c"], tmp_path / "a.elf", level).status == 0
        assert run(tmp_path / "a.elf").status == 34
