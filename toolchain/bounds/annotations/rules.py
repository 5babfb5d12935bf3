"""What annotations answer while a program is explored, and why something has no bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from toolchain.bounds.abstract.state import State
from toolchain.bounds.graph import Code, Loop

MOVED: Final = "room of a length that is not known is taken from the stack (alloca, array of variable length)"
ELSEWHERE: Final = "returns where nobody called it from (longjmp, a change of stacks)"
LOOP: Final = "no bound of this loop is known"
LONG: Final = "this loop is followed for 5,000 rounds and no further; say how many there are (LOOP_BOUND)"
MERGED: Final = "several ways lead back to the beginning of this loop: it may be two of the source (ONE_LOOP)"
CUT: Final = "its exploration was cut off: too many ways through it; bound its loops"
DEEP: Final = "calls are followed 480 deep and no further"
EARLY: Final = "ends a DO loop early (CORCON.EDT) that begins elsewhere"
LOOP_REGISTER: Final = "writes a register of the DO loop it is in (DCOUNT, DOSTART, DOEND)"
STACK_POINTER: Final = "may store to W15, by an address that is not known: where the stack goes on is not followed"
TABLE: Final = "this jump may lead past the end of its table of BRA or RETLW"
WAITS: Final = "waits for an interrupt (PWRSAV), for how long is not known"
SLEEPS: Final = "stops the clock (PWRSAV #0): how long it waits and the oscillator takes to start is not known"
NESTED: Final = "a third DO loop within two others: their registers are in no shadow"
ADDRESSING: Final = "turns modulo or bit-reversed addressing on: where pointers lead is not followed"
WAYS_IN: Final = "a DO loop is reached by a branch into it, or out of one within it"
LAST: Final = "a DO loop ends with an instruction that leads elsewhere"
JUMP: Final = "no table of BRA or RETLW is behind this jump"
FOLLOWED: Final = frozenset((LOOP, LONG, MERGED, WAITS, SLEEPS))
"""Reasons that leave the stack bounded: rounds have been followed until nothing new came of them."""


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
    one: Callable[[Code, Loop], bool] = lambda _code, _loop: True
    """Whether a loop is one of the source, so that what notes say of its rounds is of all of them."""
    times: Callable[[int, int], dict[int, tuple[str, int]]] = lambda _pc, _target: {}
    """By function: which call of the source that of a function at an address is, and how often one call makes it."""
    never: Callable[[int, int], bool] = lambda _pc, _target: False
    """Whether the call of a function at an address is not made."""
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
