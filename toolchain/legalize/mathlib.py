"""Intrinsics that become calls of math.h functions."""

from __future__ import annotations

from toolchain.ir.build import legal_type
from toolchain.ir.model import Instr, UnsupportedError, size_of
from toolchain.legalize.context import LegalResult
from toolchain.legalize.memory import MemoryLegalizer

SAME_NAME = {
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2", "log", "log2",
    "log10", "pow", "floor", "ceil", "trunc", "rint", "nearbyint", "round", "roundeven", "fma", "ldexp",
    "lrint", "llrint", "lround", "llround",
}  # fmt: skip
RENAMED = {"minnum": "fmin", "maxnum": "fmax", "minimumnum": "fmin", "maximumnum": "fmax"}
TWO_RESULTS = {"modf", "frexp"}  # functions that store a second result through a pointer


def expand(lz: MemoryLegalizer, i: Instr, base: str) -> LegalResult:
    """Build the call of the math.h function for intrinsic llvm.BASE. Raise UnsupportedError if there is none."""
    stem = base.split(".")[0]
    suffix = "f" if i.args[0].type.bits == 32 else ""
    args = [lz.legal(a) for a in i.args[:-1]]
    if stem in TWO_RESULTS:
        first, second = i.type.elems
        slot = lz.frame_slot(size_of(second))
        result = lz.b.call(stem + suffix, legal_type(first), [*args, slot])
        return [result, lz.b.load(legal_type(second), slot)]
    if stem == "sincos":
        return [lz.b.call(name + suffix, legal_type(i.type.elems[0]), args) for name in ("sin", "cos")]
    if stem in SAME_NAME or stem in RENAMED:
        return lz.b.call(RENAMED.get(stem, stem) + suffix, legal_type(i.type), args)
    raise UnsupportedError(f"intrinsic llvm.{base}")
