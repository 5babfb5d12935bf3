"""What the converter's control registers ask for, and the same as numbers in the record for native code.

Native code may carry out a whole round of conversions by itself (`adc.native`) if it is of the common kind: automatic
sampling and conversion, one multiplexer, supplies as references, plain results from ADCBUF0 on or in halves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.peripherals.base import Peripheral
from emu.system.events import NEVER
from emu.system.rules import Place

CONVERSION_TAD: Final = 14
SHORTEST_SAMPLING: Final = 2
"""Half Tcy: below that a conversion may begin in the cycle in which the one before ended."""
FOREVER: Final = 1 << 62
"""A cycle that never comes, as a number native code can compare with its sign."""

AnalogSource = Callable[[int], int]
"""Analog level 0..65535 as a function of the cycle."""


@dataclass(frozen=True, slots=True)
class ConversionSettings:
    """What the control registers ask for; times in half Tcy."""

    tad: int
    sampling: int
    """From the start of sampling to the conversion; NEVER if something else ends it."""
    again: bool
    """ASAM: sampling follows every conversion."""
    scanned: tuple[int, ...]
    """Channels of multiplexer A in turn; empty without scan."""
    inputs: tuple[tuple[int, int], tuple[int, int]]
    """(positive channel, CH0N) of multiplexers A and B."""
    alternates: bool
    results: int
    """Conversions per interrupt."""
    in_halves: bool
    form: int
    references: int
    """VCFG."""

    @property
    def conversion(self) -> int:
        """From the end of sampling to the result."""
        return CONVERSION_TAD * self.tad

    @property
    def channels(self) -> tuple[int, ...]:
        """AnalogInputs in turn, multiplexer A."""
        return self.scanned or (self.inputs[0][0],)

    def turn(self, scan: int, use_b: int) -> tuple[int, int, int, int]:
        """What is sampled now, (channel, CH0N), and what comes next: place in the scan, whether multiplexer B is."""
        channel, negative = self.inputs[use_b]
        if self.scanned and not use_b:
            place = scan % len(self.scanned)
            channel, scan = self.scanned[place], (place + 1) % len(self.scanned)
        return channel, negative, scan, int(self.alternates and not use_b)

    @property
    def is_plain(self) -> bool:
        """Whether native code can follow it."""
        odd = self.alternates or self.form or self.references or self.inputs[0][1]
        return self.again and SHORTEST_SAMPLING <= self.sampling < NEVER and not odd


class AnalogInputs:
    """Levels of the channels: numbers in the record, or functions of the cycle that replace them.

    Where a function will be constant from some cycle on, its owner may predict it; native code then needs no function.
    """

    def __init__(self, device: Peripheral, channels: int) -> None:
        self.level: Final = device.array("input", "H", channels)
        """0..65535 of AVDD; of a function what it was predicted to be."""
        self._holds_from: Final = device.array("level_from", "Q", channels)
        """First cycle from which `level` is what the channel shows; FOREVER while that is not known."""
        self.asked: Final = Place(device.record.reserve_addresses(2 * channels), 64)
        """For rules: host code that knows the level of a channel, and that code's data."""
        self._asked: Final = device.record.u64[self.asked.index : self.asked.index + 2 * channels]
        self._source: Final[list[AnalogSource | None]] = [None] * channels

    def __getitem__(self, channel: int) -> AnalogSource | None:
        return self._source[channel]

    def __setitem__(self, channel: int, source: AnalogSource | None) -> None:
        self._source[channel] = source
        self._holds_from[channel] = 0 if source is None else FOREVER
        self._asked[2 * channel] = 0

    def predict(self, channel: int, source: AnalogSource, level: int | None, cycle: int = 0) -> None:
        """`source` will return `level` in every cycle from `cycle` on (None: nobody knows), unless it was replaced."""
        if self._source[channel] != source:
            return
        self._holds_from[channel] = FOREVER if level is None else cycle
        if level is not None:
            self.level[channel] = level

    def answer(self, channel: int, source: AnalogSource, code: int, data: int) -> None:
        """Host code at address `code` (0: none) answers what `source` does, unless that was replaced: int64
        code(record, data, channel, cycle), for all cycles native code may come to."""
        if self._source[channel] == source:
            self._asked[2 * channel], self._asked[2 * channel + 1] = code, data

    def at(self, channel: int, cycle: int) -> int:
        """Level of a channel in a cycle."""
        source = self._source[channel]
        known = source is None or self._holds_from[channel] <= cycle
        return self.level[channel] if known else source(cycle)  # type: ignore[misc]


class PublishedSettings:
    """The settings as numbers: `adc.native` (u8), `adc.sampling` and `adc.conversion` (u32, half Tcy), `adc.results`,
    `adc.halves`, `adc.length` (u8) and `adc.channels` (u8 each)."""

    def __init__(self, device: Peripheral, channels: int) -> None:
        self._native: Final = device.cell("native", "B")
        self._sampling: Final = device.cell("sampling", "I")
        self._conversion: Final = device.cell("conversion", "I")
        self._results: Final = device.cell("results", "B")
        self._halves: Final = device.cell("halves", "B")
        self._length: Final = device.cell("length", "B")
        self._channels: Final = device.array("channels", "B", channels)

    def publish(self, settings: ConversionSettings, changes_by_itself: bool) -> None:
        """Write it down; `changes_by_itself`: no register tells when it is another."""
        plain = settings.is_plain and not changes_by_itself
        self._native.value = plain
        if not plain:
            return
        self._sampling.value, self._conversion.value = settings.sampling, settings.conversion
        self._results.value, self._length.value = settings.results, len(settings.channels)
        self._halves.value = settings.in_halves
        for place, channel in enumerate(settings.channels):
            self._channels[place] = channel
