"""Clock sources, PLL, postscaler and the OSCCON key sequence (§3). Gives the machine its seconds.

Time everywhere else is in Tcy. A clock switch or a new postscaler changes how long a Tcy is: the seconds passed until
then are kept, in picoseconds, together with the cycle of the change.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.system.events import NEVER

FRC_HZ: Final = 7_370_000
"""Internal fast RC oscillator, untuned (§3)."""
LPRC_HZ: Final = 512_000
"""Internal low-power RC oscillator (§3)."""
LP_HZ: Final = 32_768
"""Secondary oscillator on SOSCI/SOSCO (§2)."""

_LP, _FRC, _LPRC, _EXTERNAL, _PLL = 0, 1, 2, 3, 7
"""FOS, NOSC and COSC codes (§2)."""
_START_PERIODS: Final = 1024
"""Periods the oscillator start-up timer counts (§3)."""
_LOCK_SECONDS: Final = 20e-6  # UNVERIFIED: typical lock time, up to 50 us (§3)
_TUNE: Final = 0.015  # UNVERIFIED: relative change of the FRC per OSCTUN step (§3)
_POST: Final = (1, 4, 16, 64)

_MULTIPLIERS: Final = {  # FPR with FOS = 7: (source, multiplier of its frequency), §2
    0b00001: ("frc", 4.0),
    0b00011: ("frc", 16.0),
    0b01010: ("frc", 8.0),
    0b00101: ("crystal", 4.0),
    0b00110: ("crystal", 8.0),
    0b00111: ("crystal", 16.0),
    0b01101: ("crystal", 4.0),
    0b01110: ("crystal", 8.0),
    0b01111: ("crystal", 16.0),
    0b10001: ("crystal", 2.0),
    0b10010: ("crystal", 4.0),
    0b10011: ("crystal", 8.0),
    0b10101: ("crystal", 4 / 3),
    0b10110: ("crystal", 8 / 3),
    0b10111: ("crystal", 16 / 3),
}

_UNPROGRAMMED: Final = ("crystal", 8.0)
"""Reserved FPR codes, so also an image without configuration words: run as the e-puck's library sets it up (§2)."""

_KEYS: Final = {0xFF00: (0x78, 0x9A), 0x00FF: (0x46, 0x57)}
"""Unlock bytes for OSCCONH and OSCCONL, by byte lane (§3)."""

_PS: Final = 10**12


