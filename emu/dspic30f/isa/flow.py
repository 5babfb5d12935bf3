"""Flows: requests of an instruction to the sequencer, other than to continue with the next word.

The function ``does`` of a row returns one of these, or None. Addresses are program addresses (23 bit, even); a target
or count may be a static int or a builder value. The sequencer alone changes PC, REPEAT and DO state (isa.md §7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

Value: TypeAlias = Any  # integer type of a builder: int, source expression or LLVM value


@dataclass(frozen=True, slots=True)
class Goto:
    """Continue at ``target``."""

    target: Value


@dataclass(frozen=True, slots=True)
class Branch:
    """Continue at ``target`` if ``cond`` (0 or 1), else with the next word."""

    cond: Value
    target: int


@dataclass(frozen=True, slots=True)
class Call:
    """Continue at ``target``; the return address is already on the stack."""

    target: Value


@dataclass(frozen=True, slots=True)
class Return:
    """Continue at the popped ``target``. RETFIE also carries the popped SR<7:0> and IPL3 (isa.md §7.4)."""

    kind: Literal["return", "retlw", "retfie"]
    target: Value
    srl: Value = 0
    ipl3: Value = 0


@dataclass(frozen=True, slots=True)
class Skip:
    """Discard the next instruction, one or two words, if ``cond`` (isa.md §7.3)."""

    cond: Value


@dataclass(frozen=True, slots=True)
class Repeat:
    """Run the next instruction ``count`` + 1 times, ``count`` 0..16383 (isa.md §7.5)."""

    count: Value


@dataclass(frozen=True, slots=True)
class Do:
    """Run from the next instruction to the one at ``end``, ``count`` + 1 times (isa.md §7.6)."""

    count: Value
    end: int


@dataclass(frozen=True, slots=True)
class Sleep:
    """Stop the CPU: "sleep" stops the clock too, "idle" leaves peripherals running (isa.md §11)."""

    mode: Literal["sleep", "idle"]


@dataclass(frozen=True, slots=True)
class Reset:
    """Software device reset (isa.md §11)."""


@dataclass(frozen=True, slots=True)
class Disi:
    """Block priorities 1-6 in this cycle and the next ``count`` (isa.md §12)."""

    count: int


@dataclass(frozen=True, slots=True)
class ClearWatchdog:
    """Clear the watchdog counter and its prescalers (isa.md §11)."""


Flow: TypeAlias = Goto | Branch | Call | Return | Skip | Repeat | Do | Sleep | Reset | Disi | ClearWatchdog | None
