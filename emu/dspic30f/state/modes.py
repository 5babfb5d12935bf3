"""Processor modes: registers that determine the meaning of instructions, and hence which translations are valid.

An engine that translates stores its code by `Modes.key`, and leaves that code after a write to one of REGISTERS.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

from emu.dspic30f.isa.builder import Context
from emu.dspic30f.state.state import ACCSAT, DA, IF, PSV, RND, SATA, SATB, SATDW, US, State

REGISTERS: Final = (
    "CORCON", "MODCON", "XBREV", "INTCON1", "SPLIM", "SR", "DOSTARTL", "DOSTARTH", "DOENDL", "DOENDH",
)  # fmt: skip
CORCON_MODES: Final = IF | RND | PSV | ACCSAT | SATDW | SATB | SATA | US
TRAP_ENABLES: Final = 7 << 8
"""Bits OVATE, OVBTE and COVTE of INTCON1 (isa.md §14.4)."""


class Key(NamedTuple):
    """The current modes, packed as they are stored in the record."""

    corcon: int
    modcon: int
    reverses: int
    """Bit XBREV.BREN."""
    trap_enables: int
    limit_armed: int
    initialised: int
    loop: tuple[int, int] | None
    """Addresses of the active DO loop's first and last instruction; None if no loop is active."""

    @property
    def context(self) -> Context:
        """Return the modes on which the meaning of an instruction may depend."""
        return context_of(self.corcon, self.modcon, self.reverses, self.trap_enables)


class Modes:
    """Reader of one CPU's modes."""

    def __init__(self, state: State) -> None:
        self._state: Final = state
        names = ("CORCON", "MODCON", "XBREV", "INTCON1", "cpu.limit_armed", "cpu.initialised", "SR")
        self._at: Final = tuple(state.at[name] for name in names)

    def key(self) -> Key:
        """Return the current modes."""
        state = self._state
        u16 = state.u16
        corcon, modcon, xbrev, intcon1, armed, initialised, sr = self._at
        loop = (state.pair("DOSTARTL"), state.pair("DOENDL")) if u16[sr] & DA else None
        return Key(u16[corcon] & CORCON_MODES, u16[modcon], u16[xbrev] >> 15, u16[intcon1] & TRAP_ENABLES,
                   u16[armed], u16[initialised], loop)  # fmt: skip

    @property
    def context(self) -> Context:
        """Return the modes on which the row of the next instruction may depend."""
        u16 = self._state.u16
        corcon, modcon, xbrev, intcon1 = self._at[:4]
        return context_of(u16[corcon] & CORCON_MODES, u16[modcon], u16[xbrev] >> 15, u16[intcon1] & TRAP_ENABLES)


@lru_cache(maxsize=4096)
def context_of(corcon: int, modcon: int, bren: int, intcon1: int) -> Context:
    """Return the modes on which translations may depend, from register values (isa.md §2.4, §2.5, §14.4)."""
    return Context(
        us=corcon >> 12 & 1,
        if_=corcon & 1,
        rnd=corcon >> 1 & 1,
        satdw=corcon >> 5 & 1,
        sata=corcon >> 7 & 1,
        satb=corcon >> 6 & 1,
        accsat=corcon >> 4 & 1,
        psv=corcon >> 2 & 1,
        xmod=modcon >> 15,
        ymod=modcon >> 14 & 1,
        brev=bren,
        xwm=modcon & 15,
        ywm=modcon >> 4 & 15,
        bwm=modcon >> 8 & 15,
        ovate=intcon1 >> 10 & 1,
        ovbte=intcon1 >> 9 & 1,
        covte=intcon1 >> 8 & 1,
    )
