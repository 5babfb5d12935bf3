"""A sample of the run-time library on the emulator: the assembly helpers, and soft float as this compiler translates
it.

Results are compared with values computed here. Most cases run on the host (`test_runtime_on_host.py`).
"""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run

SEED = 6014
CASES = 150

PROGRAM = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
{prototypes}
typedef struct {{ {left} a; {right} b; {result} want; }} case_t;
static const case_t cases[] = {{ {rows} }};
int main(void)
{{
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {{
        {result} got = {call}(cases[i].a, cases[i].b);
        if (got != cases[i].want) {{
            printf("case %u\\n", i);
            return 1;
        }}
    }}
    return 0;
}}
"""


def signed(value: int, bits: int) -> int:
    return (value & (1 << bits) - 1) - ((value >> bits - 1 & 1) << bits)


def truncated(a: int, b: int) -> int:
    return -(abs(a) // abs(b)) if (a < 0) != (b < 0) else abs(a) // abs(b)


def integer(rng: random.Random, bits: int) -> int:
    """Return a random integer of any length, often next to a power of two."""
    value = rng.getrandbits(rng.randint(1, bits))
    return value if rng.random() < 0.7 else ((1 << rng.randrange(bits)) + rng.choice((-1, 0, 1))) & (1 << bits) - 1


WIDTHS = {"si": (32, "int32_t", "uint32_t", "l"), "di": (64, "int64_t", "uint64_t", "ll")}


def integer_operation(name: str, bits: int, a: int, b: int) -> int:
    """Return the exact result of an integer operation modulo 2^bits."""
    sa, sb = signed(a, bits), signed(b, bits)
    exact: dict[str, Callable[[], int]] = {
        "mul": lambda: a * b, "udiv": lambda: a // b, "umod": lambda: a % b, "div": lambda: truncated(sa, sb),
        "mod": lambda: sa - sb * truncated(sa, sb),
        "ashl": lambda: a << b, "lshr": lambda: a >> b, "ashr": lambda: sa >> b,
    }  # fmt: skip
    return exact[name]() & (1 << bits) - 1


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["si", "di"])
@pytest.mark.parametrize("name", ["mul", "udiv", "umod", "div", "mod", "ashl", "lshr", "ashr"])
def test_integer_helper(name: str, mode: str, tmp_path: Path) -> None:
    """Integer helpers called by name give exact results in 32 and 64 bits (abi-elf.md §2.8).

    They multiply, divide, compute remainders and shift.
    """
    bits, _, unsigned_type, suffix = WIDTHS[mode]
    rng = random.Random(f"{SEED} {name} {mode}")
    shift = name.endswith(("shl", "shr"))
    rows = []
    for _ in range(CASES):
        a = integer(rng, bits)
        b = rng.randrange(bits) if shift else integer(rng, bits) or 1
        if name in ("div", "mod") and signed(a, bits) == -(1 << bits - 1) and signed(b, bits) == -1:
            continue  # overflow: undefined in C
        rows.append(
            f"{{ {a}u{suffix}, {b}u{'' if shift else suffix}, {integer_operation(name, bits, a, b)}u{suffix} }}"
        )
    right = "unsigned" if shift else unsigned_type
    call = f"__{name}{mode}3"
    source = PROGRAM.format(prototypes=f"extern {unsigned_type} {call}({unsigned_type}, {right});", left=unsigned_type,
                            right=right, result=unsigned_type, rows=", ".join(rows), call=call)  # fmt: skip
    check(source, tmp_path)


def float_bits(rng: random.Random, double: bool) -> int:
    """Return the bits of a random, simple or special number; two numbers often have close exponents."""
    width, mantissa, bias = (64, 52, 1023) if double else (32, 23, 127)
    kind = rng.randrange(4)
    if kind == 0:
        return rng.getrandbits(width)
    if kind == 1:
        edges = [0, 1, (1 << mantissa) - 1, 1 << mantissa, bias << mantissa, (2 * bias + 1) << mantissa,
                 ((2 * bias + 1) << mantissa) - 1, ((2 * bias + 1) << mantissa) + 1 + (1 << mantissa - 1)]  # fmt: skip
        return rng.choice(edges) | rng.getrandbits(1) << width - 1
    exponent = bias + rng.randint(-20, 20)
    return (
        rng.getrandbits(1) << width - 1
        | exponent << mantissa
        | rng.getrandbits(mantissa) & -(1 << rng.randrange(mantissa))
    )


def as_float(bits: int, double: bool) -> float:
    return float(struct.unpack("<d" if double else "<f", bits.to_bytes(8 if double else 4, "little"))[0])


def to_bits(value: float, double: bool) -> int:
    if double:
        return int.from_bytes(struct.pack("<d", value), "little")
    try:
        return int.from_bytes(struct.pack("<f", value), "little")
    except OverflowError:
        return 0xFF800000 if value < 0 else 0x7F800000


def float_operation(name: str, a: float, b: float) -> float:
    """Return the correctly rounded result, computed in double.

    It is exact for float too, because double has more than twice its precision.
    """
    if name == "add":
        return a + b
    if name == "sub":
        return a - b
    if name == "mul":
        return a * b
    if b == 0 or a != a or b != b:
        if a != a or b != b or a == 0:
            return float("nan")
        negative = (struct.pack(">d", a)[0] ^ struct.pack(">d", b)[0]) & 0x80
        return float("-inf") if negative else float("inf")
    return a / b


FLOAT_PROGRAM = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
typedef {unsigned} bits_t;
extern {type} {call}({type}, {type});
typedef struct {{ bits_t a, b, want; }} case_t;
static const case_t cases[] = {{ {rows} }};
static {type} value(bits_t bits) {{ {type} v; memcpy(&v, &bits, sizeof v); return v; }}
int main(void)
{{
    for (unsigned i = 0; i < sizeof cases / sizeof *cases; i++) {{
        {type} result = {call}(value(cases[i].a), value(cases[i].b));
        bits_t got;
        memcpy(&got, &result, sizeof got);
        if (cases[i].want == (bits_t)-1 ? result == result : got != cases[i].want) {{
            printf("case %u\\n", i);
            return 1;
        }}
    }}
    return 0;
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("double", [False, True], ids=["float", "double"])
@pytest.mark.parametrize("name", ["add", "sub", "mul", "div"])
def test_floating_helper(name: str, double: bool, tmp_path: Path) -> None:
    """Floating-point helpers round correctly (C11 annex F.3); the reference is the host's arithmetic."""
    rng = random.Random(f"{SEED} {name} {double}")
    rows = []
    for _ in range(CASES):
        a, b = float_bits(rng, double), float_bits(rng, double)
        result = float_operation(name, as_float(a, double), as_float(b, double))
        want = -1 if result != result else to_bits(result, double)
        suffix = "ull" if double else "ul"
        rows.append(f"{{ {a:#x}{suffix}, {b:#x}{suffix}, {'(bits_t)-1' if want < 0 else f'{want:#x}{suffix}'} }}")
    source = FLOAT_PROGRAM.format(unsigned="uint64_t" if double else "uint32_t", type="double" if double else "float",
                                  call=f"__{name}{'df' if double else 'sf'}3", rows=", ".join(rows))  # fmt: skip
    check(source, tmp_path)


