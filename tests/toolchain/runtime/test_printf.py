"""The printf family on the emulator: its stack use, and its digits compared with Python's, whose printf rules are
C's."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

import emu
from tests.toolchain.c_programs import build, run

SNPRINTF_STACK = 56
"""Issue B: maximum stack bytes of snprintf for %u %d %lu %x %s %c, including its return address."""

STACK_PROGRAM = """
#include <stdio.h>
char to[80];
volatile unsigned u = 54321;
volatile unsigned long ul = 4000000000ul;
volatile int d = -12345;
#define FORMAT "%u %d %12lu %-6x %08lX %s %.2s %c"
int main(void) { return snprintf(to, sizeof to, FORMAT, u, d, ul, 0xBEEF, ul, "text", "cut", 'z'); }
"""

FORMAT_PROGRAM = """
#include <stdio.h>
{values}
int main(void)
{{
{calls}
    return 0;
}}
"""


def stack_use(machine: emu.Machine, function: str) -> int:
    """Return the bytes from the call of `function` to the highest W15 before it returns, with the return address."""
    image = machine.image
    assert image is not None
    symbol = image.symbols.find(function)
    assert symbol is not None
    machine.run(until=symbol.address)
    entry = highest = machine.w[15]
    while machine.w[15] != entry - 4:
        assert machine.step() is None
        highest = max(highest, machine.w[15])
    return highest - (entry - 4)


def test_snprintf_fits_into_its_stack_budget(tmp_path: Path) -> None:
    """snprintf stays within its stack budget, measured at every instruction on the emulator."""
    (tmp_path / "a.c").write_text(STACK_PROGRAM)
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os").status == 0
    assert stack_use(emu.load(tmp_path / "a.elf", engine="auto"), "_snprintf") <= SNPRINTF_STACK


def outputs(calls: list[tuple[str, str]], folder: Path) -> list[str]:
    """Return what printf prints for each (format, C expression)."""
    values = "\n".join(f"volatile __typeof__({value}) v{i} = {value};" for i, (_, value) in enumerate(calls))
    text = "\n".join(f'    printf("{form}\\n", v{i});' for i, (form, _) in enumerate(calls))
    (folder / "a.c").write_text(FORMAT_PROGRAM.format(values=values, calls=text))
    built = build([folder / "a.c"], folder / "a.elf", "-Os", "-Wall")
    assert built.status == 0, built.messages
    ran = run(folder / "a.elf", 100_000_000, engine="auto")
    assert ran.status == 0, ran
    return ran.uart.decode().splitlines()


def test_integers_in_every_form(tmp_path: Path) -> None:
    """Integers are printed as C11 7.21.6.1 requires, for all flags, widths, precisions and lengths and random
    values."""
    rng = random.Random(7216)
    calls, expected = [], []
    for _ in range(120):
        conversion = rng.choice("duxXo")
        flags = "".join(f for f in "-0#" + ("+ " if conversion == "d" else "") if rng.random() < 0.3)
        flags = flags if conversion in "xXo" else flags.replace("#", "")
        width = rng.choice(["", str(rng.randrange(1, 15))])
        precision = rng.choice(["", "", f".{rng.randrange(8)}"])
        if precision:
            flags = flags.replace("0", "")
        if "-" in flags:
            flags = flags.replace("0", "")
        if "+" in flags:
            flags = flags.replace(" ", "")
        length, bits, suffix = rng.choice([("", 16, ""), ("l", 32, "l"), ("ll", 64, "ll")])
        value = rng.getrandbits(rng.randint(1, bits))
        if conversion == "d" and value >> bits - 1:
            value -= 1 << bits
        if conversion == "d" and value == -(1 << bits - 1):
            value += 1
        form = f"%{flags}{width}{precision}"
        calls.append((f"{form}{length}{conversion}", f"{value}{suffix if conversion == 'd' else 'u' + suffix}"))
        if conversion == "o" and "#" in flags:  # C prefixes 0, Python 0o
            form = form.replace("#", "")
            digits = f"{value:o}" if value else "0"
            digits = digits if digits.startswith("0") else "0" + digits
            want = int(precision[1:] or 0) if precision else None
            body = digits.rjust(want or 0, "0") if want is not None else digits
            body = body if "0" not in flags or "-" in flags or not width else body.rjust(int(width), "0")
            expected.append(body.ljust(int(width or 0)) if "-" in flags else body.rjust(int(width or 0)))
        else:
            expected.append(_python_integer(form + conversion, value))
    assert outputs(calls, tmp_path) == expected


def _python_integer(form: str, value: int) -> str:
    """Format an integer with Python's %, corrected to C.

    In C precision 0 prints 0 as no digits, and # does not change 0.
    """
    if value == 0:
        form = form.replace("#", "")
        if ".0" in form and not re.search(r"\.0\d", form):
            sign = "+" if "+" in form else " " if " " in form else ""
            width = int("0" + "".join(re.findall(r"[1-9]\d*", form.split(".")[0])[:1]))
            return sign.ljust(width) if "-" in form else sign.rjust(width)
    return form % value


@pytest.mark.slow
def test_floating_point_digits_are_exact(tmp_path: Path) -> None:
    """%f %e %g print every digit as Python does, ties to even, for values whose integer and fraction fit in 64 bits."""
    rng = random.Random(1999)
    values = [
        0.0, 1.0, -1.0, 0.5, 1.5, 2.5, 0.125, 9.995, 999999.5, 0.1, 123456789.125, 1e15, 4294967296.5, -0.75, 100.0,
    ]  # fmt: skip
    values += [rng.choice((-1, 1)) * rng.random() * 10.0 ** rng.randint(-30, 30) for _ in range(45)]
    calls, expected = [], []
    for value in values:
        for form in (
            f"%.{rng.randrange(0, 9)}f",
            "%g",
            f"%{rng.randrange(1, 20)}.{rng.randrange(0, 6)}e",
            "%+010.3f",
            "%-12.4g",
            "%.17g",
        ):
            calls.append((form, repr(value)))
            expected.append(form % value)
    assert outputs(calls, tmp_path) == expected


def test_special_floating_values(tmp_path: Path) -> None:
    """Infinity, NaN, negative zero, very large and very small numbers are printed as C11 7.21.6.1p8 requires."""
    calls = [("%f", "__builtin_inf()"), ("%F", "-__builtin_inf()"), ("%5.1f|", "__builtin_nan(\"\")"), ("%f", "-0.0"),
             ("%08.1f", "__builtin_inf()"), ("%g", "1e300"), ("%g", "1e-300"), ("%.3e", "1.7976931348623157e308"),
             ("%.1f", "1e22"), ("%g", "1e-5"), ("%G", "1e-10"), ("%g", "100000.0"), ("%g", "1000000.0"),
             ("%#g", "1.0")]  # fmt: skip
    assert outputs(calls, tmp_path) == [
        "inf", "-INF", "  nan|", "-0.000000", "     inf", "1e+300", "1e-300", "1.798e+308", "10000000000000000000000.0",
        "1e-05", "1E-10", "100000", "1e+06", "1.00000",
    ]  # fmt: skip


COUNT_PROGRAM = r"""
#include <stdint.h>
#include <stdio.h>
#include <string.h>
static struct { signed char a, guard; int b; long c; long long d; intmax_t e; int after; } v;
int main(void)
{
    char to[8];
    memset(&v, 0x5A, sizeof v);
    int written = snprintf(to, sizeof to, "%n12%hhn345%hn%%6789%ln%d%lln%jn", &v.after, &v.a, &v.b, &v.c, -12345,
                           &v.d, &v.e);
    if (written != 16)
        return 1;
    if (v.after != 0 || v.a != 2 || v.guard != 0x5A || v.b != 5)
        return 2;
    return v.c == 10 && v.d == 16 && v.e == 16 && !strcmp(to, "12345%6") ? 0 : 3;
}
"""


def test_characters_are_counted(tmp_path: Path) -> None:
    """%n stores as many bytes as its length modifier says, and counts truncated characters too (C11 7.21.6.1p8)."""
    (tmp_path / "a.c").write_text(COUNT_PROGRAM)
    assert build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-Wall").status == 0
    assert run(tmp_path / "a.elf", engine="auto").status == 0
