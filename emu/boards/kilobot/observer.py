"""Observer of a Kilobot: reports of its LED, motors, UART and infrared messages, from changes of registers.

Input: `Change`s of one robot. Output: `Report`s in order of time. Pins: kilobot.md §1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import RESTARTED
from emu.avr.machine import HZ, UDR0, Change
from emu.boards.kilobot.messages import PulseDecoder

DDRB, PORTB, DDRC, PORTC, DDRD, PORTD = (
    ADDRESSES[name] for name in ("DDRB", "PORTB", "DDRC", "PORTC", "DDRD", "PORTD")
)
WDRF: Final = 3
MCUSR, TCCR2A, TCCR2B, OCR2A, OCR2B = (ADDRESSES[name] for name in ("MCUSR", "TCCR2A", "TCCR2B", "OCR2A", "OCR2B"))
WATCHED: Final = (DDRB, PORTB, DDRC, PORTC, DDRD, PORTD, TCCR2A, TCCR2B, OCR2A, OCR2B, UDR0, MCUSR, RESTARTED)
LED_PINS: Final = (((DDRD, PORTD, 5), (DDRD, PORTD, 4)), ((DDRC, PORTC, 3), (DDRC, PORTC, 2)),
                   ((DDRC, PORTC, 5), (DDRC, PORTC, 4)))  # fmt: skip
"""Pins of red, green and blue; the first counts 1, the second 2. A pin lights if it is a low output."""
EMITTERS: Final = 0xC7
"""Pins of port B that may be emitters (kilobot.md §1)."""
LIGHT_BITS: Final = {DDRB: EMITTERS, PORTB: EMITTERS}
LED_BITS: Final = {DDRC: 0x3C, PORTC: 0x3C, DDRD: 0x30, PORTD: 0x30}
MOTOR_BITS: Final = {DDRB: 0x08, DDRD: 0x08, TCCR2A: 0xA0, TCCR2B: 0x07, OCR2A: 0xFF, OCR2B: 0xFF}
"""Bits of the registers on which emitters, LED and motors depend."""
SETTLED: Final = HZ // 1000
"""Cycles for which LED and motors must keep a state to be reported: 1 ms. Registers change one after the other."""


@dataclass(frozen=True, slots=True)
class Report:
    """One report: `kind` is led, motors, uart, message or reset; `content` its fields."""

    cycle: int
    kind: str
    content: dict[str, Any]

    @property
    def seconds(self) -> float:
        """Return the time of the report in seconds of the robot's clock."""
        return self.cycle / HZ

    def __str__(self) -> str:
        fields = " ".join(f"{name}={value}" for name, value in self.content.items())
        return f"{self.seconds:.6f} {self.kind} {fields}".rstrip()


def emits_light(registers: dict[int, int]) -> bool:
    """Whether an emitter of infrared light is on, for these values of registers."""
    return bool(registers.get(DDRB, 0) & registers.get(PORTB, 0) & EMITTERS)


def led_of(registers: dict[int, int]) -> tuple[int, int, int]:
    """Return the LED's red, green and blue, 0 to 3 each, for these values of registers."""

    def level(pins: Iterable[tuple[int, int, int]]) -> int:
        return sum(
            weight
            for weight, (direction, port, bit) in enumerate(pins, 1)
            if registers.get(direction, 0) >> bit & 1 and not registers.get(port, 0) >> bit & 1
        )

    red, green, blue = (level(pins) for pins in LED_PINS)
    return red, green, blue


def motors_of(registers: dict[int, int]) -> tuple[int, int]:
    """Return the duties of the left and the right motor, 0 to 255, for these values of registers."""
    if not registers.get(TCCR2B, 0) & 7:
        return 0, 0
    control = registers.get(TCCR2A, 0)
    left = registers.get(OCR2A, 0) if control & 0x80 and registers.get(DDRB, 0) & 8 else 0
    right = registers.get(OCR2B, 0) if control & 0x20 and registers.get(DDRD, 0) & 8 else 0
    return left, right


