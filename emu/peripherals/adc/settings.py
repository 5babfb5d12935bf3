"""Decoded settings from the ADC's control registers, and their copy in the record for native code.

Native code completes a whole conversion sequence itself if `adc.native` is set. That requires automatic sampling
and conversion, one multiplexer, the supplies as references, and unsigned integer results.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.peripherals.base import Peripheral
from emu.system.events import NEVER
from emu.system.rules import Cell

SHORTEST_SAMPLING: Final = 2
"""Minimum sampling time for native code, in half Tcy. A shorter one could put two conversions into one cycle."""
FOREVER: Final = 1 << 62
"""A cycle that is never reached. Unlike NEVER, it is positive as a signed 64-bit number."""

AnalogSource = Callable[[int], int]
"""Function that returns the analog level, 0..65535, for a cycle."""


@dataclass(frozen=True, slots=True)
class ConversionSettings:
    """Decoded settings of the control registers; times in half Tcy."""

    tad: int
    sampling: int
    """Time from the start of sampling to the conversion; NEVER if software or a trigger ends sampling."""
    auto_sample: bool
    """ASAM: whether sampling restarts after every conversion."""
    scanned: tuple[int, ...]
    """Scan sequence of multiplexer A; empty if scanning is off."""
    inputs: tuple[tuple[int, int], tuple[int, int]]
    """(positive channel, CH0N) of multiplexers A and B."""
    alternates: bool
    """ALTS: whether multiplexers A and B alternate."""
    results: int
    """Number of conversions per interrupt."""
    in_halves: bool
    """BUFM: whether the result buffer is split into two halves."""
    form: int
    references: int
    """Value of VCFG, which selects the references."""
    bits: int = 12
    """Resolution of the converter."""
    conversion_tad: int = 14
    """Duration of one conversion in TAD."""
    amplifiers: int = 1
    """Number of channels in a sequence: CH0, CH1 and so on."""
    simultaneous: bool = False
    """SIMSAM: whether all channels are sampled together."""
    others: tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]] = ((), ())
    """Inputs (positive, negative or -1) of CH1 to CH3, of multiplexers A and B."""

    @property
    def conversion(self) -> int:
        """Duration of a conversion, from the end of sampling to the result."""
        return self.conversion_tad * self.tad

    @property
    def channels(self) -> tuple[int, ...]:
        """Channels converted in turn by multiplexer A."""
        return self.scanned or (self.inputs[0][0],)

    def next_input(self, scan: int, use_b: int) -> tuple[int, int, int, int]:
        """Return the current input (channel, CH0N) and the next state (scan position, whether B is next)."""
        channel, negative = self.inputs[use_b]
        if self.scanned and not use_b:
            place = scan % len(self.scanned)
            channel, scan = self.scanned[place], (place + 1) % len(self.scanned)
        return channel, negative, scan, int(self.alternates and not use_b)

    @property
    def is_plain(self) -> bool:
        """Whether native code can complete conversions with these settings."""
        special = self.alternates or self.form or self.references or self.inputs[0][1] or self.amplifiers > 1
        return self.auto_sample and SHORTEST_SAMPLING <= self.sampling < NEVER and not special


class AnalogInputs:
    """Analog inputs: levels in the record, or sources (functions of the cycle) that replace them.

    The owner of a source may predict a constant level. Native code then uses that level without calling the source.
    """

    def __init__(self, device: Peripheral, channels: int) -> None:
        self.level: Final = device.array("input", "H", channels)
        """Level of each channel, 0..65535 of AVDD; for a channel with a source, its predicted level."""
        self._holds_from: Final = device.array("level_from", "Q", channels)
        """First cycle from which `level` is valid; FOREVER while the level is unknown."""
        self.native_source: Final = Cell(device.record.reserve_addresses(2 * channels), 64)
        """Rule operand: function address and data pointer of each channel's native source."""
        self._native_sources: Final = device.record.u64[
            self.native_source.index : self.native_source.index + 2 * channels
        ]
        self._source: Final[list[AnalogSource | None]] = [None] * channels

    def __getitem__(self, channel: int) -> AnalogSource | None:
        return self._source[channel]

    def __setitem__(self, channel: int, source: AnalogSource | None) -> None:
        self._source[channel] = source
        self._holds_from[channel] = 0 if source is None else FOREVER
        self._native_sources[2 * channel] = 0

    def predict(self, channel: int, source: AnalogSource, level: int | None, cycle: int = 0) -> None:
        """Declare that `source` returns `level` in every cycle from `cycle` on; None means unknown.

        The call has no effect if the channel has a different source by now.
        """
        if self._source[channel] != source:
            return
        self._holds_from[channel] = FOREVER if level is None else cycle
        if level is not None:
            self.level[channel] = level

    def set_native(self, channel: int, source: AnalogSource, code: int, data: int) -> None:
        """Set the native equivalent of `source`: int64 code(record, data, channel, cycle); address 0 removes it.

        It must be valid for all cycles that native code may reach. The call has no effect if the channel has a
        different source by now.
        """
        if self._source[channel] == source:
            self._native_sources[2 * channel], self._native_sources[2 * channel + 1] = code, data

    def at(self, channel: int, cycle: int) -> int:
        """Return the level of a channel at a cycle."""
        source = self._source[channel]
        known = source is None or self._holds_from[channel] <= cycle
        return self.level[channel] if known else source(cycle)  # type: ignore[misc]


class PublishedSettings:
    """The settings in record cells:

    `adc.native` (u8), `adc.sampling` and `adc.conversion` (u32, half Tcy), `adc.results`, `adc.halves`, `adc.length`
    (u8) and `adc.channels` (u8 each).
    """

    def __init__(self, device: Peripheral, channels: int) -> None:
        self._native: Final = device.cell("native", "B")
        self._sampling: Final = device.cell("sampling", "I")
        self._conversion: Final = device.cell("conversion", "I")
        self._results: Final = device.cell("results", "B")
        self._halves: Final = device.cell("halves", "B")
        self._length: Final = device.cell("length", "B")
        self._channels: Final = device.array("channels", "B", channels)

    def publish(self, settings: ConversionSettings, changes_by_itself: bool) -> None:
        """Store the settings for native code.

        `changes_by_itself`: the settings depend on Fcy, so native code must not use them.
        """
        plain = settings.is_plain and not changes_by_itself
        self._native.value = plain
        if not plain:
            return
        self._sampling.value, self._conversion.value = settings.sampling, settings.conversion
        self._results.value, self._length.value = settings.results, len(settings.channels)
        self._halves.value = settings.in_halves
        for place, channel in enumerate(settings.channels):
            self._channels[place] = channel
