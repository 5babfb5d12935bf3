"""Register RCON and the watchdog (§4)."""

from __future__ import annotations

from typing import Final

from emu.peripherals.base import IDLE, SLEEP, ChipContext, Peripheral
from emu.peripherals.system.power_rules import any_bit, clear_watchdog, idle, power_operands
from emu.system.events import NEVER
from emu.system.rules import Rule

WDT_HZ: Final = 128_000
"""Prescaler of the watchdog's 8-bit counter, which is clocked by the LPRC (§4)."""
_COUNTER: Final = 256
_PRESCALE_A: Final = (1, 8, 64, 512)

CAUSES: Final = ("TRAPR", "IOPUWR", "EXTR", "SWR", "WDTO", "BOR", "POR")
"""RCON bits that name the cause of a reset (§4)."""


class Resets(Peripheral):
    """RCON: flags of reset causes and of Sleep and Idle. Only software clears them."""

    def __init__(self, context: ChipContext) -> None:
        super().__init__("rcon", context)
        self.rcon: Final = self.register("RCON")

    def stops_in(self, mode: int) -> bool:
        """Return False: this device has no clock."""
        return False

    def record_cause(self, cause: str, kept: int) -> None:
        """Set RCON after a reset by `cause`. `kept` is the previous value. Power-on clears all other bits (§4)."""
        if cause not in CAUSES:
            raise ValueError(f"{cause!r} is not a reset cause; expected one of {', '.join(CAUSES)}")
        if cause == "POR":  # the reset value sets POR and BOR, and LVDL = 0101
            self.rcon.value = self.context.chip.sfrs["RCON"].reset
            return
        self.rcon.value = kept
        self.rcon["SWDTEN"] = 0  # every reset disables a watchdog that software enabled
        self.rcon[cause] = 1


class Watchdog(Peripheral):
    """Watchdog timer, clocked by the LPRC. It resets a running chip and wakes a sleeping one."""

    def __init__(self, context: ChipContext, resets: Resets) -> None:
        super().__init__("wdt", context)
        self._resets: Final = resets
        self._mode: Final = self.cell("mode", "B")
        self._timeout: Final = self.slot("timeout", self._expired, in_seconds=True)
        resets.rcon.written_by(self._rcon_written)
        context.power_mode = lambda: self._mode.value
        fields = context.chip.sfrs["RCON"].fields
        self._swdten, self._sleep = (1 << fields[name][0] for name in ("SWDTEN", "SLEEP"))
        self._operands: Final = power_operands(self.bus.record, context.chip, self._timeout, self._mode.cell)
        self.clearing: Final = Rule(self._operands, fires=clear_watchdog)
        self.idling: Final = Rule(self._operands, fires=idle)

    def stops_in(self, mode: int) -> bool:
        """Return False: the LPRC runs in every power mode."""
        return False

    @property
    def is_enabled(self) -> bool:
        """Whether the watchdog runs: FWDTEN in the configuration word, or SWDTEN."""
        return bool(any_bit(self.bus.integers, self._operands.enables))

    @property
    def stops_devices(self) -> bool:
        """Whether any device is configured to stop in Idle."""
        return bool(any_bit(self.bus.integers, self._operands.stops))

    @property
    def period(self) -> int:
        """Time-out in Tcy: 2 ms x A x B (§4). It is at least 1, because a Tcy may last 8 ms."""
        word = self.context.chip.config["FWDT"]
        stored = self.context.program.setting("FWDT")
        counts = _COUNTER * _PRESCALE_A[word.field(stored, "FWPSA")] * (word.field(stored, "FWPSB") + 1)
        return max(round(counts / WDT_HZ * self.context.fcy()), 1)

    def clear(self, cycle: int) -> None:
        """Handle CLRWDT or PWRSAV in `cycle`: restart counter and prescalers, clear WDTO (§4)."""
        if not self.bus.integers.fire(self.clearing):
            self._resets.rcon.value &= ~self._operands.wdto
            self._arm(cycle)

    def _arm(self, cycle: int) -> None:
        if self.is_enabled:
            self.events.set(self._timeout, cycle + self.period)
        else:
            self.events.cancel(self._timeout)

    def _rcon_written(self, old: int, new: int, _lanes: int) -> None:
        if (old ^ new) & self._swdten and (not self.is_enabled or self.events.due(self._timeout) == NEVER):
            self._arm(self.now)

    def power_mode(self, mode: int) -> None:
        """Record the CPU's power mode: IDLE, SLEEP, or 0 for running."""
        self._mode.value = mode
        if mode:
            self._resets.rcon.value |= self._sleep if mode == SLEEP else self._operands.idle

    def _expired(self, due: int) -> None:
        if self._mode.value in (IDLE, SLEEP):
            self._resets.rcon["WDTO"] = 1
            self._arm(due)
            self.context.cpu_signals.wake()
        else:
            self.context.cpu_signals.reset("WDTO")

    def reset(self, power_on: bool) -> None:
        """Reset: clear the counter and both prescalers (§4)."""
        self._mode.value = 0
        self._arm(self.now)
