"""Observer of the robot's visible and audible outputs, which reports changes as lines of text."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from emu.boards.epuck.bluetooth import Bluetooth
from emu.boards.epuck.board import Epuck
from emu.peripherals.uart.uart import Uart

TOPICS: Final = ("leds", "motors", "uart1", "uart2", "sound")
_PAUSE_SECONDS: Final = 0.1
"""Minimum time in s between two reports of motors or sound."""


class RobotObserver:
    """Writes a line with the time when an observed output changes. `write` receives lines without newline.

    Raises ValueError for a topic that is not one of TOPICS.
    """

    def __init__(self, board: Epuck, topics: Iterable[str], write: Callable[[str], None]) -> None:
        self._board: Final = board
        self._write: Final = write
        self._reported = [0, 0]
        self._last_report: int | None = None
        self._next_report = 0
        self._watches_motors = False
        self._loudest = self._next_sound = 0
        self._text: Final = {1: bytearray(), 2: bytearray()}
        for topic in topics:
            if topic not in TOPICS:
                raise ValueError(f"cannot watch {topic!r}; expected one of {', '.join(TOPICS)}")
            getattr(self, f"_watch_{topic}")()

    def _line(self, cycle: int, text: str) -> None:
        self._write(f"{self._board.chip.seconds(cycle):12.6f} s  {text}")

    def _watch_leds(self) -> None:
        self._board.leds.listen(
            lambda _name, _lit, cycle: self._line(cycle, "leds " + (" ".join(self._board.leds.lit) or "off"))
        )

    def _watch_motors(self) -> None:
        self._watches_motors = True
        for motor in (self._board.motors.left, self._board.motors.right):
            motor.listen(self._stepped)

    def _stepped(self, cycle: int, _direction: int) -> None:
        """Report both step counts after a step; they already include the step."""
        if cycle < self._next_report:
            return
        second = self._board.chip.fcy
        last, self._last_report = self._last_report, cycle
        # Set it before the other motor is read, because the read may call this method.
        self._next_report = cycle + round(_PAUSE_SECONDS * second)
        steps = [self._board.motors.left.steps, self._board.motors.right.steps]
        text = f"motors {steps[0]} {steps[1]} steps"
        if last is not None:
            moved = [now - before for now, before in zip(steps, self._reported, strict=True)]
            text += ", " + " ".join(f"{count * second / (cycle - last):.0f}" for count in moved) + " steps/s"
        self._reported = steps
        self._line(cycle, text)

    def _watch_uart1(self) -> None:
        self._listen(1, self._board.bluetooth)

    def _watch_uart2(self) -> None:
        self._listen(2, self._board.chip.uart[2])

    def _listen(self, number: int, line: Bluetooth | Uart) -> None:
        line.listen(lambda byte, start: self._byte(number, byte, start))

    def _byte(self, number: int, byte: int, start: int) -> None:
        """Collect a byte; report the text at the end of a line."""
        text = self._text[number]
        if byte not in (0x0A, 0x0D):
            text.append(byte & 0xFF)
        elif text:
            self._line(start, f"uart{number} {text.decode('latin-1')!r}")
            text.clear()

    def finish(self) -> None:
        """Report incomplete lines and totals at the end of the run."""
        now = self._board.chip.context.bus.events.now
        for number, text in self._text.items():
            if text:
                self._line(now, f"uart{number} {text.decode('latin-1')!r}")
        if self._watches_motors:
            left, right = self._board.motors.left, self._board.motors.right
            self._line(now, f"motors {left.steps} {right.steps} steps in total")
            for side, motor in (("left", left), ("right", right)):
                if motor.lost or motor.illegal:
                    self._line(now, f"{side} motor: {motor.lost} steps lost, {motor.illegal} illegal patterns")

    def _watch_sound(self) -> None:
        self._board.codec.on_sample = self._sample

    def _sample(self, sample: int, cycle: int) -> None:
        """Report the loudest sample of each tenth of a second."""
        self._loudest = max(self._loudest, abs(sample))
        if cycle >= self._next_sound:
            if self._loudest:
                self._line(cycle, f"sound up to {self._loudest}")
            self._loudest = 0
            self._next_sound = cycle + round(_PAUSE_SECONDS * self._board.chip.fcy)
