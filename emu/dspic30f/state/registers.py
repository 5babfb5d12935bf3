"""Core registers whose reads or writes have side effects (isa.md §2).

They are hooked on the bus like device registers. Engines read the stored values of CORCON, MODCON and XBREV directly,
so these registers need no read hooks.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from emu.dspic30f.state.state import DA, EDT, IPL_MASK, SA, SAB, SB, State
from emu.system.bus import Bus
from emu.system.events import Events

NSTDIS: Final = 1 << 15
"""NSTDIS bit, INTCON1<15> (isa.md §14.4)."""
GUARD_SIGN: Final = 0x80
"""Bit 39 of an accumulator, as a bit of ACCxU."""


class CoreRegisters:
    """Bus hooks of SR, CORCON, SPLIM, ACCxU, PCL/PCH, DISICNT and the modulo end registers."""

    def __init__(self, state: State, bus: Bus, events: Events) -> None:
        self._state: Final = state
        self._u16: Final = state.u16
        self._events: Final = events
        for name in state.at:
            if not name.startswith(("cpu.", "W")) and state.at[name] <= state.at["DISICNT"]:
                bus.modelled[state.at[name]] = True
        bus.on_write[state.at["SR"]] = self._sr_written
        bus.on_write[state.at["CORCON"]] = self._corcon_written
        bus.on_write[state.at["SPLIM"]] = self._limit_written
        bus.on_write[state.at["DISICNT"]] = self._disicnt_written
        bus.compute[state.at["DISICNT"]] = self.disicnt
        bus.compute[state.at["PCL"]] = lambda: state.pc & 0xFFFF
        bus.compute[state.at["PCH"]] = lambda: state.pc >> 16
        for name in ("ACCAU", "ACCBU"):
            bus.compute[state.at[name]] = partial(self._sign_extended, state.at[name])
        for name in ("XMODEND", "YMODEND"):
            bus.on_write[state.at[name]] = partial(self._made_odd, state.at[name])

    def disicnt(self) -> int:
        """Return the number of cycles for which DISI still blocks, as read in the current cycle (isa.md §12)."""
        return max(0, self._state.disi_end - self._events.now)

    def _disicnt_written(self, _old: int, new: int, lanes: int) -> None:
        """Handle a write of DISICNT. Writing 0 ends the blocking, so that the next boundary accepts (isa.md §12)."""
        state = self._state
        count = (self.disicnt() & ~lanes | new & lanes) & 0x3FFF
        now = self._events.now
        self._u16[state.at["DISICNT"]] = count
        state.disi_end = now + 1 + count if count else min(state.disi_end, now)
        self._events.kick()

    def _sr_written(self, old: int, new: int, _lanes: int) -> None:
        """Handle a write of SR. IPL is read-only under NSTDIS; clearing SAB clears SA and SB (isa.md §2.3)."""
        if self._state.intcon1 & NSTDIS:
            new = new & ~IPL_MASK | old & IPL_MASK
        if old & SAB and not new & SAB:
            new &= ~(SA | SB)
        self._state.sr = new | SAB if new & (SA | SB) else new & ~SAB
        self._events.kick()

    def _corcon_written(self, _old: int, new: int, _lanes: int) -> None:
        """Handle a write of CORCON, which may clear IPL3. EDT is stored as hidden state and reads 0 (isa.md §2.4)."""
        if new & EDT:
            self._state.corcon = new & ~EDT
            if self._state.sr & DA and not self._state.edt:
                self._state.edt = 1
        self._events.kick()

    def _limit_written(self, _old: int, _new: int, lanes: int) -> None:
        """Enable the stack limit at the first word write of SPLIM (isa.md §10.2)."""
        if lanes == 0xFFFF:
            self._state.limit_armed = 1

    def _sign_extended(self, index: int) -> int:
        """Return ACCxU with bit 39 copied into its upper bits (isa.md §2.1)."""
        return (self._u16[index] & 0xFF ^ GUARD_SIGN) - GUARD_SIGN & 0xFFFF

    def _made_odd(self, index: int, _old: int, _new: int, _lanes: int) -> None:
        """Set bit 0 of XMODEND or YMODEND, which always reads as 1 (isa.md §2.1)."""
        self._u16[index] |= 1
