"""Symbolic meaning of LLVM intrinsics, by LLVM's language reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import z3

from toolchain.ir.model import Instr
from toolchain.proof.ir import floats
from toolchain.proof.ir.effects import Effects
from toolchain.proof.path import Path
from toolchain.proof.runtime_models import bits_set
from toolchain.proof.solver import Undecided
from toolchain.proof.terms import Term, constant_value, one_bit, truth, vector

Meaning = Callable[[Effects, Path, Instr], Any]
MAX_BYTES: Final = 256
"""Greatest size of a copy or fill that is executed byte by byte."""


def base_of(name: str) -> str:
    """Return the name without types: llvm.umin.i16 -> umin."""
    words = name.removeprefix("llvm.").split(".")
    plain = [w for w in words if not (w[:1] in "ipf" and w[1:].isdigit())]
    return ".".join(plain)


def _scalar(e: Effects, path: Path, i: Instr, n: int) -> tuple[Term, Term | None]:
    return e.scalar(path, i.args[n])


def _of_words(make: Callable[..., Term], count: int = 2) -> Meaning:
    """Return the meaning of an intrinsic that is a function of its first operands; it is poison if an operand is."""

    def meaning(e: Effects, path: Path, i: Instr) -> Any:
        parts = [_scalar(e, path, i, n) for n in range(count)]
        poisons = [p for _, p in parts if p is not None]
        return make(*(t for t, _ in parts)), (z3.Or(*poisons) if poisons else None)

    return meaning


def _nothing(e: Effects, path: Path, i: Instr) -> None:
    """Do nothing: the intrinsic is a hint."""


def _assume(e: Effects, path: Path, i: Instr) -> None:
    path.assumptions.append(truth(e.sure(path, i.args[0])))


def _first(e: Effects, path: Path, i: Instr) -> Any:
    return e.value(path, i.args[0])


def _abs(e: Effects, path: Path, i: Instr) -> Any:
    a, p = _scalar(e, path, i, 0)
    return z3.If(a < 0, -a, a), p


def _funnel(left: bool) -> Meaning:
    def meaning(e: Effects, path: Path, i: Instr) -> Any:
        (a, p), (b, q), (n, r) = (_scalar(e, path, i, k) for k in range(3))
        bits = a.size()
        both, amount = z3.Concat(a, b), z3.ZeroExt(bits, z3.URem(n, vector(bits, bits)))
        shifted = (
            z3.Extract(2 * bits - 1, bits, both << amount) if left else z3.Extract(bits - 1, 0, z3.LShR(both, amount))
        )
        poisons = [one for one in (p, q, r) if one is not None]
        return shifted, (z3.Or(*poisons) if poisons else None)

    return meaning


def _swapped(a: Term) -> Term:
    return z3.Concat(*(z3.Extract(k + 7, k, a) for k in range(0, a.size(), 8)))


def _reversed(a: Term) -> Term:
    return z3.Concat(*(z3.Extract(k, k, a) for k in range(a.size())))


def _zeros(a: Term, from_top: bool) -> Term:
    bits = a.size()
    found = vector(bits, bits)
    for k in range(bits) if from_top else range(bits - 1, -1, -1):
        found = z3.If(z3.Extract(k, k, a) == 1, vector(bits - 1 - k if from_top else k, bits), found)
    return found


def _count_zeros(from_top: bool) -> Meaning:
    def meaning(e: Effects, path: Path, i: Instr) -> Any:
        a, p = _scalar(e, path, i, 0)
        if constant_value(e.sure(path, i.args[1])):
            zero = a == 0
            p = zero if p is None else z3.Or(p, zero)
        return _zeros(a, from_top), p

    return meaning


def _checked(op: str) -> Meaning:
    """Return the meaning of an intrinsic with result and overflow bit."""

    def meaning(e: Effects, path: Path, i: Instr) -> Any:
        (a, p), (b, q) = _scalar(e, path, i, 0), _scalar(e, path, i, 1)
        bits, signed = a.size(), op[0] == "s"
        more = bits if op[1:] == "mul" else 1
        extend = z3.SignExt if signed else z3.ZeroExt
        x, y = extend(more, a), extend(more, b)
        whole = {"add": x + y, "sub": x - y, "mul": x * y}[op[1:]]
        result = z3.Extract(bits - 1, 0, whole)
        poisons = [one for one in (p, q) if one is not None]
        poison = z3.Or(*poisons) if poisons else None
        return [(result, poison), (one_bit(whole != extend(more, result)), poison)]

    return meaning


def _saturated(op: str) -> Meaning:
    def meaning(e: Effects, path: Path, i: Instr) -> Any:
        (a, p), (b, q) = _scalar(e, path, i, 0), _scalar(e, path, i, 1)
        bits, signed = a.size(), op[0] == "s"
        extend = z3.SignExt if signed else z3.ZeroExt
        x, y = extend(2, a), extend(2, b)
        whole = x + y if op[1:] == "add" else x - y
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        low_term, high_term = vector(low, bits + 2), vector(high, bits + 2)
        clamped = z3.If(whole < low_term, low_term, z3.If(whole > high_term, high_term, whole))
        poisons = [one for one in (p, q) if one is not None]
        return z3.Extract(bits - 1, 0, clamped), (z3.Or(*poisons) if poisons else None)

    return meaning


def _sign_of(a: Term, b: Term) -> Term:
    sign = vector(1 << a.size() - 1, a.size())
    return (a & ~sign) | (b & sign)


FRACTION_BITS: Final = {32: 23, 64: 52}
"""Number of fraction bits of IEEE 754 single and double precision, by width in bits."""


def _is_class(e: Effects, path: Path, i: Instr) -> Any:
    """Return whether a number is in one of the classes of the mask in the second operand."""
    (a, p), wanted = _scalar(e, path, i, 0), constant_value(e.sure(path, i.args[1]))
    if wanted is None:
        raise Undecided("is.fpclass of a class that is not a constant")
    bits, fraction = a.size(), FRACTION_BITS[a.size()]
    size, quiet = a & vector((1 << bits - 1) - 1, bits), vector(1 << fraction - 1, bits)
    infinite = vector((1 << bits - 1) - (1 << fraction), bits)
    least = vector(1 << fraction, bits)
    zero, normal = size == 0, z3.And(z3.UGE(size, least), z3.ULT(size, infinite))
    subnormal = z3.And(size != 0, z3.ULT(size, least))
    below = z3.Extract(bits - 1, bits - 1, a) == 1
    nan = z3.UGT(size, infinite)
    sizes = [size == infinite, normal, subnormal, zero]
    nans = [z3.And(nan, size & quiet == 0), z3.And(nan, size & quiet != 0)]
    above = [z3.And(z3.Not(below), one) for one in reversed(sizes)]
    classes = [*nans, *(z3.And(below, one) for one in sizes), *above]
    return one_bit(z3.Or(*(one for k, one in enumerate(classes) if wanted >> k & 1))), p


def _copy(e: Effects, path: Path, i: Instr) -> None:
    """Execute memcpy or memmove: all bytes are read before any is written."""
    size = _length(e, path, i)
    if size is None:
        _as_call(e, path, i)
    elif size:
        target, source = (e.sure(path, a) for a in i.args[:2])
        e.access(path, target, size, _is_even(i, 0))
        e.access(path, source, size, _is_even(i, 1))
        if "memcpy" in getattr(i.args[-1], "name", ""):  # memcpy: assume that the operands are equal or do not overlap
            apart = [z3.UGE(one, vector(size, 16)) for one in (target - source, source - target)]
            path.assumptions.append(z3.Or(target == source, z3.And(*apart)))
        path.write(target, path.memory.read(source, size))


def _fill(e: Effects, path: Path, i: Instr) -> None:
    size = _length(e, path, i)
    if size is None:
        _as_call(e, path, i)
    elif size:
        target, byte = (e.sure(path, a) for a in i.args[:2])
        e.access(path, target, size, _is_even(i, 0))
        path.write(target, z3.Concat(*[byte] * size) if size > 1 else byte)


def _is_even(i: Instr, n: int) -> bool:
    attributes = i.extra["attrs"]
    assert isinstance(attributes, list)
    return int(attributes[n].get("align", 1)) > 1


def _length(e: Effects, path: Path, i: Instr) -> int | None:
    size = constant_value(e.sure(path, i.args[2]))
    if constant_value(e.sure(path, i.args[3])):
        raise Undecided("a volatile copy or fill")
    if size is not None and size > MAX_BYTES:
        raise Undecided(f"a copy or fill of {size} bytes")
    return size


def _as_call(e: Effects, path: Path, i: Instr) -> None:
    """Execute a copy or fill of variable size as a call of the library function."""
    name = getattr(i.args[-1], "name", "")
    e.record_call(path, "memset" if "memset" in name else "memcpy" if "memcpy" in name else "memmove", i.args[:3])


INTRINSICS: Final[dict[str, Meaning]] = {
    "lifetime.start": _nothing, "lifetime.end": _nothing, "dbg.value": _nothing, "dbg.declare": _nothing,
    "experimental.noalias.scope.decl": _nothing, "prefetch": _nothing, "assume": _assume, "expect": _first,
    "umin": _of_words(lambda a, b: z3.If(z3.ULT(a, b), a, b)),
    "umax": _of_words(lambda a, b: z3.If(z3.UGT(a, b), a, b)),
    "smin": _of_words(lambda a, b: z3.If(a < b, a, b)), "smax": _of_words(lambda a, b: z3.If(a > b, a, b)),
    "abs": _abs, "fshl": _funnel(True), "fshr": _funnel(False), "bswap": _of_words(_swapped, 1),
    "bitreverse": _of_words(_reversed, 1), "ctpop": _of_words(bits_set, 1), "ctlz": _count_zeros(True),
    "cttz": _count_zeros(False), "memcpy": _copy, "memmove": _copy, "memcpy.inline": _copy, "memset": _fill,
    "fabs": _of_words(lambda a: a & vector((1 << a.size() - 1) - 1, a.size()), 1),
    "copysign": _of_words(_sign_of), "is.fpclass": _is_class,
    "fmuladd": _of_words(lambda a, b, c: floats.arithmetic("fadd", floats.arithmetic("fmul", a, b), c), 3),
    **{f"{op}.with.overflow": _checked(op) for op in ("sadd", "ssub", "smul", "uadd", "usub", "umul")},
    **{f"{op}.sat": _saturated(op) for op in ("sadd", "ssub", "uadd", "usub")},
}  # fmt: skip
"""Meaning by intrinsic name without types."""
