"""Clock sources, PLL, postscaler and the OSCCON key sequence (§3); conversion of cycles to seconds.

All other modules count time in Tcy. A clock switch or a new postscaler changes the length of a Tcy. At each change the
oscillator stores the elapsed time in picoseconds, together with the cycle of the change.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.system.events import NEVER

FRC_HZ: Final = 7_370_000
"""Frequency in Hz of the internal fast RC oscillator (FRC), untuned (§3)."""
LPRC_HZ: Final = 512_000
"""Frequency in Hz of the internal low-power RC oscillator (LPRC) (§3)."""
LP_HZ: Final = 32_768
"""Frequency in Hz of the secondary oscillator on SOSCI/SOSCO (§2)."""

_LP, _FRC, _LPRC = 0, 1, 2
"""Source codes in FOS, NOSC and COSC (§2). Those of the primary oscillator are in `Chip.clock`."""
_START_PERIODS: Final = 1024
"""Number of periods that the oscillator start-up timer counts (§3)."""
_LOCK_SECONDS: Final = 20e-6  # UNVERIFIED: typical lock time, up to 50 us (§3)
_TUNE: Final = 0.015  # UNVERIFIED: relative change of the FRC per OSCTUN step (§3)
_POST: Final = (1, 4, 16, 64)

_KEYS: Final = {0xFF00: (0x78, 0x9A), 0x00FF: (0x46, 0x57)}
"""Unlock bytes for OSCCONH and OSCCONL, by byte lane mask (§3)."""

_PS: Final = 10**12


class Oscillator(Peripheral):
    """Oscillator: OSCCON, OSCTUN and the length of a Tcy."""

    def __init__(self, context: ChipContext) -> None:
        super().__init__("osc", context)
        self.con: Final = self.register("OSCCON")
        self._tun_in_con: Final = "OSCTUN" not in context.chip.sfrs
        self.tun: Final = self.register("OSCCON" if self._tun_in_con else "OSCTUN")
        self._modes: Final = context.chip.clock
        sfr = context.chip.sfrs["OSCCON"]
        self._free: Final = sfr.writable
        self._flags: Final = sfr.clear_only
        word = sfr.address >> 1
        self.bus.writable[word] = 0xFFFF  # the hook needs the raw key bytes
        self.bus.clear_only[word] = 0
        self.con.written_by(self._con_written)
        if not self._tun_in_con:
            self.tun.written_by(lambda _old, _new, _lanes: self._rate_changed(self.now + 1))
        self._key_lane: Final = self.cell("key_lane", "H")
        self._key_count: Final = self.cell("key_count", "B")
        self._key_cycle: Final = self.cell("key_cycle", "Q")
        self._since: Final = self.cell("since", "Q")
        """Cycle from which the current length of a Tcy applies."""
        self._elapsed: Final = self.cell("elapsed", "Q")
        """Picoseconds from power-on to that cycle."""
        self._tcy_fs: Final = self.cell("tcy", "Q")
        """Length of a Tcy in femtoseconds, for reports only; `fcy` is exact."""
        self._current: Final = self.cell("current", "Q")
        """Current clock selection, packed from COSC, POST and OSCTUN, so that `fcy` is a function of the record."""
        self._switch: Final = self.slot("switch", self._switched, in_seconds=True)
        self.on_change: Final[list[Callable[[], None]]] = []
        """Callbacks called after a change of `fcy`."""
        self.before_change: Final[list[Callable[[], None]]] = []
        """Callbacks called before a change of `fcy`."""
        context.fcy = self.fcy

    # -- rates -------------------------------------------------------------------------------------------------------

    def _config(self, name: str) -> int:
        return self.context.chip.config["FOSC"].field(self.context.program.setting("FOSC"), name)

    def _primary(self) -> tuple[str, float]:
        """Return source and multiplier of the primary oscillator, by FPR."""
        return self._modes.multipliers.get(self._config("FPR"), self._modes.other)

    def _has_pll(self, code: int) -> bool:
        """Whether the PLL runs for a source code."""
        return code == self._modes.pll and self._primary()[1] != 1

    def _source_hz(self, code: int, tune: int) -> float:
        frc = FRC_HZ * (1 + _TUNE * (tune - 16 if tune & 8 else tune))
        if code == self._modes.pll:
            source, multiplier = self._primary()
            return (frc if source == "frc" else self.context.crystal) * multiplier
        return {_LP: LP_HZ, _FRC: frc, _LPRC: LPRC_HZ}.get(code, self.context.crystal)

    def fcy(self) -> float:
        """Return the current instruction cycles per second: a quarter of the postscaled oscillator frequency (§3)."""
        packed = self._current.value
        return self._source_hz(packed >> 2 & 7, packed >> 5) / 4 / _POST[packed & 3]

    def seconds(self, cycle: int) -> float:
        """Return the seconds from power-on to `cycle`, which must not precede the last clock change."""
        return self._elapsed.value / _PS + (cycle - self._since.value) / self.fcy()

    def _tuning(self) -> int:
        """Return the tuning of the FRC, which is in OSCTUN or, on parts without it, in OSCCON."""
        return sum(self.tun[f"TUN{bit}"] << bit for bit in range(4))

    def _rate_changed(self, cycle: int) -> None:
        for callback in self.before_change:
            callback()
        self._elapsed.value = round(self.seconds(cycle) * _PS)
        self._since.value = cycle
        before = self.fcy()
        self._current.value = self._tuning() << 5 | self.con["COSC"] << 2 | self.con["POST"]
        self._tcy_fs.value = round(10**15 / self.fcy())
        self._reschedule(cycle, self.fcy() / before)
        for callback in self.on_change:
            callback()

    def _reschedule(self, cycle: int, factor: float) -> None:
        """Scale the remaining delays of slots timed in seconds, from `cycle` on, by `factor`."""
        if factor == 1:
            return
        for slot in self.context.in_seconds:
            due = self.events.due(slot)
            if cycle < due != NEVER:
                self.events.set(slot, cycle + max(round((due - cycle) * factor), 1))

    # -- OSCCON ------------------------------------------------------------------------------------------------------

    def _con_written(self, old: int, new: int, lanes: int) -> None:
        """Handle a write to OSCCON. Only a byte write immediately after its two key bytes has an effect (§3)."""
        self.con.value = old
        if lanes not in _KEYS:
            self._key_count.value = 0
            return
        byte = new >> 8 if lanes == 0xFF00 else new & 0xFF
        stage = self._key_count.value
        if stage and (self._key_lane.value != lanes or self.now != self._key_cycle.value + 1):
            stage = 0
        if stage == 2:
            self._key_count.value = 0
            self._accept(old, new, lanes)
            return
        self._key_count.value = stage + 1 if byte == _KEYS[lanes][stage] else 0
        self._key_lane.value = lanes
        self._key_cycle.value = self.now

    def _accept(self, old: int, new: int, lanes: int) -> None:
        free = self._free & lanes
        flags = self._flags & lanes
        self.con.value = (old & ~free | new & free) & (new | ~flags)
        if self.con["LPOSCEN"]:
            self.bus.report_unmodelled(
                "OSCCON.LPOSCEN: no 32 kHz crystal is fitted; timer 1 counts edges driven on its pin"
            )
        if self.con["OSWEN"] and not old & 1:
            self._request_switch()
        elif not self.con["OSWEN"]:
            self.events.cancel(self._switch)
        if self.con["POST"] != self._current.value & 3 or self._tuning() != self._current.value >> 5:
            self._rate_changed(self.now + 1)

    def _request_switch(self) -> None:
        """Start a clock switch.

        UNVERIFIED: with FCKSM = 1x, or for the current source, OSWEN reads 0 immediately (§3).
        """
        if self._config("FCKSM") & 2 or self.con["NOSC"] == self.con["COSC"]:
            self.con["OSWEN"] = 0
            return
        self.events.set(self._switch, self.now + 1 + self._start_tcy(self.con["NOSC"]))

    def _start_tcy(self, code: int) -> int:
        """Return the start-up time of a source in current Tcy: start-up timer for crystals, then PLL lock (§3)."""
        wait = 0.0
        if code in (_LP, self._modes.external, self._modes.pll):
            wait = _START_PERIODS / (LP_HZ if code == _LP else self.context.crystal)
        if self._has_pll(code):
            wait += _LOCK_SECONDS
        return round(wait * self.fcy())

    def wake_tcy(self) -> int:
        """Return the Tcy from the end of Sleep to the first instruction cycle, for the source's restart (§17)."""
        return self._start_tcy(self.con["COSC"])

    def _switched(self, due: int) -> None:
        self._run_from(self.con["NOSC"], due)
        self.con["OSWEN"] = 0

    def _run_from(self, code: int, cycle: int) -> None:
        self.con["COSC"] = code
        self.con["LOCK"] = self._has_pll(code)
        self._rate_changed(cycle)

    def abandon_switch(self) -> None:
        """Abort a running clock switch (Sleep, clock monitor); keep the current source (§3)."""
        self.events.cancel(self._switch)
        self.con["OSWEN"] = 0

    def reselect(self) -> None:
        """Handle a brown-out. UNVERIFIED: it selects the configured source, as power-on does; §4 does not say so."""
        self.con["NOSC"] = self._config("FOS")
        self._run_from(self.con["NOSC"], self.now)

    def fail(self) -> None:
        """Simulate a clock failure: with FCKSM = 00 the chip switches to the FRC and traps (§3)."""
        if self._config("FCKSM") == 0:
            self.abandon_switch()
            self._run_from(_FRC, self.now + 1)
            self.con["CF"] = 1
            self.context.cpu_signals.trap("OSCFAIL")

    # -- power and reset ---------------------------------------------------------------------------------------------

    def stops_in(self, mode: int) -> bool:
        """Return False: this device is the clock source."""
        return False

    def power_up(self, power_on: bool) -> None:
        """Reset. A reset that keeps OSCCON also keeps a running clock switch (§4)."""
        pending = self.events.due(self._switch)
        super().power_up(power_on)
        if self.con["OSWEN"] and pending != NEVER:
            self.events.set(self._switch, pending)

    def reset(self, power_on: bool) -> None:
        """Reset. Power-on selects the source in FOSC; other resets keep the current one (§4).

        The emulation starts with the PLL locked.
        """
        code = self._config("FOS") if power_on else self._current.value >> 2 & 7
        if power_on:
            self.con["NOSC"] = code
        self.con["COSC"] = code
        self.con["LOCK"] = self._has_pll(code)
        self._key_count.value = 0
        if power_on:
            self._current.value = code << 2
            self._elapsed.value = 0
            self._since.value = self.now
        self._rate_changed(self.now)
