"""Flows: requests of an instruction to the sequencer not to continue with the next word.

A row's function ``does`` returns a flow or None. Addresses are program addresses (23 bits, even). A target or count may
be a static int or a builder value. Only the sequencer changes PC, REPEAT and DO state (isa.md §7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

Value: TypeAlias = Any  # integer type of a builder: int, source expression or LLVM value

PC_MASK: Final = 0x7FFFFE
"""Bits of a program address: PC has 23 bits and is even (isa.md §1.1)."""


@dataclass(frozen=True, slots=True)
class Goto:
    """Continue at ``target``."""

    target: Value


@dataclass(frozen=True, slots=True)
class Branch:
    """Continue at ``target`` if ``cond`` is 1; if it is 0, with the next word."""

    cond: Value
    target: int


@dataclass(frozen=True, slots=True)
class Call:
    """Continue at ``target``; the return address is already on the stack."""

    target: Value


@dataclass(frozen=True, slots=True)
class Return:
    """Continue at the popped ``target``. For RETFIE, it also has the popped SR<7:0> and IPL3 (isa.md §7.4)."""

    kind: Literal["return", "retlw", "retfie"]
    target: Value
    srl: Value = 0
    ipl3: Value = 0


@dataclass(frozen=True, slots=True)
class Skip:
    """Skip the next instruction, of one or two words, if ``cond`` is 1 (isa.md §7.3)."""

    cond: Value


@dataclass(frozen=True, slots=True)
class Repeat:
    """Run the next instruction ``count`` + 1 times, ``count`` 0..16383 (isa.md §7.5)."""

    count: Value


@dataclass(frozen=True, slots=True)
class Do:
    """Run the instructions from the next one to the one at ``end``, ``count`` + 1 times (isa.md §7.6)."""

    count: Value
    end: int


@dataclass(frozen=True, slots=True)
class Sleep:
    """Stop the CPU. "sleep" also stops the clock; "idle" leaves peripherals running (isa.md §11)."""

    mode: Literal["sleep", "idle"]


@dataclass(frozen=True, slots=True)
class Reset:
    """Software device reset (isa.md §11)."""


@dataclass(frozen=True, slots=True)
class Disi:
    """Block interrupts of priority 1-6 in this cycle and the next ``count`` (isa.md §12)."""

    count: int


@dataclass(frozen=True, slots=True)
class ClearWatchdog:
    """Clear the watchdog counter and its prescalers (isa.md §11)."""


Flow: TypeAlias = Goto | Branch | Call | Return | Skip | Repeat | Do | Sleep | Reset | Disi | ClearWatchdog | None
