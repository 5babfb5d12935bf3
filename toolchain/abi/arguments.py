"""Argument placement, abi-elf.md §2.2. Pure arithmetic on sizes; used by callers and by function entry."""

from __future__ import annotations

from dataclasses import dataclass

from toolchain.abi.target import ARGUMENT_REGISTERS, RETURN_ADDRESS_BYTES
from toolchain.ir.model import Type, align_of, size_of


@dataclass(frozen=True, slots=True)
class Place:
    """Where one argument travels: first register, or bytes below the entry W15 of its low end (`stack` > 0)."""

    register: int | None
    words: int
    stack: int = 0


@dataclass(frozen=True, slots=True)
class Shape:
    """What placement needs to know of an argument."""

    words: int
    aligned: bool  # takes a register run aligned to its size (rules 2 and 3)


def scalar_shape(t: Type) -> Shape:
    """Shape of an integer, pointer or floating value (legal type)."""
    words = max(1, (t.bits + 15) // 16)
    return Shape(words, words in (1, 2, 4))


def struct_shape(t: Type, align: int = 0, loose: bool = False) -> Shape:
    """Shape of a struct or union passed by value (rule 3). `align` is C's (0: that of the type); `loose` says that it
    holds an aggregate of 3, 5, 6 or 7 bytes (`record_shapes`)."""
    size = size_of(t)
    return Shape((size + 1) // 2, (align or align_of(t)) >= 2 and size in (2, 4, 8) and not loose)


def place_arguments(shapes: list[Shape], named: int | None = None) -> list[Place]:
    """Rules 1-5: lowest fitting run of W0..W7, back-fill allowed; the rest on the stack in order.

    `named` is the number of named arguments of a variadic function, a hidden result pointer included: the last of them
    and what follows is on the stack."""
    free = [True] * ARGUMENT_REGISTERS
    stack = RETURN_ADDRESS_BYTES
    places = []
    for k, shape in enumerate(shapes):
        if named is not None and k == named - 1:
            free = [False] * ARGUMENT_REGISTERS
        n = shape.words
        if n == 0:
            places.append(Place(None, 0))
            continue
        step = n if shape.aligned else 1
        for first in range(0, ARGUMENT_REGISTERS - n + 1, step):
            if all(free[first : first + n]):
                free[first : first + n] = [False] * n
                places.append(Place(first, n))
                break
        else:
            stack += 2 * n
            places.append(Place(None, n, stack))
    return places
