"""The code of each rewrite rule is correct for all inputs: compiled, executed symbolically, proved by z3.

A case is a C function with its result as a z3 term over the parameters. To add a case, add a line to CASES.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import emu
from toolchain.driver import driver
from toolchain.legalize.magic import signed_factor, unsigned_factor

z3 = pytest.importorskip("z3", reason="the solver is not installed (extra: test)")

from tests.cases import check_all  # noqa: E402
from tests.toolchain.proofs.symbolic import results, start, times, unknown_products  # noqa: E402

Term = Any
LEVELS = ("-O1", "-Os", "-O2")


def choose(c: Term, a: Term, b: Term) -> Term:
    """Term of c ? a : b."""
    return z3.If(c, a, b)


def bit(c: Term) -> Term:
    """Term of a truth value as int."""
    return z3.If(c, z3.BitVecVal(1, 16), z3.BitVecVal(0, 16))


def smaller(a: Term, b: Term) -> Term:
    """Term of the signed minimum."""
    return choose(a < b, a, b)


def crc_step(c: Term, polynomial: int) -> Term:
    """Term of one bit step of a right-shifting CRC."""
    return choose(z3.Extract(0, 0, c) == 1, z3.LShR(c, 1) ^ polynomial, z3.LShR(c, 1))


def quotient(a: Term, d: int) -> Term:
    """Term of the signed 16-bit division of C.

    It is computed in 32 bits, where SDIV of the minimum by -1 does not overflow.
    """
    wide = z3.SignExt(16, a) / z3.BitVecVal(d, 32)
    return z3.Extract(15, 0, wide)


def remainder(a: Term, d: int) -> Term:
    """Term of the remainder of the signed division."""
    return a - quotient(a, d) * d


def word_at(address: Term) -> Term:
    """Term of a memory word at function entry."""
    memory = start().memory.array
    return z3.Concat(z3.Select(memory, address + 1), z3.Select(memory, address))


def low_byte(a: Term, signed: bool) -> Term:
    """Term of (char)a as int."""
    return (z3.SignExt if signed else z3.ZeroExt)(8, z3.Extract(7, 0, a))


def long_by_word(a: Term, b: Term) -> Term:
    """Term of a * b for a long and a signed word: h * 2^16 * b + l * b with the halves h, l of a.

    The identity holds in every ring, so that the solver need not prove it in bits.
    """
    low, high = z3.Extract(15, 0, a), z3.Extract(31, 16, a)
    product = z3.SignExt(16, b) * z3.ZeroExt(16, low)
    return z3.Concat(z3.Extract(31, 16, product) + high * b, low * b)


def high_half(a: Term, m: int, signed: bool) -> Term:
    """Term of the upper two words of a * m, from four products of words.

    `test_upper_half` proves the sum.
    """
    extend = z3.SignExt if signed else z3.ZeroExt
    low, high = z3.ZeroExt(32, z3.Extract(15, 0, a)), extend(32, z3.Extract(31, 16, a))
    m_low, m_high = z3.BitVecVal(m & 0xFFFF, 48), z3.BitVecVal(m >> 16, 48)
    lowest, one = (z3.ZeroExt(16, z3.Extract(31, 0, times(low, x))) for x in (m_low, m_high))
    other, top = (extend(16, z3.Extract(31, 0, times(high, x))) for x in (m_low, m_high))
    return z3.Extract(31, 0, top + (z3.LShR(lowest, 16) + one + other >> 16))


def quotient32(a: Term, d: int) -> Term:
    """Term of the unsigned quotient a / d as a product; `test_products_divide` proves it."""
    m, s = unsigned_factor(d, 32)
    return z3.LShR(high_half(a, m, False), s)


def signed_quotient32(a: Term, d: int) -> Term:
    """Term of the signed quotient a / d as a product; `test_products_divide` proves it."""
    m, s = signed_factor(abs(d), 32)
    q = (high_half(a, m, True) >> s) + z3.LShR(a, 31)
    return q if d > 0 else -q


def branches() -> dict[str, tuple[str, str, str, Callable[..., Term]]]:
    """Cases of comparisons with constants of all sizes at a branch.

    An inline NOP prevents a conditional expression.
    """
    kinds: dict[str, tuple[str, str, Callable[[Term], Term], bool]] = {
        "int": ("i", "a", lambda a: a, True),
        "word": ("u", "a", lambda a: a, False),
        "char": ("i", "(signed char)a", lambda a: low_byte(a, True), True),
        "byte": ("u", "(unsigned char)a", lambda a: low_byte(a, False), False),
    }
    constants = {
        "int": (100, 1023, 1024, -5, -31, -32, -1000, -1024), "word": (300, 0xFFFB, 0xFFE1, 0xFE00, 0x8000),
        "char": (100, 127, -5, -100, -128), "byte": (120, 200, 250),
    }  # fmt: skip
    signed: dict[str, Callable[[Term, Term], Term]] = {
        "<": lambda x, y: x < y, ">=": lambda x, y: x >= y, "==": lambda x, y: x == y, ">": lambda x, y: x > y,
    }  # fmt: skip
    unsigned = signed | {"<": z3.ULT, ">=": z3.UGE, ">": z3.UGT}
    found: dict[str, tuple[str, str, str, Callable[..., Term]]] = {}
    for kind, (letter, text, view, is_signed) in kinds.items():
        for k in constants[kind]:
            for n, (sign, holds) in enumerate((signed if is_signed else unsigned).items()):
                condition = f"{text} {sign} {k}{'' if is_signed else 'u'}"
                c = f'({{ int r = 9; if ({condition}) {{ asm volatile("nop"); r = 7; }} r; }})'

                def meaning(a: Term, k: int = k, view: Any = view, holds: Any = holds) -> Term:
                    return choose(holds(view(a), z3.BitVecVal(k, 16)), z3.BitVecVal(7, 16), z3.BitVecVal(9, 16))

                found[f"branch_{kind}_{k}_{n}".replace("-", "minus_")] = ("int", letter, c, meaning)
    return found


# name: (result type, parameter types, C expression over a, b, c, term of the result). Types: keys of C_TYPES.
CASES: dict[str, tuple[str, str, str, Callable[..., Term]]] = {
    # shifts of two-word values
    **{f"shl_{n}": ("long", "l", f"(long)((unsigned long)a << {n})", lambda a, n=n: a << n)
       for n in (1, 2, 3, 4, 5, 8, 12)},
    **{f"shr_{n}": ("unsigned long", "L", f"a >> {n}", lambda a, n=n: z3.LShR(a, n)) for n in (1, 4, 8, 9)},
    **{f"sar_{n}": ("long", "l", f"a >> {n}", lambda a, n=n: a >> n) for n in (1, 8)},
    "shl_low_word": ("unsigned", "Lu", "(unsigned)(a << (b & 31))",
                     lambda a, b: z3.Extract(15, 0, a << z3.ZeroExt(16, b & 31))),
    # truth values and comparisons
    "lt32": ("int", "ll", "a < b", lambda a, b: bit(a < b)),
    "leu32": ("int", "LL", "a <= b", lambda a, b: bit(z3.ULE(a, b))),
    "eq32": ("int", "ll", "a == b", lambda a, b: bit(a == b)),
    "three_way": ("int", "ll", "a < b ? -1 : a > b", lambda a, b: choose(a < b, z3.BitVecVal(-1, 16), bit(a > b))),
    # choices
    "min16": ("int", "ii", "a < b ? a : b", smaller),
    "max16": ("int", "ii", "a > b ? a : b", lambda a, b: choose(a > b, a, b)),
    "not_below": ("int", "i", "a < 0 ? 0 : a", lambda a: choose(a < 0, z3.BitVecVal(0, 16), a)),
    "clamp16": ("int", "iii", "a < b ? b : a > c ? c : a", lambda a, b, c: choose(a < b, b, choose(a > c, c, a))),
    "min32": ("long", "ll", "a < b ? a : b", smaller),
    "clamp32": ("long", "lll", "a < b ? b : a > c ? c : a", lambda a, b, c: choose(a < b, b, choose(a > c, c, a))),
    "abs16": ("int", "i", "a < 0 ? (int)(0u - a) : a", lambda a: choose(a < 0, -a, a)),
    "abs32": ("long", "l", "a < 0 ? (long)(0ul - a) : a", lambda a: choose(a < 0, -a, a)),
    "hex_digit": ("int", "i", "(a & 15) < 10 ? '0' + (a & 15) : 'a' - 10 + (a & 15)",
                  lambda a: choose((a & 15) < 10, (a & 15) + 48, (a & 15) + 87)),
    # instructions executed under a skip
    "add_if": ("unsigned", "uuu", "a < b ? a + c : a", lambda a, b, c: choose(z3.ULT(a, b), a + c, a)),
    "sub_if32": ("unsigned long", "LL", "a >= b ? a - b : a", lambda a, b: choose(z3.UGE(a, b), a - b, a)),
    "add_chosen32": ("unsigned long", "LLu", "a + (c ? b : 0)", lambda a, b, c: choose(c != 0, a + b, a)),
    "xor_const_if": ("unsigned", "uu", "b ? a ^ 0x1021 : a", lambda a, b: choose(b != 0, a ^ 0x1021, a)),
    "ior_const_if32": ("unsigned long", "Lu", "b ? a | 0x10000ul : a", lambda a, b: choose(b != 0, a | 0x10000, a)),
    "sub_const_if": ("unsigned", "uu", "b ? a - 300 : a", lambda a, b: choose(b != 0, a - 300, a)),
    # the bit that a shift moves out
    "crc16_step": ("unsigned", "u", "a & 1 ? a >> 1 ^ 0xA001 : a >> 1", lambda a: crc_step(a, 0xA001)),
    "crc32_step": ("unsigned long", "L", "a & 1 ? a >> 1 ^ 0xEDB88320ul : a >> 1", lambda a: crc_step(a, 0xEDB88320)),
    "crc_left": ("unsigned", "u", "a & 0x8000 ? a << 1 ^ 0x1021 : a << 1",
                 lambda a: choose(z3.Extract(15, 15, a) == 1, a << 1 ^ 0x1021, a << 1)),
    # conversion of a byte to a word
    "xor_byte": ("unsigned", "uu", "a ^ (unsigned char)b", lambda a, b: a ^ b & 255),
    "ior_byte32": ("unsigned long", "Lu", "a | (unsigned char)b", lambda a, b: a | z3.ZeroExt(16, b & 255)),
    # structs in registers
    "pair_sum": ("int", "P", "a.x + a.y", lambda a: z3.Extract(15, 0, a) + z3.Extract(31, 16, a)),
    "pair_bytes": ("int", "P", "((unsigned char *)&a)[1] + ((unsigned char *)&a)[2]",
                   lambda a: z3.ZeroExt(8, z3.Extract(15, 8, a)) + z3.ZeroExt(8, z3.Extract(23, 16, a))),
    # division by constants; at -Os divisions that use DIV have no loop-free code here
    **{f"sdiv_{n}{d}": ("int", "i", f"a / {s}{d}", lambda a, v=v: quotient(a, v))
       for n, s, d, v in (("", "", 8, 8), ("", "", 2, 2), ("minus_", "-", 4, -4))},
    "srem_8": ("int", "i", "a % 8", lambda a: remainder(a, 8)),
    **{f"udiv32_{d}": ("unsigned long", "L", f"a / {d}", lambda a, d=d: quotient32(a, d)) for d in (10, 1000)},
    "sdiv32_minus_7": ("long", "l", "a / -7", lambda a: signed_quotient32(a, -7)),
    **{f"sdiv32_by_{n}{d}": ("long", "l", f"a / {v}", lambda a, v=v: a / z3.BitVecVal(v, 32))
       for n, d, v in (("", 2, 2), ("", 8, 8), ("minus_", 4096, -4096), ("", 131072, 131072))},
    "srem32_8": ("long", "l", "a % 8", lambda a: z3.SRem(a, z3.BitVecVal(8, 32))),
    # two words multiplied by a signed one
    "mul_long_int": ("long", "li", "a * b", long_by_word),
    "mul_int_long": ("long", "il", "a * b", lambda a, b: long_by_word(b, a)),
    "mul_long_char": ("long", "li", "a * (signed char)b", lambda a, b: long_by_word(a, low_byte(b, True))),
    "mul_long_minus_300": ("long", "l", "a * -300", lambda a: a * z3.BitVecVal(-300, 32)),
    # an index shared by two addresses
    "shared_index": ("int", "uuu", "((const int *)a)[c] + ((const int *)b)[c]",
                     lambda a, b, c: word_at(a + 2 * c) + word_at(b + 2 * c)),
    **branches(),
}  # fmt: skip
DIVIDES = {"sdiv_8", "sdiv_minus_4", "srem_8"}
FAST = {n for n in CASES if n.startswith(("udiv32_", "sdiv32_", "srem32_"))}
"""Cases that are inline code at -O2 and calls at the other levels."""
PRODUCTS = FAST & {"udiv32_10", "udiv32_1000", "sdiv32_minus_7"}
"""Cases with products that the solver treats as opaque values."""
C_TYPES = {"i": "int", "u": "unsigned", "l": "long", "L": "unsigned long", "P": "struct pair"}
PREFACE = "struct pair { int x, y; };\n"


@cache
def compiled(level: str, folder: Path) -> dict[str, list[int]]:
    """Return the linked program words of every case at one level."""
    text = PREFACE
    for name, (result, types, body, _) in CASES.items():
        parameters = ", ".join(f"{C_TYPES[t]} {v}" for t, v in zip(types, "abc", strict=False))
        text += f"{result} {name}({parameters}) {{ return {body}; }}\n"
    text += "typedef void (*any)(void);\nany const volatile all[] = {" + ", ".join(f"(any){n}" for n in CASES) + "};\n"
    source, target = folder / f"rules{level}.c", folder / f"rules{level}.elf"
    source.write_text(text + "int main(void) { return all[0] != 0; }\n")
    assert driver.main([level, "-fno-lto", "-w", "-fverify-machine", str(source), "-o", str(target)]) == 0
    image = emu.load(target, engine="auto").image
    assert image is not None
    found = {}
    for name in CASES:
        place = image.symbols.find("_" + name)
        assert place is not None
        found[name] = [image.word(place.address + k) or 0 for k in range(0, place.size, 2)]
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rules")


def arguments(types: str) -> list[Term]:
    """Return the parameters as terms over their registers (abi-elf.md §2.2)."""
    w, free, out = start().w, list(range(8)), []
    for t in types:
        if t in "iu":
            out.append(w[free.pop(0)])
        else:
            low = next(r for r in free if r % 2 == 0 and r + 1 in free)
            free.remove(low)
            free.remove(low + 1)
            out.append(z3.Concat(w[low + 1], w[low]))
    return out


def levels_of(name: str) -> tuple[str, ...]:
    """Return the levels at which a case is proved: branches at one level, because one selection rule makes them all.

    At -Os, DIV under REPEAT is not loop-free.
    """
    if name in branches():
        return ("-Os",)
    return ("-O2",) if name in FAST else tuple(level for level in LEVELS if level != "-Os" or name not in DIVIDES)


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_rules_hold_for_all_inputs(level: str, folder: Path) -> None:
    """The code computes the C expression for every input and preserves callee-saved registers."""
    code = compiled(level, folder)
    check_all(lambda name: check_rule(name, code[name]), [name for name in CASES if level in levels_of(name)])


def check_rule(name: str, code: list[int]) -> None:
    """Assert that each path of the code gives the result of the case."""
    result, types, _, meaning = CASES[name]
    count = 0
    with unknown_products() if name in PRODUCTS else nullcontext({}) as products:
        wanted = meaning(*arguments(types))
        for state in results(code):
            count += 1
            got = state.w[0] if "long" not in result else z3.Concat(state.w[1], state.w[0])
            kept = z3.And(*(state.w[r] == z3.BitVec(f"w{r}", 16) for r in range(8, 15)))
            solver = z3.Solver()
            solver.add(*(known for _, known in products.values()), *state.path, z3.Or(got != wanted, z3.Not(kept)))
            assert solver.check() == z3.unsat, f"wrong for {solver.model()}"
    assert count > 0


def floor_product(x: Term, m: int, bits: int) -> Term:
    """Return floor(x * m / 2^bits) over unbounded integers."""
    return x * m / z3.IntVal(1 << bits)


def test_upper_half() -> None:
    """The upper half of the sum of four word products is the one that the rules compute.

    The two middle products have the weight 2^16, the top one 2^32.
    """
    lowest, one, other, top = z3.Ints("lowest one other top")
    solver = z3.Solver()
    whole = lowest + 65536 * (one + other) + 65536 * 65536 * top
    solver.add(whole / z3.IntVal(1 << 32) != top + (lowest / 65536 + one + other) / 65536)
    assert solver.check() == z3.unsat


DIVISORS = (3, 5, 7, 10, 11, 60, 641, 1000, 32767, 65537, 1000000007)


def test_products_divide() -> None:
    """Multiplication by the factor of `magic` gives the quotient for every dividend."""
    check_all(check_product, [(d, bits) for d in DIVISORS for bits in (16, 32) if d < 1 << bits - 1])


def check_product(d: int, bits: int) -> None:
    """Prove for one divisor that unsigned and signed factors of `bits` bits give every quotient.
    The divisor is a constant, so that all terms are linear.
    """
    x, half = z3.Int("x"), 1 << bits - 1
    (m, s), (n, t) = unsigned_factor(d, bits), signed_factor(d, bits)
    by_sum = floor_product(x, m - (1 << bits), bits)
    unsigned = floor_product(x, m, bits + s) if m < 1 << bits else ((x - by_sum) / 2 + by_sum) / z3.IntVal(1 << s - 1)
    signed = floor_product(x, n, bits + t) + z3.If(x < 0, 1, 0)
    solver = z3.Solver()
    solver.add(z3.Or(
        z3.And(x >= 0, x < 1 << bits, unsigned != x / z3.IntVal(d)),
        z3.And(x >= -half, x < half, signed != z3.If(x < 0, -(-x / z3.IntVal(d)), x / z3.IntVal(d))),
    ))  # fmt: skip
    assert solver.check() == z3.unsat


def test_a_factor_that_is_too_small_is_refuted() -> None:
    """A factor that is 1 too small is refuted: z3 finds a dividend with a wrong quotient."""
    x, (m, s) = z3.Int("x"), unsigned_factor(10, 32)
    solver = z3.Solver()
    solver.add(x >= 0, x < 1 << 32, floor_product(x, m - 1, 32 + s) != x / z3.IntVal(10))
    assert solver.check() == z3.sat
    found = solver.model()[x].as_long()
    assert found * (m - 1) >> 32 + s != found // 10 == found * m >> 32 + s


WRONG: dict[str, tuple[str, Callable[..., Term]]] = {
    "min16": ("ii", lambda a, b: choose(a > b, a, b)),
    "mul_long_int": ("li", lambda a, b: long_by_word(a, b) + z3.Concat(z3.Extract(15, 0, a), z3.BitVecVal(0, 16))),
    "branch_int_minus_1000_0": ("i", lambda a: choose(z3.ULT(a, -1000), z3.BitVecVal(7, 16), z3.BitVecVal(9, 16))),
    "branch_byte_200_0": ("u", lambda a: choose(low_byte(a, True) < 200, z3.BitVecVal(7, 16), z3.BitVecVal(9, 16))),
    "shared_index": ("uuu", lambda a, b, c: word_at(a + 2 * c) + word_at(b + c)),
    "udiv32_10": ("L", lambda a: z3.LShR(high_half(a, unsigned_factor(10, 32)[0], False), 2)),
    "sdiv32_minus_7": ("l", lambda a: -(high_half(a, signed_factor(7, 32)[0], False) >> 2)),
}


def test_wrong_rules_are_refuted(folder: Path) -> None:
    """A wrong rule is refuted: z3 finds an input for which term and code differ."""

    def check(name: str) -> None:
        types, meaning = WRONG[name]
        wrong = []
        for state in results(compiled("-O2" if name in FAST else "-Os", folder)[name]):
            got = z3.Concat(state.w[1], state.w[0]) if "long" in CASES[name][0] else state.w[0]
            solver = z3.Solver()
            solver.add(*state.path, got != meaning(*arguments(types)))
            wrong.append(solver.check() == z3.sat)
        assert any(wrong)

    check_all(check, WRONG)
