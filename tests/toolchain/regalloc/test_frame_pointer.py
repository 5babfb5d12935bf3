"""-fno-omit-frame-pointer, the default at -O0: LNK, ULNK and W14 in every function, as XC16 frames them.

Context switches of operating systems written for XC16 rely on it: ULNK removes what inline assembly left on the stack.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run
from tests.toolchain.compiled import assembly, body

PROGRAM = r"""
#include <xc.h>
volatile int ticks;
void leaves_a_word(void) { __asm__ volatile("push w0"); }
int __attribute__((noinline)) sum(int n, ...)
{
    __builtin_va_list l;
    int s = 0;
    for (__builtin_va_start(l, n); n--;)
        s += __builtin_va_arg(l, int);
    return s;
}
struct nine { int a[9]; };
struct nine __attribute__((noinline)) big(struct nine s, long long x, double d, int k)
{
    s.a[k] += (int)x + (int)d;
    return s;
}
int fib(int n) { return n < 2 ? n : fib(n - 1) + fib(n - 2); }
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks += fib(3); }
int main(void)
{
    leaves_a_word();
    PR1 = 3000, IEC0bits.T1IE = 1, T1CON = 0x8000;
    while (ticks < 10) {}
    T1CON = 0;
    struct nine s = {{1, 2, 3}};
    s = big(s, 40, 2.0, 1);
    return sum(3, 1, 2, 3) == 6 && s.a[1] == 44 && fib(10) == 55;
}
"""


@pytest.mark.parametrize("options", [("-O0",), ("-O0", "-g"), ("-Os", "-fno-omit-frame-pointer")], ids=" ".join)
def test_a_word_that_assembly_leaves_on_the_stack_does_no_harm(options: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", *options, "-fverify-machine")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 1


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_every_function_is_framed(level: str) -> None:
    """With -fno-omit-frame-pointer, leaf functions and handlers have frames, too.

    Functions whose inline assembly changes W14 have none.
    """
    source = (
        "#include <xc.h>\nint leaf(int x) { return x + 1; }\n"
        "void _ISR _T1Interrupt(void) {}\n"
        'void own(void) { __asm__ volatile("push w0\\n clr w14\\n pop w0" ::: "r14"); }\n'
    )
    text = assembly(source, level, frame_pointer=True)
    for name in ("leaf", "_T1Interrupt"):
        assert "lnk #" in " ".join(body(text, name))
        assert "ulnk" in body(text, name)
    assert "ulnk" not in body(text, "own")
    assert "lnk" not in assembly(source, level)


def test_the_option_decides_over_the_level(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("int f(int x) { return x; }\n")
    for options, framed in ((("-O0",), True), (("-O0", "-fomit-frame-pointer"), False), (("-Os",), False)):
        assert build([tmp_path / "a.c"], tmp_path / "a.s", "-S", *options).status == 0
        assert ("ulnk" in (tmp_path / "a.s").read_text()) == framed
