"""libq.h on the target: the results are those of exact arithmetic, rounded and saturated, to one unit."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

PI = math.pi
HALF_PLANE: Callable[[float, float], float] = lambda x, y: math.atan2(math.copysign(1, x) * y, abs(x))  # noqa: E731
UNARY: dict[str, Callable[[float], float]] = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan,
    "sinPI": lambda x: math.sin(PI * x), "cosPI": lambda x: math.cos(PI * x),
    "asinByPI": lambda x: math.asin(x) / PI,
    "acosByPI": lambda x: math.acos(x) / PI, "atanByPI": lambda x: math.atan(x) / PI,
    "tanPI": lambda x: math.tan(PI * x),
    "exp": math.exp, "log": math.log, "log10": math.log10, "neg": lambda x: -x,
}  # fmt: skip
ONLY_15: dict[str, Callable[[float], float]] = {"sqrt": math.sqrt, "abs": abs}
BINARY: dict[str, Callable[[float, float], float]] = {
    "atanYByX": HALF_PLANE, "atanYByXByPI": lambda x, y: HALF_PLANE(x, y) / PI, "power": math.pow,
}  # fmt: skip
BINARY_15: dict[str, Callable[[float, float], float]] = {"add": lambda x, y: x + y, "sub": lambda x, y: x - y}
BINARY_16: dict[str, Callable[[float, float], float]] = {"mpy": lambda x, y: x * y, "div": lambda x, y: x / y}


def expected(function: Callable[..., float], arguments: tuple[int, ...], fraction: int, bits: int) -> int | None:
    """Rounded and saturated result; None outside the function's domain."""
    try:
        value = function(*(x / (1 << fraction) for x in arguments))
    except (ValueError, ZeroDivisionError, OverflowError):
        return None
    largest = (1 << bits - 1) - 1
    return max(-largest - 1, min(largest, math.floor(value * (1 << fraction) + 0.5)))


def cases(width: int) -> list[tuple[str, tuple[int, ...], int]]:
    """Calls (function, arguments, result) for _Q15 or _Q16."""
    generator = random.Random(20261127)
    fraction, bits = (15, 16) if width == 15 else (16, 32)
    edges = [0, 1, -1, 1 << fraction - 1, -(1 << fraction - 1), (1 << fraction) - 1, -(1 << fraction)]
    wide = [0x7FFFFFFF, -0x80000000, 205887, -617661] if width == 16 else []
    numbers = [*edges, *wide, *(generator.randrange(-(1 << fraction), 1 << fraction) for _ in range(6))]
    out: list[tuple[str, tuple[int, ...], int | None]] = []
    for name, function in {**UNARY, **(ONLY_15 if width == 15 else {})}.items():
        for x in numbers:
            if name == "tanPI" and abs(x) == 1 << fraction - 1:
                continue  # a pole
            out.append((name, (x,), expected(function, (x,), fraction, bits)))
    for name, function2 in {**BINARY, **(BINARY_15 if width == 15 else BINARY_16)}.items():
        for x in numbers:
            y = generator.choice(numbers)
            out.append((name, (x, y), expected(function2, (x, y), fraction, bits)))
    return [(name, arguments, result) for name, arguments, result in out if result is not None]


@pytest.mark.slow
@pytest.mark.parametrize("width", [15, 16])
def test_results_are_within_one_unit(width: int, tmp_path: Path) -> None:
    """Every function of one argument or two, at the edges of its domain and at random places."""
    rows = cases(width)
    assert len(rows) > 180
    calls = "".join(f"    show(_Q{width}{name}({', '.join(f'{x}L' for x in xs)}));\n" for name, xs, _ in rows)
    (tmp_path / "a.c").write_text(
        "#include <libq.h>\n#include <stdio.h>\n"
        'static void __attribute__((noinline)) show(long value) { printf("%ld\\n", value); }\n'
        f"int main(void)\n{{\n{calls}    return 0;\n}}\n"
    )
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall")
    assert (built.status, built.messages) == (0, "")
    ran = run(tmp_path / "a.elf")
    assert ran.status == 0, ran
    found = [int(line) for line in ran.uart.split()]
    wrong = [(row, value) for row, value in zip(rows, found, strict=True) if abs(row[2] - value) > 1]
    assert wrong == []


