"""Shifts by a number of bits that is known only at run time."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PROGRAM = """
#define STEP(T, BY_ONE, SYMBOL) {                         \\
        volatile T number = (T)0x9E3779B97F4A7C15u;        \\
        T expected = number;                              \\
        for (volatile int count = 0; count < 8 * sizeof(T); count++) { \\
            if ((T)(number SYMBOL count) != expected) return place; \\
            expected = BY_ONE;                            \\
        }                                                 \\
        place++;                                          \\
    }
#define HALVED(T) (T)(expected < 0 ? -(-(expected + 1) / 2) - 1 : expected / 2)
#define ALL(T) STEP(T, (T)(expected + expected), <<) STEP(T, HALVED(T), >>)
int main(void)
{
    int place = 1;
    ALL(unsigned char) ALL(signed char) ALL(unsigned) ALL(unsigned long) ALL(unsigned long long)
    STEP(int, HALVED(int), >>) STEP(long, HALVED(long), >>) STEP(long long, HALVED(long long), >>)
    return 0;
}
"""


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_a_shift_by_n_is_n_shifts_by_one(level: str, tmp_path: Path) -> None:
    """A shift of 8 to 64 bits by each possible count equals as many doublings, or halvings towards minus infinity."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level)
    assert built.status == 0, built.messages
    assert run(tmp_path / "a.elf").status == 0
