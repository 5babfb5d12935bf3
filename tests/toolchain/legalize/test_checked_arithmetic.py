"""Arithmetic that reports overflow (`llvm.{s,u}{add,sub,mul}.with.overflow`), in bytes, words and types of 17 bits."""

from __future__ import annotations

from pathlib import Path

from tests.toolchain.c_programs import build, run

PROGRAM = """
volatile int words[] = {-32768, -32767, -129, -128, -1, 0, 1, 2, 127, 128, 255, 256, 32767};
enum { COUNT = sizeof words / sizeof words[0] };
#define CHECK(op, A, B, C, symbol)                                            \\
    for (int i = 0; i < COUNT; i++)                                           \\
        for (int k = 0; k < COUNT; k++) {                                     \\
            A a = words[i];                                                   \\
            B b = words[k];                                                   \\
            C c;                                                              \\
            long long exact = (long long)a symbol b;                          \\
            if (__builtin_##op##_overflow(a, b, &c) != (exact != (C)exact) || c != (C)exact) return number; \\
        }                                                                     \\
    number++;
#define ALL(A, B, C) CHECK(add, A, B, C, +) CHECK(sub, A, B, C, -) CHECK(mul, A, B, C, *)
int main(void)
{
    int number = 1;
    ALL(signed char, signed char, signed char)
    ALL(unsigned char, unsigned char, unsigned char)
    ALL(int, int, int)
    ALL(unsigned, unsigned, unsigned)
    ALL(int, unsigned, int)
    ALL(unsigned, int, unsigned)
    return 0;
}
"""


def test_results_and_overflow_are_exact(tmp_path: Path) -> None:
    """For all pairs of values at the edges, result and overflow flag are those of the exact result. Operands of int and
    unsigned are computed in 17 bits."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-O0")
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 0
