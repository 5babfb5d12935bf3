"""Flags as native code carries them: not the bit, but a word it can be made from, mostly one that is there anyway.

Most flags are overwritten before anybody asks: of a sum that is all five, whose bits would cost more than the sum. So a
variable holds the sum itself (C, N, Z) or what overflow and half carry are a bit of; the bit is made where it is read,
and where code leaves. In: what a row says a flag is. Out: the word to keep, and the flag's truth from such a word.
"""

from __future__ import annotations

from typing import Final, Literal

from emu.dspic30f.jit.translate.values import Emitter, Number, Value, truth, wide

PLACES: Final[dict[str, tuple[Literal["zero", "bit", "above"], int]]] = {
    "C": ("above", 16), "Z": ("zero", 0), "OV": ("bit", 15), "N": ("above", 15), "DC": ("bit", 8),
}  # fmt: skip
"""By flag, what of its word says that it is set (`values.Origin`)."""


def carried(emitter: Emitter, name: str, value: Number) -> str:
    """The word that carries a flag, as operand text."""
    kind, place = PLACES[name]
    origin = value.origin if isinstance(value, Value) else None
    if origin is not None and origin.kind == kind and origin.place <= place:
        return wide(origin.word if origin.place == place else origin.word << place - origin.place)
    if isinstance(value, int):
        return str((not value) if kind == "zero" else bool(value) << place)
    bit = Value(emitter, truth(value), True)
    return wide(bit == 0 if kind == "zero" else bit << place)


def told(name: str, word: Value) -> Value:
    """The flag, from the word that carries it."""
    kind, place = PLACES[name]
    if kind == "zero":
        return word == 0
    return (word >> place if kind == "above" else word & 1 << place) != 0
