"""Floating-point operations of the IR as uninterpreted functions, named as in the run-time library (abi-elf.md §2.8).

The mapping from operations to library functions is independent of the one in the back end. The proof therefore checks
that the back end calls the correct function with the correct operands.
"""

from __future__ import annotations

from typing import Final

import z3

from toolchain.proof.runtime_models import opaque
from toolchain.proof.solver import Undecided
from toolchain.proof.terms import Term, one_bit, vector

MODES: Final = {32: "sf", 64: "df"}
SUMS: Final = {"fadd": "add", "fsub": "sub", "fmul": "mul", "fdiv": "div"}
ORDERED: Final = {"oeq": "eq", "une": "ne", "olt": "lt", "ole": "le", "ogt": "gt", "oge": "ge"}
"""By predicate: comparison function. Its result relates to 0 as the operands to each other; NaN yields false."""
NEGATED: Final = {"ult": "oge", "ule": "ogt", "ugt": "ole", "uge": "olt"}


def arithmetic(op: str, a: Term, b: Term) -> Term:
    """Return the result of fadd, fsub, fmul or fdiv."""
    mode = MODES[a.size()]
    return opaque(f"__{SUMS[op]}{mode}3", a.size())(a, b)


def compared(pred: str, a: Term, b: Term) -> Term:
    """Return the result of fcmp as one bit; raises Undecided for an unknown predicate."""
    if pred in NEGATED:
        return ~compared(NEGATED[pred], a, b)
    mode = MODES[a.size()]
    if pred in ("uno", "ord"):
        unordered = one_bit(opaque(f"__unord{mode}2", 16)(a, b) != 0)
        return unordered if pred == "uno" else ~unordered
    if pred in ("ueq", "one"):
        either = compared("uno", a, b) | compared("oeq", a, b)
        return either if pred == "ueq" else ~either
    if pred not in ORDERED:
        raise Undecided(f"the comparison {pred}")
    name = ORDERED[pred]
    result, zero = opaque(f"__{name}{mode}2", 16)(a, b), vector(0, 16)
    relations = {"eq": result == zero, "ne": result != zero, "lt": result < zero, "le": result <= zero,
              "gt": result > zero, "ge": result >= zero}  # fmt: skip
    return one_bit(relations[name])


def converted(op: str, a: Term, bits: int) -> Term:
    """Return the result of a conversion between floating point and integers, or between floating-point widths."""
    if op in ("fpext", "fptrunc"):
        return opaque("__extendsfdf2" if op == "fpext" else "__truncdfsf2", bits)(a)
    signed = op in ("sitofp", "fptosi")
    if op in ("sitofp", "uitofp"):
        width = 32 if a.size() <= 32 else 64
        wide = (z3.SignExt if signed else z3.ZeroExt)(width - a.size(), a)
        unsigned = "" if signed or a.size() < width else "un"  # narrower values are never negative
        return opaque(f"__float{unsigned}{'si' if width == 32 else 'di'}{MODES[bits]}", bits)(wide)
    width = 32 if bits <= 32 else 64
    name = f"__fix{'' if signed else 'uns'}{MODES[a.size()]}{'si' if width == 32 else 'di'}"
    return z3.Extract(bits - 1, 0, opaque(name, width)(a))
