"""Models of the run-time library functions that implement operations of the IR (abi-elf.md §2.8).

Integer functions are modelled by the operation.  Floating-point functions are uninterpreted: their result depends only
on the operands.  A caller's proof relies on these models; the library's code has proofs and tests of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import z3

from toolchain.abi.arguments import ArgumentShape, argument_locations
from toolchain.proof.terms import Term

Meaning = Callable[..., Term]


@dataclass(frozen=True)
class Helper:
    """Model of a library function: widths of operands and result in bits, and its meaning on such vectors."""

    operands: tuple[int, ...]
    result: int
    meaning: Meaning

    @property
    def result_registers(self) -> range:
        """Return the numbers of the registers that hold the result."""
        return range(self.result // 16)

    def call(self, registers: Sequence[Term]) -> list[Term]:
        """Return the result registers after a call, W0 first."""
        shapes = [ArgumentShape(bits // 16, True) for bits in self.operands]
        values = []
        for place in argument_locations(shapes):
            assert place.register is not None
            words = [registers[place.register + k] for k in range(place.words)]
            values.append(words[0] if len(words) == 1 else z3.Concat(*reversed(words)))
        result = self.meaning(*values)
        return [z3.simplify(z3.Extract(16 * k + 15, 16 * k, result)) for k in self.result_registers]


def opaque(name: str, result: int) -> Meaning:
    """Return an uninterpreted function: equal operands give equal results."""

    def meaning(*operands: Term) -> Term:
        sorts = [z3.BitVecSort(one.size()) for one in operands]
        return z3.Function(name, *sorts, z3.BitVecSort(result))(*operands)

    return meaning


def bits_set(a: Term) -> Term:
    """Return the number of bits of a vector that are 1."""
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
"""Models by assembler name."""