def check(source: str, folder: Path) -> None:
    """Compile and run the cases; fail with the first wrong one."""
    (folder / "test.c").write_text(source)
    built = build([folder / "test.c"], folder / "test.elf", "-Os", "-Wno-incompatible-library-redeclaration")
    assert built.status == 0, built.messages
    ran = run(folder / "test.elf", engine="auto")
    assert ran.status == 0, (ran, source.split("cases[] = {")[1].split("};")[0].split("}, {")[_case(ran.uart)])


def _case(uart: bytes) -> int:
    words = uart.decode("latin-1").split()
    return int(words[-1]) if words and words[-1].isdigit() else 0


OWN_DIVISION = """
volatile int quotients, remainders;
volatile unsigned long u = 1000007, by = 70001;
volatile long s = -1000007, sby = 70001;
#if OWN & 1
__attribute__((noinline)) unsigned long __udivsi3(unsigned long a, unsigned long b)
{
    unsigned long q = 0;
    quotients++;
    for (int k = 31; k >= 0; k--)
        if (a >> k >= b) a -= b << k, q |= 1ul << k;
    return q;
}
#else
unsigned long __udivsi3(unsigned long a, unsigned long b);
#endif
#if OWN & 2
__attribute__((noinline)) unsigned long __umodsi3(unsigned long a, unsigned long b)
{
    remainders++;
    while (a >= b) a -= b;
    return a;
}
#endif
int main(void)
{
    if (u / by != 14 || u % by != 19993 || s / sby != -14 || s % sby != -19993) return 1;
    if (__udivsi3(u, 1000) != 1000 || u % 1000 != 7 || s % 1000 != -7) return 2;
    if (quotients != (OWN & 1) * 2) return 3;
#if OWN & 2
    if (__umodsi3(u, 100000) != 7) return 4;
    if (remainders < 2) return 5;
#endif
    return 0;
}
"""


@pytest.mark.parametrize("own", [1, 2, 3])
@pytest.mark.parametrize("level", ["-O0", "-Os", "-O2"])
def test_a_program_may_divide_with_its_own_functions(level: str, own: int, tmp_path: Path) -> None:
    """A program may replace the library's division functions, on which no other library function depends."""
    (tmp_path / "a.c").write_text(OWN_DIVISION)
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", level, f"-DOWN={own}")
    assert built.status == 0, built.messages
    ran = run(tmp_path / "a.elf")
    assert ran.status == 0, ran
