"""Session with a boot loader: greeting, rows until each is acknowledged, start of the program.

A loader cannot distinguish a lost byte from a pause, and its checksum does not detect rotated bytes. A loader that is
one byte behind would accept a repeated block with its checksum as part of the address.

After a refusal or without an answer, the host therefore stays silent until the loader times out. It then greets the
loader again and continues with the same row. A loader that times out starts the program, but the first row written
makes the program's entry lead back into the loader.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.loaders import AGAIN, DONE, HELLO, LOADERS, PATIENCE_SECONDS, Loader, block, end
from openswarm.flashing.rows import Row
from openswarm.flashing.serial import Line

HELLO_SECONDS: Final = 0.4
"""Seconds between greetings.

Two greetings fall into the second in which a loader listens. The interval is longer than an answer takes over
Bluetooth (20 to 100 ms), because the loader takes a superfluous greeting for the first byte of a block.
"""
ANSWER_SECONDS: Final = 4.0
"""Time-out of a row in seconds.

It covers 8.8 ms on the wire, 4 ms to erase and to write, the radio, and an emulated robot on a busy computer. It is
longer than the loader's time-out, so that a loader that does not answer has timed out.
"""
SILENCE_SECONDS: Final = PATIENCE_SECONDS + 0.4
RETURN_SECONDS: Final = 5.0
"""Maximum seconds until the loader answers again after the host's silence."""
TRIES: Final = 5
"""Maximum number of attempts per row."""


ECHO: Final = "the line sends back what is written to it: switch its echo off, or take the loop-back away"


class RobotError(Exception):
    """The robot behaves neither like a boot loader nor like firmware that receives programs."""


@dataclass(slots=True)
class SessionCounts:
    """Statistics of a session."""

    blocks: int = 0
    refused: int = 0
    """Number of rows that the loader refused with 'N'."""
    unanswered: int = 0


class BootSession:
    """Session with the robot at the other end of a line."""

    def __init__(self, line: Line, wait: float) -> None:
        """Wait at most `wait` seconds for the loader to answer. Raises RobotError if no loader answers."""
        self.counts: Final = SessionCounts()
        self._line: Final = line
        self._wait: Final = wait
        self._holds_robot = False
        """Whether the first row is written, after which the robot returns to its loader at every start."""
        self._be_silent(SILENCE_SECONDS)  # a loader that waits for the rest of an interrupted block times out
        self.loader: Final = self._greet(wait)

    def _greet(self, seconds: float) -> Loader:
        limit = self._line.now() + seconds
        others = 0
        while True:
            self._line.discard_received()
            self._line.write(HELLO)
            heard = self._receive(HELLO_SECONDS)
            if heard[-1:] == DONE and heard[-2:-1]:
                loader = LOADERS.get(heard[-2])
                if loader is not None and HELLO in heard:  # an echoed 'K' of a row would pass for an answer
                    raise RobotError(ECHO)
                if loader is not None:
                    return loader
                if len(heard) == 2:
                    known = " or ".join(f"0x{one.type:02X} ({one.name})" for one in LOADERS.values())
                    raise RobotError(f"a boot loader of type 0x{heard[0]:02X} answers; expected {known}")
            others += len(heard)
            if self._line.now() >= limit:
                also = f"; {others} bytes of something else came" if others else ""
                raise RobotError(f"no boot loader answered within {seconds:g} s{also}: press the robot's reset button")

    def _receive(self, seconds: float) -> bytes:
        """Return the bytes received within `seconds`; a known loader type followed by 'K' ends the wait early."""
        heard = b""
        limit = self._line.now() + seconds
        while (left := limit - self._line.now()) > 0:
            heard += self._line.read(left)
            if heard[-1:] == DONE and len(heard) > 1 and heard[-2] in LOADERS:
                break
        return heard

    def write(self, rows: list[Row], progress: Callable[[int, int], None]) -> None:
        """Write rows in order and report each to `progress`. Raises RobotError if a row cannot be written."""
        for number, (address, words) in enumerate(rows):
            progress(number, len(rows))
            self._row(address, block(address, words))
        progress(len(rows), len(rows))

    def _row(self, address: int, data: bytes) -> None:
        for attempt in range(1, TRIES + 1):
            self._line.discard_received()
            self._line.write(data)
            self.counts.blocks += 1
            answer = self._answer()
            if answer == DONE:
                self._holds_robot = True
                return
            if answer == AGAIN:
                self.counts.refused += 1
            else:
                self.counts.unanswered += 1
            if attempt < TRIES:
                self._return(SILENCE_SECONDS if answer == AGAIN else 0.0)
        said = "refused" if answer == AGAIN else "did not acknowledge"
        raise RobotError(f"the robot {said} the row at {address:#08x} {TRIES} times: reset it and try again")

    def _answer(self) -> bytes:
        limit = self._line.now() + ANSWER_SECONDS
        while (left := limit - self._line.now()) > 0:
            answer = self._line.read(left)
            if answer in (DONE, AGAIN):
                return answer
        return b""

    def _return(self, silence: float) -> None:
        """Stay silent until the loader times out, and greet it again."""
        self._be_silent(silence)
        if self._greet(RETURN_SECONDS if self._holds_robot else self._wait) != self.loader:
            raise RobotError("another boot loader answers than before")

    def _be_silent(self, seconds: float) -> None:
        limit = self._line.now() + seconds
        while (left := limit - self._line.now()) > 0:
            self._line.read(left)

    def start(self) -> None:
        """Start the robot's program."""
        self._line.write(end())
