"""Locations of arguments in registers and on the stack (abi-elf.md §2.2), computed from their sizes."""

from __future__ import annotations

from dataclasses import dataclass

from toolchain.abi.target import ARGUMENT_REGISTERS, RETURN_ADDRESS_BYTES
from toolchain.ir.model import Type, align_of, size_of


@dataclass(frozen=True, slots=True)
class ArgumentLocation:
    """Location of an argument: its first register, or (`stack` > 0) the bytes from its low end up to W15 at entry."""

    register: int | None
    words: int
    stack: int = 0


@dataclass(frozen=True, slots=True)
class ArgumentShape:
    """Size and alignment of an argument."""

    words: int
    aligned: bool  # whether its first register is a multiple of its size in words (rules 2 and 3)


def scalar_shape(t: Type) -> ArgumentShape:
    """Shape of an integer, pointer or floating value (legal type)."""
    words = max(1, (t.bits + 15) // 16)
    return ArgumentShape(words, words in (1, 2, 4))


def struct_shape(t: Type, align: int = 0, unaligned: bool = False) -> ArgumentShape:
    """Shape of a struct or union passed by value (rule 3).

    `align` is its alignment in C (0: that of the type). `unaligned` is the mark that `struct_alignment` sets."""
    size = size_of(t)
    return ArgumentShape((size + 1) // 2, (align or align_of(t)) >= 2 and size in (2, 4, 8) and not unaligned)


def argument_locations(shapes: list[ArgumentShape], named: int | None = None) -> list[ArgumentLocation]:
    """Locations of all arguments by rules 1-5: the lowest free registers of W0..W7 that fit, else the stack.

    `named` is the number of named arguments of a variadic function, including a hidden result pointer. The last named
    argument and all later ones are on the stack."""
    free = [True] * ARGUMENT_REGISTERS
    stack = RETURN_ADDRESS_BYTES
    locations = []
    for k, shape in enumerate(shapes):
        if named is not None and k == named - 1:
            free = [False] * ARGUMENT_REGISTERS
        n = shape.words
        if n == 0:
            locations.append(ArgumentLocation(None, 0))
            continue
        step = n if shape.aligned else 1
        for first in range(0, ARGUMENT_REGISTERS - n + 1, step):
            if all(free[first : first + n]):
                free[first : first + n] = [False] * n
                locations.append(ArgumentLocation(first, n))
                break
        else:
            stack += 2 * n
            locations.append(ArgumentLocation(None, n, stack))
    return locations
