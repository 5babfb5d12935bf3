"""What annotations answer while a program is explored, and why something has no bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from toolchain.bounds.graph import Code, Loop
from toolchain.bounds.state import State

MOVED: Final = "room of a length that is not known is taken from the stack (alloca, array of variable length)"
ELSEWHERE: Final = "returns where nobody called it from (longjmp, a change of stacks)"
LOOP: Final = "no bound of this loop is known"
"""The one reason that leaves the stack bounded: its rounds have been followed until nothing new came of them."""


@dataclass(slots=True)
class Rules:
    """What annotations answer."""

    loop: Callable[[Code, Loop], int | None] = lambda _code, _loop: None
    """Most rounds of a loop beyond its first, per entry."""
    total: Callable[[Code, Loop], int | None] = lambda _code, _loop: None
    """The same of all its entries together."""
    together: Callable[[Code, Loop], dict[int, tuple[str, int]]] = lambda _code, _loop: {}
    """By function: what all loops say that share rounds in one call of it, and how many rounds."""
    scopes: frozenset[int] = frozenset()
    """Functions of whose calls some loop says so."""
    same: Callable[[Code], set[int]] = lambda _code: set()
    """Heads of loops that are one with the loop around them."""
    calls: Callable[[int, State], list[int] | None] = lambda _pc, _state: None
    """Targets of a call through a pointer whose value is not known."""
    times: Callable[[int], dict[int, int]] = lambda _pc: {}
    """By function: how often the call at an address is made in one call of it."""
    never: Callable[[int], bool] = lambda _pc: False
    """Whether the call at an address is not made."""
    without: frozenset[int] = frozenset()
    """Functions that are not called: paths that lead into them are left out."""
    recursion: Callable[[int], int | None] = lambda _entry: None
    """Activations of a function that exist at once."""
    resumed: Callable[[], list[int]] = list
    """Where code goes on that has moved to a stack of somebody else."""
    switches: Callable[[int], bool] = lambda _entry: False
    """Whether a function that returns on a stack that is not known has changed stacks."""
    back: Callable[[int], int | None] = lambda _entry: None
    """Level at which a function that changes stacks comes back, None: it is none."""
