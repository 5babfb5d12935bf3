"""`Solver`: the impulse solver of a step, without calls that change nothing (solver.c).

It reads structs that Chipmunk keeps private, so it is used only with a library whose structs are known. With every
other version the library's own loop runs, which gives the same numbers and takes longer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from ctypes import CDLL, Structure, addressof, c_int32, c_int64, c_uint64, c_void_p, cast, sizeof
from functools import cache
from pathlib import Path
from typing import Any, Final

import pymunk
from pymunk import _chipmunk

from emu.native_library import ADDRESS, DOUBLE, address_of, functions

KNOWN_LIBRARIES: Final = ("2.0.1-ade7ed72849e60289eefb7a41e79ae6322fefaf3",)
"""Versions of Chipmunk, as `pymunk.chipmunk_version` names them, that have the structs of solver.c."""
CONTACTS_PER_BODY: Final = 4
"""Contacts of which the solver remembers whether they are settled, for each body."""


class _Settled(Structure):
    """`struct settled` of solver.c."""

    _fields_ = [("is_settled", c_int64), ("velocities", c_uint64 * 12)]


class _Solver(Structure):
    """`struct solver` of solver.c."""

    _fields_ = [("apply_arbiter", c_void_p), ("pivot", c_void_p), ("iterations", c_int64), ("room", c_int64),
                ("settled", c_void_p)]  # fmt: skip


class Solver:
    """Solver of a space with `bodies` bodies that move; `pivots` are the addresses of its joints that hold a point."""

    def __init__(self, pivots: Iterable[int], bodies: int, iterations: int) -> None:
        room = (CONTACTS_PER_BODY + 2) * bodies
        self._settled: Final = (_Settled * room)()
        kinds = {c_void_p.from_address(pivot).value for pivot in pivots}
        assert len(kinds) < 2, "joints of one class have one table of functions"
        self._struct: Final = _Solver(_apply_arbiter(), next(iter(kinds), None), iterations, room,
                                      addressof(self._settled))  # fmt: skip
        self.address: Final = addressof(self._struct)
        self.function: Final = address_of(_code()["solve"])


def replace_own(space: int, pivots: Iterable[int], bodies: int, iterations: int) -> Solver | None:
    """Let the space at address `space` make no iterations, and return the solver to call after each of its steps.

    Return None, and change nothing, if the library is not known."""
    if not is_usable():
        return None
    own = c_int32.from_address(space)
    assert own.value == iterations, "the number of iterations is the first field of the space"
    own.value = 0  # the library's function for it refuses 0
    return Solver(pivots, bodies, iterations)


def is_usable() -> bool:
    """Whether the structs of the installed library are those of solver.c and its functions can be found."""
    return pymunk.chipmunk_version in KNOWN_LIBRARIES and sizeof(c_void_p) == 8 and _apply_arbiter() is not None


@cache
def _apply_arbiter() -> int | None:
    """Return the address of the library's function that applies a contact; None if the library hides it."""
    try:
        return cast(CDLL(_chipmunk.__file__).cpArbiterApplyImpulse, c_void_p).value
    except (OSError, AttributeError):
        return None


@cache
def _code() -> dict[str, Callable[..., Any]]:
    """Return the function of solver.c."""
    return functions(Path(__file__).with_name("solver.c"), {"solve": (None, (ADDRESS, ADDRESS, DOUBLE))})
