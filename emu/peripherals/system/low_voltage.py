"""Low-voltage detect (§17) and the band-gap flag of RCON (§4)."""

from __future__ import annotations

from typing import Final

from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.interrupt_lines import Interrupts
from emu.system.device import Register
from emu.system.events import NEVER

THRESHOLD_MV: Final = (  # UNVERIFIED: §17 gives only the order of the codes
    1800, 2000, 2200, 2400, 2600, 2800, 2900, 3100, 3400, 3600, 3700, 3900, 4100, 4300, 4600, 1200,
)  # fmt: skip
"""Trip points in mV of the supply for LVDL = 0..14. Code 15 compares the LVDIN pin with the band gap."""
_BAND_GAP_SECONDS: Final = 20e-6
"""Time in s after LVDEN until the band gap is stable: 20 us (§4)."""


class LowVoltageDetect(Peripheral):
    """Low-voltage detect.

    LVDIF rises when the supply falls below the selected threshold. LVDEN and LVDL are in RCON.
    """

    def __init__(self, context: ChipContext, interrupts: Interrupts, rcon: Register, irq: int) -> None:
        super().__init__("lvd", context)
        self._line: Final = interrupts.line(irq)
        self._rcon: Final = rcon
        self._supply: Final = self.cell("supply", "H", 5000)
        self._stable: Final = self.slot("stable", self._band_gap_stable, in_seconds=True)
        self._below: Final = self.cell("below", "B")
        """Result of the last comparison: whether the supply was below the threshold."""
        before = context.bus.on_write[rcon.address >> 1]

        def written(old: int, new: int, lanes: int) -> None:
            if before is not None:
                before(old, new, lanes)
            self._enable_changed()

        rcon.written_by(written)

    def stops_in(self, mode: int) -> bool:
        """Return False: the supply is compared in every power mode."""
        return False

    def set_supply(self, millivolts: int) -> None:
        """Change the supply voltage now, 0..65535 mV; with LVDL = 15, the voltage of LVDIN."""
        self._supply.value = millivolts
        self._compare()

    def _compare(self) -> None:
        """Compare the supply with the threshold after a change of either. On the transition to low, request LVDIF."""
        low = self._is_low
        if low and not self._below.value:
            self._line.request()
        self._below.value = low

    @property
    def _is_low(self) -> bool:
        return (
            bool(self._rcon["LVDEN"] and self._rcon["BGST"]) and self._supply.value < THRESHOLD_MV[self._rcon["LVDL"]]
        )

    def _enable_changed(self) -> None:
        if not self._rcon["LVDEN"]:
            self._rcon["BGST"] = 0
            self.events.cancel(self._stable)
        elif not self._rcon["BGST"] and self.events.due(self._stable) == NEVER:
            self.events.set(self._stable, self.now + 1 + round(_BAND_GAP_SECONDS * self.context.fcy()))
        self._compare()

    def _band_gap_stable(self, _due: int) -> None:
        self._rcon["BGST"] = 1
        self._compare()

    def reset(self, power_on: bool) -> None:
        """Reset. Every reset except power-on keeps RCON, and thus an enabled band gap."""
        self._below.value = self._is_low
        self._enable_changed()