PROGRAM = r"""
#include <libq.h>
#include <string.h>
#define CHECK(condition) if (!(condition)) return __LINE__
int main(void)
{
    unsigned char text[20];
    long remainder;
    CHECK(_Q15shl(3, 2) == 12 && _Q15shl(0x4000, 1) == 32767 && _Q15shl(-0x4001, 1) == -32768 && _Q15shl(-5, -1) == -3);
    CHECK(_Q15shr(-5, 1) == -3 && _Q15shr(1, -20) == 32767 && _Q15shl(1, 15) == 32767 && _Q15shl(0, 15) == 0);
    CHECK(_Q15shr(-5, 20) == -1 && _Q15shr(5, 32767) == 0 && _Q15shl(-1, 15) == -32768 && _Q15shl(-1, 16) == -32768);
    CHECK(_Q15shlNoSat(0x2001, 1) == 0x4002 && !_Q15shlSatFlag && _Q15shlNoSat(0x4001, 2) == 4 && _Q15shlSatFlag);
    CHECK(_Q15shrNoSat(8, 3) == 1 && !_Q15shrSatFlag && _Q15shrNoSat(1, -16) == 0 && _Q15shrSatFlag);
    CHECK(_Q15norm(3) == 0x6000 && _Q15norm(-1) == -32768 && _Q15norm(0) == 0 && _Q15norm(-32768) == -32768);
    CHECK(_Q15ftoi(0.5f) == 0x4000 && _Q15ftoi(1.0f) == 32767 && _Q15ftoi(-2.0f) == -32768);
    CHECK(_itofQ15(-0x4000) == -0.5f);
    CHECK(_Q15ftoi(__builtin_nanf("")) == 0);
    CHECK(_Q15atoi((const unsigned char *)"-0.25") == -0x2000);
    CHECK(_Q15atoi((const unsigned char *)".12345") == 4045);
    CHECK(_Q15atoi((const unsigned char *)"0.000049") == 2);
    CHECK(_Q15atoi((const unsigned char *)"-0.0000457763671875") == -2);
    CHECK(_Q15atoi((const unsigned char *)"+0.00004577636718749") == 1 && _Q15atoi((const unsigned char *)"-.") == 0);
    CHECK(_Q15atoi((const unsigned char *)"7") == 32767 && _Q15atoi((const unsigned char *)"0.999999") == 32767);
    _itoaQ15(-0x2000, text);
    CHECK(!strcmp((char *)text, "-0.25"));
    _itoaQ15(-32768, text);
    CHECK(!strcmp((char *)text, "-1.0"));
    _itoaQ15(32767, text);
    CHECK(!strcmp((char *)text, "0.999969482421875") && _Q15atoi(text) == 32767);
    CHECK(_Q16shl(1, 30) == 1L << 30 && _Q16shl(1, 31) == 0x7FFFFFFF && _Q16shl(-1, 31) == (-0x7FFFFFFFL - 1));
    CHECK(_Q16shr(-65536, 17) == -1 && _Q16shr(1, -40) == 0x7FFFFFFF && _Q16shr(-9, 40) == -1);
    CHECK(_Q16shlNoSat(0x40000001, 2) == 4 && _Q16shlSatFlag && _Q16shrNoSat(-8, 2) == -2 && !_Q16shrSatFlag);
    CHECK(_Q16norm(3) == 0x60000000 && _Q16norm(-1) == (-0x7FFFFFFFL - 1) && _Q16norm(0) == 0);
    CHECK(_Q16mac(0x30000, 0x18000, 0x10000) == 0x58000 && _Q16mac(0x7FFFFFFF, 0x20000, 0) == 0x7FFFFFFF);
    CHECK(_Q16macNoSat(0x10000, 5, 7) == 12 && !_Q16macSatFlag);
    CHECK(_Q16macNoSat(0x40000000, 0x40000, 3) == 3 && _Q16macSatFlag);
    CHECK(_Q16div(1, 0) == 0x7FFFFFFF && _Q16div(-0x18000, 0x10000) == -0x18000 && _Q16div(2, 0x30000) == 1);
    CHECK(_Q16divmod(0x50000, 0x20000, &remainder) == 0x28000 && remainder == 0);
    CHECK(_Q16divmod(1, 0x30000, &remainder) == 0 && remainder == 0x10000);
    CHECK(_Q16reciprocalQ15(0x4000) == 0x20000 && _Q16reciprocalQ16(0x80000) == 0x2000);
    CHECK(_Q16ftoi(-1.5f) == -0x18000 && _itofQ16(0x8000) == 0.5f && _itofQ16(-0x7FFFFFFFL) == -32768.0f);
    CHECK(_Q16ftoi(0.000012f) == 1 && _Q16ftoi(40000.0f) == 0x7FFFFFFF && _Q16ftoi(-4e9f) == (-0x7FFFFFFFL - 1));
    unsigned seen = 0;
    for (int i = 0; i < 400; i++)
        seen |= (_Q15random() > 0) | (_Q15random() < 0) << 1 | (_Q16random() > 0) << 2 | (_Q16random() < 0) << 3;
    CHECK(seen == 15);
    return 0;
}
"""


def test_shifts_flags_quotients_and_text(tmp_path: Path) -> None:
    """Saturation, the flags of NoSat functions, remainders and conversions from and to text."""
    (tmp_path / "a.c").write_text(PROGRAM)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall", "-Wno-bitwise-instead-of-logical")
    assert (built.status, built.messages) == (0, "")
    assert run(tmp_path / "a.elf").status == 0
