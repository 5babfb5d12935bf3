"""Lazy flags: native code keeps a word per flag and computes the flag from it only where it is read.

Most flags are overwritten before an instruction reads them, and the five flags of a sum would cost more than the sum.
Therefore a variable holds the sum itself (for C, N, Z), or a word with overflow or half carry as one of its bits. Code
computes the flag where an instruction reads it and where native code leaves the function.
"""

from __future__ import annotations

from typing import Final, Literal

from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide

FLAG_ENCODING: Final[dict[str, tuple[Literal["zero", "bit", "above"], int]]] = {
    "C": ("above", 16), "Z": ("zero", 0), "OV": ("bit", 15), "N": ("above", 15), "DC": ("bit", 8),
}  # fmt: skip
"""Property of a flag's word for which the flag counts as set (`values.Origin`)."""


def encode_flag(emitter: Emitter, name: str, value: Number) -> str:
    """Return, as operand text, a word that encodes a flag equal to the truth of `value`."""
    kind, bit = FLAG_ENCODING[name]
    origin = value.origin if isinstance(value, Value) else None
    if origin is not None and origin.kind == kind and origin.bit <= bit:
        return wide(origin.word if origin.bit == bit else origin.word << bit - origin.bit)
    if isinstance(value, int):
        return str((not value) if kind == "zero" else bool(value) << bit)
    flag = Value(emitter, truth(value), True)
    return wide(flag == 0 if kind == "zero" else flag << bit)


def decode_flag(name: str, word: Value) -> Value:
    """Return the flag that `word` encodes, as a truth value."""
    kind, bit = FLAG_ENCODING[name]
    if kind == "zero":
        return word == 0
    return (word >> bit if kind == "above" else word & 1 << bit) != 0