class Oscillator(Peripheral):
    """OSCCON, OSCTUN and the length of a Tcy."""

    def __init__(self, context: ChipContext) -> None:
        super().__init__("osc", context)
        self.con: Final = self.register("OSCCON")
        self.tun: Final = self.register("OSCTUN")
        sfr = context.chip.sfrs["OSCCON"]
        self._free: Final = sfr.writable
        self._flags: Final = sfr.clear_only
        word = sfr.address >> 1
        self.bus.writable[word] = 0xFFFF  # the hook sees the raw key bytes
        self.bus.clear_only[word] = 0
        self.con.written_by(self._con_written)
        self.tun.written_by(lambda _old, _new, _lanes: self._rate_changed(self.now + 1))
        self._key_lane: Final = self.cell("key_lane", "H")
        self._key_count: Final = self.cell("key_count", "B")
        self._key_cycle: Final = self.cell("key_cycle", "Q")
        self._since: Final = self.cell("since", "Q")
        """Cycle the present Tcy came into force."""
        self._elapsed: Final = self.cell("elapsed", "Q")
        """Picoseconds from power-on to that cycle."""
        self._tcy_fs: Final = self.cell("tcy", "Q")
        """Length of a Tcy in femtoseconds, for reports; `fcy` is exact."""
        self._current: Final = self.cell("current", "Q")
        """Clock selection in force: COSC, POST and OSCTUN packed, so that `fcy` is a function of the record."""
        self._switch: Final = self.slot("switch", self._switched, in_seconds=True)
        self.on_change: Final[list[Callable[[], None]]] = []
        """Called once another `fcy` holds."""
        self.before_change: Final[list[Callable[[], None]]] = []
        """Called while the `fcy` before that still holds."""
        context.fcy = self.fcy

    # -- rates -------------------------------------------------------------------------------------------------------

    def _config(self, name: str) -> int:
        return self.context.chip.config["FOSC"].field(self.context.program.setting("FOSC"), name)

    def _source_hz(self, code: int, tune: int) -> float:
        frc = FRC_HZ * (1 + _TUNE * (tune - 16 if tune & 8 else tune))
        if code == _PLL:
            source, multiplier = _MULTIPLIERS.get(self._config("FPR"), _UNPROGRAMMED)
            return (frc if source == "frc" else self.context.crystal) * multiplier
        return {_LP: LP_HZ, _FRC: frc, _LPRC: LPRC_HZ}.get(code, self.context.crystal)

    def fcy(self) -> float:
        """Instruction cycles per second at present: a quarter of the oscillator behind the postscaler (§3)."""
        packed = self._current.value
        return self._source_hz(packed >> 2 & 7, packed >> 5) / 4 / _POST[packed & 3]

    def seconds(self, cycle: int) -> float:
        """Seconds from power-on to `cycle`, which is not before the last change of the clock."""
        return self._elapsed.value / _PS + (cycle - self._since.value) / self.fcy()

    def _rate_changed(self, cycle: int) -> None:
        for told in self.before_change:
            told()
        self._elapsed.value = round(self.seconds(cycle) * _PS)
        self._since.value = cycle
        before = self.fcy()
        self._current.value = (self.tun.value & 0xF) << 5 | self.con["COSC"] << 2 | self.con["POST"]
        self._tcy_fs.value = round(10**15 / self.fcy())
        self._stretch(cycle, self.fcy() / before)
        for told in self.on_change:
            told()

    def _stretch(self, cycle: int, factor: float) -> None:
        """What is due after a time in seconds takes `factor` times as many Tcy from `cycle` on."""
        if factor == 1:
            return
        for slot in self.context.in_seconds:
            due = self.events.due(slot)
            if cycle < due != NEVER:
                self.events.set(slot, cycle + max(round((due - cycle) * factor), 1))

    # -- OSCCON ------------------------------------------------------------------------------------------------------

    def _con_written(self, old: int, new: int, lanes: int) -> None:
        """Byte writes behind their two key bytes, each in the very next cycle; anything else changes nothing (§3)."""
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
            self.bus.lacks("OSCCON.LPOSCEN, no 32 kHz crystal is fitted: timer 1 counts what others drive on its pin")
        if self.con["OSWEN"] and not old & 1:
            self._request_switch()
        elif not self.con["OSWEN"]:
            self.events.cancel(self._switch)
        if self.con["POST"] != self._current.value & 3:
            self._rate_changed(self.now + 1)

    def _request_switch(self) -> None:
        """FCKSM = 1x ignores the request, OSWEN reads 0 at once (§3). UNVERIFIED on silicon. So does a request for the
        source that runs."""
        if self._config("FCKSM") & 2 or self.con["NOSC"] == self.con["COSC"]:
            self.con["OSWEN"] = 0
            return
        self.events.set(self._switch, self.now + 1 + self._start_tcy(self.con["NOSC"]))

    def _start_tcy(self, code: int) -> int:
        """Present Tcy until a source that was off runs: start-up timer of crystals, then the PLL's lock (§3)."""
        wait = 0.0
        if code in (_LP, _EXTERNAL, _PLL):
            wait = _START_PERIODS / (LP_HZ if code == _LP else self.context.crystal)
        if code == _PLL:
            wait += _LOCK_SECONDS
        return round(wait * self.fcy())

    def wake_tcy(self) -> int:
        """Tcy from the end of Sleep to the first one that counts: the source in force starts anew (§17)."""
        return self._start_tcy(self.con["COSC"])

    def _switched(self, due: int) -> None:
        self._run_from(self.con["NOSC"], due)
        self.con["OSWEN"] = 0

    def _run_from(self, code: int, cycle: int) -> None:
        self.con["COSC"] = code
        self.con["LOCK"] = code == _PLL
        self._rate_changed(cycle)

    def abandon_switch(self) -> None:
        """Sleep and the clock monitor end a switch that is under way; the source in force stays (§3)."""
        self.events.cancel(self._switch)
        self.con["OSWEN"] = 0

    def reselect(self) -> None:
        """A brown-out takes the source of the configuration, as a power-on does. UNVERIFIED: §4 does not say."""
        self.con["NOSC"] = self._config("FOS")
        self._run_from(self.con["NOSC"], self.now)

    def fail(self) -> None:
        """The clock source dies: with the monitor enabled (FCKSM = 00) the chip runs on from the FRC and traps (§3)."""
        if self._config("FCKSM") == 0:
            self.abandon_switch()
            self._run_from(_FRC, self.now + 1)
            self.con["CF"] = 1
            self.context.cpu_signals.trap("OSCFAIL")

    # -- power and reset ---------------------------------------------------------------------------------------------

    def stops_in(self, mode: int) -> bool:
        """Never: it is the clock."""
        return False

    def power_up(self, power_on: bool) -> None:
        """Resets that keep OSCCON keep a switch that is under way (§4)."""
        pending = self.events.due(self._switch)
        super().power_up(power_on)
        if self.con["OSWEN"] and pending != NEVER:
            self.events.set(self._switch, pending)

    def reset(self, power_on: bool) -> None:
        """Power-on takes the source from FOSC; other resets keep it (§4). Emulation starts with the PLL locked."""
        code = self._config("FOS") if power_on else self._current.value >> 2 & 7
        if power_on:
            self.con["NOSC"] = code
        self.con["COSC"] = code
        self.con["LOCK"] = code == _PLL
        self._key_count.value = 0
        if power_on:
            self._current.value = code << 2
            self._elapsed.value = 0
            self._since.value = self.now
        self._rate_changed(self.now)
