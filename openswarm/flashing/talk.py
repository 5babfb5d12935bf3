"""The conversation with a boot loader: greet, rows until each is acknowledged, start.

What enters: a line and rows. What leaves: a robot that holds them, or a `RobotError` in words.

A loader cannot tell a lost byte from a pause, and a sum does not tell a block from the same bytes rotated: one that is
sent again to a loader that is one byte behind is accepted, with its sum as part of the address. So after a refusal, as
after no answer, the host is silent until the loader has given up, greets it again and goes on with the same row. A
loader that gives up starts the program, but the first row has made the program's entry lead back into the loader.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.loaders import AGAIN, DONE, HELLO, LOADERS, PATIENCE_SECONDS, Loader, block, end
from openswarm.flashing.rows import Row
from openswarm.flashing.serial import Line

HELLO_SECONDS: Final = 0.4
"""Between greetings: two fall into the second in which a loader listens. Longer than an answer over Bluetooth takes (20
to 100 ms), since a greeting too many is the first byte of a block."""
ANSWER_SECONDS: Final = 4.0
"""For a row: 8.8 ms on the wire, 4 ms to erase and to write, the radio, and an emulated robot on a busy computer.
Longer than a loader's patience, so that without an answer it has given up."""
SILENCE_SECONDS: Final = PATIENCE_SECONDS + 0.4
RETURN_SECONDS: Final = 5.0
"""For a loader that was left alone to be there again."""
TRIES: Final = 5
"""Of a row."""


ECHO: Final = "the line sends back what is written to it: switch its echo off, or take the loop-back away"


class RobotError(Exception):
    """The robot does not do what a boot loader does, or firmware that takes programs."""


@dataclass(slots=True)
class Counts:
    """What happened on the way."""

    blocks: int = 0
    refused: int = 0
    """Answers 'N'."""
    unanswered: int = 0


class Talk:
    """One robot at the other end of a line."""

    def __init__(self, line: Line, wait: float) -> None:
        """Wait at most `wait` s for the loader to answer. Raises RobotError if none does."""
        self.counts: Final = Counts()
        self._line: Final = line
        self._wait: Final = wait
        self._holds_robot = False
        """The first row is written: whatever happens, the robot comes back to its loader."""
        self._be_silent(SILENCE_SECONDS)  # a loader that somebody left in the middle of a block gives up
        self.loader: Final = self._greet(wait)

    def _greet(self, seconds: float) -> Loader:
        limit = self._line.now() + seconds
        others = 0
        while True:
            self._line.drop()
            self._line.write(HELLO)
            heard = self._heard(HELLO_SECONDS)
            if heard[-1:] == DONE and heard[-2:-1]:
                loader = LOADERS.get(heard[-2])
                if loader is not None and HELLO in heard:  # a 'K' in a row would be taken for its answer
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

    def _heard(self, seconds: float) -> bytes:
        """What comes within a time, or until a type that is known and 'K' have come."""
        heard = b""
        limit = self._line.now() + seconds
        while (left := limit - self._line.now()) > 0:
            heard += self._line.read(left)
            if heard[-1:] == DONE and len(heard) > 1 and heard[-2] in LOADERS:
                break
        return heard

    def write(self, rows: list[Row], progress: Callable[[int, int], None]) -> None:
        """Write rows in order; `progress` hears how many of how many are done. Raises RobotError if one will not."""
        for number, (address, words) in enumerate(rows):
            progress(number, len(rows))
            self._row(address, block(address, words))
        progress(len(rows), len(rows))

    def _row(self, address: int, data: bytes) -> None:
        for attempt in range(1, TRIES + 1):
            self._line.drop()
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
        """Let the loader give up, and greet it again."""
        self._be_silent(silence)
        if self._greet(RETURN_SECONDS if self._holds_robot else self._wait) != self.loader:
            raise RobotError("another boot loader answers than before")

    def _be_silent(self, seconds: float) -> None:
        limit = self._line.now() + seconds
        while (left := limit - self._line.now()) > 0:
            self._line.read(left)

    def start(self) -> None:
        """Let the robot start its program."""
        self._line.write(end())
