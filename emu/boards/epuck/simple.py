"""Simple parts of the e-puck: LEDs, selector, battery and codec (epuck.md §2, §6)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from emu.boards.part import BoardPart
from emu.peripherals import Peripherals
from emu.peripherals.pins import parse_pin

LED_PINS: Final = {
    **{f"led{number}": pin for number, pin in enumerate("RA6 RA7 RA9 RA12 RA10 RA13 RA14 RA15".split())},  # noqa: SIM905
    "front": "RC1",
    "body": "RC2",
}
"""Pin of each LED. LED0 is at the front; the ring is numbered clockwise as seen from above (epuck.md §2)."""


class Leds(BoardPart):
    """Ten LEDs. An LED is on while its pin is driven high."""

    def __init__(self, chip: Peripherals) -> None:
        super().__init__("leds", chip)
        self._pins_by_name: Final = {name: parse_pin(pin) for name, pin in LED_PINS.items()}

    def listen(self, on_change: Callable[[str, bool, int], None]) -> None:
        """Call on_change(name, lit, cycle) whenever an LED changes."""
        for name, pin in LED_PINS.items():
            self.pins.watch(pin, partial(self._changed, on_change, name))

    def _changed(
        self, on_change: Callable[[str, bool, int], None], name: str, cycle: int, changed: int, levels: int
    ) -> None:
        if not self.events.quiet:
            on_change(name, bool(changed & levels), cycle)

    def __getitem__(self, name: str) -> bool:
        """Whether an LED ("led0".."led7", "front", "body") is lit. Raises KeyError for another name."""
        port, mask = self._pins_by_name[name]
        return bool(self.pins.level[port] & mask)

    @property
    def lit(self) -> tuple[str, ...]:
        """Names of the LEDs that are on."""
        return tuple(name for name in LED_PINS if self[name])

    def __repr__(self) -> str:
        return f"<Leds, lit: {', '.join(self.lit) or 'none'}>"

    def states(self) -> list[bool]:
        """Return whether each LED is lit: ring LEDs 0-7, front, body."""
        level = self.pins.level
        return [level[port] & mask != 0 for port, mask in self._pins_by_name.values()]


class Selector(BoardPart):
    """The 16-position switch on RG6..RG9 (epuck.md §2)."""

    def __init__(self, chip: Peripherals, position: int = 0) -> None:
        super().__init__("selector", chip)
        self.position = position

    @property
    def position(self) -> int:
        """Position of the switch, 0..15. Setting it raises ValueError for another number."""
        port, _ = parse_pin("RG6")
        return self.pins.input[port] >> 6 & 0xF

    @position.setter
    def position(self, position: int) -> None:
        if not 0 <= position < 16:
            raise ValueError(f"the selector has positions 0 to 15, not {position}")
        port, _ = parse_pin("RG6")
        self.pins.set_port(port, 0xF << 6, position << 6)

    def __repr__(self) -> str:
        return f"<Selector at {self.position}>"


class Battery(BoardPart):
    """Battery and its comparator BATT_LOW on RF1: 1 = ok, 0 = below 3.4 V (epuck.md §2).

    On hardware 1.3, AN7 measures the voltage.
    """

    LOW_VOLTS: Final = 3.4
    _CHANNEL: Final = 7
    _LOW_CODE: Final = 2070
    _FULL_VOLTS: Final = 4.2
    _FULL_CODE: Final = 2560

    def __init__(self, chip: Peripherals, hardware_1_3: bool = False) -> None:
        super().__init__("battery", chip)
        self._measured: Final = hardware_1_3
        self._millivolts: Final = self.cell("millivolts", "H")
        self.volts = 4.0

    @property
    def volts(self) -> float:
        """Battery voltage in V; 3.0 to 4.2 in normal use."""
        return self._millivolts.value / 1000

    @volts.setter
    def volts(self, volts: float) -> None:
        self._millivolts.value = round(volts * 1000)
        self.pins.set("RF1", volts >= self.LOW_VOLTS)
        if self._measured:
            slope = (self._FULL_CODE - self._LOW_CODE) / (self._FULL_VOLTS - self.LOW_VOLTS)
            code = round(self._LOW_CODE + (volts - self.LOW_VOLTS) * slope)
            self.chip.adc.set_input(self._CHANNEL, min(max(code, 0), 4095) << 4)


class Codec(BoardPart):
    """The Si3000 codec on the DCI: accepts samples and control words, returns silence.

    RF0 low holds it in reset (epuck.md §6). After a sample with bit 0 set, the next word is a control word (secondary
    frame). UNVERIFIED layout of control words: register number in bits 12:8, value in bits 7:0.
    """

    _REGISTERS: Final = 32

    def __init__(self, chip: Peripherals) -> None:
        super().__init__("codec", chip)
        self._words: Final = self.cell("words", "Q")
        self._last: Final = self.cell("last", "H")
        self._control_next: Final = self.cell("control_next", "B")
        self.registers: Final = self.array("registers", "B", self._REGISTERS)
        """Values of the codec registers, as written by control words."""
        self.on_sample: Callable[[int, int], None] | None = None
        """on_sample(sample, cycle): called for each sample, -32768..32767."""
        assert chip.dci is not None
        chip.dci.on_word = self._accept_word
        chip.dci.source = lambda _slot, _cycle: 0
        self._port, self._pin = parse_pin("RF0")
        self.pins.watch("RF0", self._reset_pin_changed)

    @property
    def is_on(self) -> bool:
        """Whether AUDIO_ON (RF0) is driven high."""
        return bool(self.pins.drive[self._port] & self.pins.output[self._port] & self._pin)

    @property
    def words(self) -> int:
        """Number of words accepted outside reset."""
        return self._words.value

    @property
    def last(self) -> int:
        """The last word accepted."""
        return self._last.value

    def _accept_word(self, word: int, _slot: int, cycle: int) -> None:
        if not self.is_on:
            return
        self._words.value += 1
        self._last.value = word
        if self._control_next.value:
            self._control_next.value = 0
            self.registers[word >> 8 & self._REGISTERS - 1] = word & 0xFF
            return
        self._control_next.value = word & 1
        if self.on_sample is not None and not self.events.quiet:
            self.on_sample(word - (word >> 15 << 16), cycle)

    def _reset_pin_changed(self, _cycle: int, changed: int, levels: int) -> None:
        if not changed & levels:
            self._control_next.value = 0
            for number in range(self._REGISTERS):
                self.registers[number] = 0