def is_reset(before: int, now: int) -> bool:
    """Whether MCUSR has changed by a watchdog reset, which sets WDRF. A program can only clear bits."""
    return now & 1 << WDRF != 0 and now & before == before


class KilobotObserver:
    """Observer of one robot. Give it all changes of the registers in WATCHED, in order.

    `registers`: their values now, for a robot that already runs.
    """

    def __init__(self, registers: Mapping[int, int] | None = None) -> None:
        self._registers = dict(registers or {})
        self._reported: dict[str, tuple[int, ...]] = {"led": (0, 0, 0), "motors": (0, 0)}
        self._waiting: dict[str, tuple[int, tuple[int, ...]]] = {}
        self._decoder = PulseDecoder()
        self._text = bytearray()
        self._text_at = 0
        self._restarted_at = -SETTLED

    def reports_of(self, changes: Iterable[Change]) -> Iterator[Report]:
        """Yield the reports of changes."""
        for change in changes:
            yield from self.settled_states(change.cycle)
            yield from self._report_change(change)

    def settled_states(self, cycle: int) -> Iterator[Report]:
        """Yield the states of LED and motors that have lasted long enough at a cycle."""
        due = sorted((since, kind) for kind, (since, _) in self._waiting.items() if cycle - since >= SETTLED)
        for since, kind in due:
            yield from self._report_state(since, kind)

    def final_reports(self) -> Iterator[Report]:
        """Yield the reports that are pending at the end of a run: the last states, and an incomplete UART line."""
        for since, kind in sorted((since, kind) for kind, (since, _) in self._waiting.items()):
            yield from self._report_state(since, kind)
        if self._text:
            yield Report(self._text_at, "uart", {"text": self._text.decode("latin-1")})

    def _report_state(self, since: int, kind: str) -> Iterator[Report]:
        state = self._waiting.pop(kind)[1]
        if state == self._reported[kind]:
            return
        self._reported[kind] = state
        names = ("red", "green", "blue") if kind == "led" else ("left", "right")
        yield Report(since, kind, dict(zip(names, state, strict=True)))

    def _report_change(self, change: Change) -> Iterator[Report]:
        if change.register == UDR0:
            if not self._text:
                self._text_at = change.cycle
            self._text.append(change.value)
            if change.value == 10:
                yield Report(self._text_at, "uart", {"text": self._text.decode("latin-1")})
                self._text.clear()
            return
        if change.register == RESTARTED:
            if change.cycle - self._restarted_at >= SETTLED:
                yield Report(change.cycle, "reset", {"cause": "jump"})
            self._restarted_at = change.cycle
            return
        changed = self._registers.get(change.register, 0) ^ change.value
        was_lit = emits_light(self._registers)
        self._registers[change.register] = change.value
        if change.register == MCUSR and is_reset(change.value ^ changed, change.value):
            self._registers = {MCUSR: change.value}
            yield Report(change.cycle, "reset", {"cause": "watchdog"})
            self._store_state("led", (0, 0, 0), change.cycle)
            self._store_state("motors", (0, 0), change.cycle)
        if changed & LIGHT_BITS.get(change.register, 0) and emits_light(self._registers) and not was_lit:
            message = self._decoder.pulse(change.cycle)
            if message is not None:
                yield Report(change.cycle, "message", {"type": message.type, "data": message.data.hex(),
                                                       "crc": "right" if message.is_whole else "wrong"})  # fmt: skip
        if changed & LED_BITS.get(change.register, 0):
            self._store_state("led", led_of(self._registers), change.cycle)
        if changed & MOTOR_BITS.get(change.register, 0):
            self._store_state("motors", motors_of(self._registers), change.cycle)

    def _store_state(self, kind: str, state: tuple[int, ...], cycle: int) -> None:
        """Store the state that LED or motors have from a cycle on. It is reported once it has lasted SETTLED cycles."""
        if self._waiting.get(kind, (0, self._reported[kind]))[1] != state:
            self._waiting[kind] = (cycle, state)
