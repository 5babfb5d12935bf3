"""Deferred effects of the instruction being translated, committed after all its addresses have been checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from emu.dspic30f.isa.builder import Size
from emu.dspic30f.jit.ir.values import Number, Value


class IndirectStore(NamedTuple):
    """A store whose address is known only at run time: to RAM if `in_ram` holds, else to an SFR."""

    address: Value
    value: Number
    size: Size
    in_ram: Value


@dataclass
class DeferredEffects:
    """Effects that the instruction will commit, and their consequences for the code after it."""

    w: dict[int, Number] = field(default_factory=dict)
    flags: dict[str, Number] = field(default_factory=dict)
    acc: dict[int, Number] = field(default_factory=dict)
    registers: dict[str, Number] = field(default_factory=dict)
    stores: list[Callable[[], None]] = field(default_factory=list)
    ram_stores: list[tuple[Number, int]] = field(default_factory=list)
    """Address and size in bytes of each store that may hit RAM."""
    initialises: int = 0
    psv_reads: list[Value] = field(default_factory=list)
    """For each load, a truth value: whether it read the PSV window."""
    check_interrupts: bool = False
    """Whether an interrupt may have become acceptable at the next boundary."""
    deadline_moved: bool = False
    """Whether the deadline may have moved nearer, so that native code must leave the function."""
    touches_sfr: bool = False
    """Whether the instruction accesses an SFR that events may change, or whose writes a device observes."""
    read_effect: bool = False
    """Whether a read changes a device's state."""
    sr: tuple[Number, int] | None = None
    """Value and bit mask of a data write to SR."""
    indirect_store: IndirectStore | None = None
    sfr_written: Value | None = None
    """Truth value: whether the indirect store hit an SFR, so that native code must leave the function."""
    mapped_w: int = 0
    """W registers written through their data addresses. They cause stalls like any written register."""
