"""Functions of the run-time library that stand for an operation of the IR, as what they are documented to give back
(abi-elf.md §2.8): on integers what the operation means, of floating point a number that depends on the operands only.

That the library's code does so is not assumed by the proof of a caller to be right: it has proofs and tests of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import z3

from toolchain.abi.arguments import Shape, place_arguments
from toolchain.proof.terms import Term

Meaning = Callable[..., Term]


@dataclass(frozen=True)
class Helper:
    """Widths of its operands in bits, and of the result; the meaning on vectors of those widths."""

    operands: tuple[int, ...]
    result: int
    meaning: Meaning

    @property
    def gives(self) -> range:
        """Registers of the result."""
        return range(self.result // 16)

    def call(self, registers: Sequence[Term]) -> list[Term]:
        """What the result registers hold behind it, W0 first."""
        shapes = [Shape(bits // 16, True) for bits in self.operands]
        values = []
        for place in place_arguments(shapes):
            assert place.register is not None
            words = [registers[place.register + k] for k in range(place.words)]
            values.append(words[0] if len(words) == 1 else z3.Concat(*reversed(words)))
        result = self.meaning(*values)
        return [z3.simplify(z3.Extract(16 * k + 15, 16 * k, result)) for k in self.gives]


def opaque(name: str, result: int) -> Meaning:
    """A function nothing is known of but that equal operands give equal results."""

    def meaning(*operands: Term) -> Term:
        sorts = [z3.BitVecSort(one.size()) for one in operands]
        return z3.Function(name, *sorts, z3.BitVecSort(result))(*operands)

    return meaning


def bits_set(a: Term) -> Term:
    """How many bits of a vector are 1."""
    total = z3.BitVecVal(0, a.size())
    for k in range(a.size()):
        total = total + z3.ZeroExt(a.size() - 1, z3.Extract(k, k, a))
    return total


def _all() -> dict[str, Helper]:
    out: dict[str, Helper] = {"___muldi3": Helper((64, 64), 64, lambda a, b: a * b)}
    out["___popcounthi2"] = Helper((16,), 16, bits_set)
    for mode, bits in (("si", 32), ("di", 64)):
        for name, meaning in (
            ("udiv", z3.UDiv), ("umod", z3.URem), ("div", lambda a, b: a / b), ("mod", z3.SRem),
        ):  # fmt: skip
            out[f"___{name}{mode}3"] = Helper((bits, bits), bits, meaning)
    for mode, bits in (("sf", 32), ("df", 64)):
        for name in ("add", "sub", "mul", "div"):
            out[f"___{name}{mode}3"] = Helper((bits, bits), bits, opaque(f"__{name}{mode}3", bits))
        for name in ("eq", "ne", "lt", "le", "gt", "ge", "unord"):
            out[f"___{name}{mode}2"] = Helper((bits, bits), 16, opaque(f"__{name}{mode}2", 16))
        for integer, width in (("si", 32), ("di", 64)):
            for unsigned in ("", "un"):
                name = f"__float{unsigned}{integer}{mode}"
                out["_" + name] = Helper((width,), bits, opaque(name, bits))
            for unsigned in ("", "uns"):
                name = f"__fix{unsigned}{mode}{integer}"
                out["_" + name] = Helper((bits,), width, opaque(name, width))
    out["___extendsfdf2"] = Helper((32,), 64, opaque("__extendsfdf2", 64))
    out["___truncdfsf2"] = Helper((64,), 32, opaque("__truncdfsf2", 32))
    return out


HELPERS: Final = _all()
"""By assembler name."""
