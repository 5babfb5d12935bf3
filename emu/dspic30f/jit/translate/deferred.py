"""What an instruction that is being translated will do, until all of its addresses have been probed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from emu.dspic30f.isa.builder import Size
from emu.dspic30f.jit.translate.values import Number, Value


class Store(NamedTuple):
    """A store to an address that is `in_ram` or a register's."""

    address: Value
    value: Number
    size: Size
    in_ram: Value


@dataclass
class Pending:
    """What the instruction being translated will commit."""

    w: dict[int, Number] = field(default_factory=dict)
    flags: dict[str, Number] = field(default_factory=dict)
    acc: dict[int, Number] = field(default_factory=dict)
    registers: dict[str, Number] = field(default_factory=dict)
    stores: list[Callable[[], None]] = field(default_factory=list)
    initialises: int = 0
    psv: list[Value] = field(default_factory=list)
    """Truth values: the instruction read the PSV window."""
    stop: bool = False
    """The next boundary must look at interrupts."""
    replanned: bool = False
    """The deadline may have come nearer: the function must be left."""
    touches_sfr: bool = False
    """An SFR that events may change, or that devices hear of, is accessed."""
    taken: bool = False
    """A device changes because it is read."""
    sr: tuple[Number, int] | None = None
    """A data write to SR: what, and to which bits."""
    pointed: Store | None = None
    """A store of which only the address that it has when it is made says whether it is to RAM or to a register."""
    left: Value | None = None
    """Truth value: it was to a register, whose device may have asked for attention. The function must be left."""
    mapped: int = 0
    """W registers written through their data addresses: stall sources like any written register."""
