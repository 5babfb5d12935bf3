"""A program to a robot that runs, and by it to its swarm: the host is one more neighbour, at the end of a serial line.

What enters: a line and a program. What leaves: a robot that holds it whole, which it advertises once it has checked the
CRC; or a `RobotError` in words. What the robot says beside messages, such as text, is passed over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.messages import (
    LONGEST_FRAME,
    NOTHING,
    PARTS,
    Advertisement,
    Request,
    data,
    framed,
    identity,
    read,
    unframed,
)
from openswarm.flashing.program import LAST_VERSION, Program
from openswarm.flashing.serial import Line
from openswarm.flashing.talk import ECHO, RobotError

GREETING_SECONDS: Final = 2.5
"""Between advertisements of the host. A robot's comes within 2 s of one that differs from its own; who hears its own
said keeps quiet, so it must not be said too often."""
PACE_SECONDS: Final = 0.006
"""Between parts: a robot looks at what it has received every 20 ms, and keeps less than 16."""
MOST_RESETS: Final = 3
"""That are followed: a robot that begins anew more often does so for ever."""


@dataclass(slots=True)
class Counts:
    """What happened on the way."""

    requests: int = 0
    parts: int = 0
    resets: int = 0
    """How often the robot began anew."""


class Neighbour:
    """The host, beside one robot."""

    def __init__(self, line: Line, program: Program, wait: float) -> None:
        """A robot that does not get on for `wait` seconds is given up."""
        self.counts: Final = Counts()
        self._line: Final = line
        self._program: Final = program
        self._wait: Final = wait
        self._heard = b""
        self._own: int | None = None
        """Version that the robot has said to have."""
        self._asked: Request | None = None
        """That it has got on with last."""

    def _messages(self, until: float) -> Iterator[Advertisement | Request]:
        """What the robot says until then."""
        while (left := until - self._line.now()) > 0:
            byte = self._line.read(left)
            if byte != b"\0":
                self._heard = (self._heard + byte)[-LONGEST_FRAME:]
                continue
            message, self._heard = unframed(self._heard), b""
            said = read(message) if message else None
            if said == NOTHING:
                raise RobotError(ECHO)  # and what else the host says would be taken for the robot's word
            if said is not None:
                yield said

    def _greet(self) -> None:
        self._line.write(framed(NOTHING.packed()))

    def _advertise(self, is_active: bool) -> None:
        facts = Advertisement(self._program.version, len(self._program.rows), self._program.crc, is_active)
        self._line.write(framed(facts.packed()))

    def _is_it(self, said: Advertisement | Request) -> bool:
        if isinstance(said, Request):
            return (said.version, said.identity) == (self._program.version, identity(self._program.crc))
        return (said.version, said.rows, said.crc) == (
            self._program.version, len(self._program.rows), self._program.crc)  # fmt: skip

    def give(self, progress: Callable[[int, int], None]) -> bool:
        """Until the robot has it whole; whether it is activated. `progress` hears how many rows of how many the robot
        has. Raises RobotError when it does not ask, does not get on, or cannot take it."""
        total = len(self._program.rows)
        greets = True
        limit = self._line.now() + self._wait
        asks = False
        while self._line.now() < limit:
            if not asks:
                if greets:
                    self._greet()  # first of all, so that an echo is known before anything is believed
                else:
                    self._advertise(False)
                greets = not greets
            asks = False
            for said in self._messages(self._line.now() + GREETING_SECONDS):
                if isinstance(said, Request):
                    if self._is_it(said) and said.row < total and said.parts:
                        asks = True
                        limit = self._line.now() + self._wait if self._gets_on(said) else limit
                        progress(said.row, total)
                        self._serve(said)
                elif self._is_it(said):
                    progress(total, total)
                    return said.is_active
                else:
                    self._check(said)
                    greets = False  # it may have begun anew
                    break
                if self._line.now() >= limit:
                    break
        raise RobotError(self._silence(asks))

    def _check(self, said: Advertisement) -> None:
        self._own = said.version
        if said.version > self._program.version:
            raise RobotError(f"the robot has version {said.version}, and takes only what is above it: " + (
                f"build the program with --version {said.version + 1} or more" if said.version < LAST_VERSION else
                "there is none, so nothing can replace it but a programmer"))  # fmt: skip
        if said.version == self._program.version:
            raise RobotError(f"the robot has another program of version {said.version}: give this one a higher one")

    def _gets_on(self, request: Request) -> bool:
        """Whether the robot has more than before, or begins anew, which it may do some times."""
        before, self._asked = self._asked, request
        if before is None or request.row > before.row:
            return True
        if request.row < before.row:
            self.counts.resets += 1
            if self.counts.resets > MOST_RESETS:
                raise RobotError(
                    f"the robot has begun anew {self.counts.resets} times, at last from row {before.row}: it resets"
                    " meanwhile, or its flash does not hold"
                )
            return True
        lacking = before.parts & request.parts
        self._asked = Request(request.version, request.row, lacking, request.identity)
        return lacking != before.parts

    def _serve(self, request: Request) -> None:
        self.counts.requests += 1
        for part in range(PARTS):
            if request.parts >> part & 1:
                self._line.write(framed(data(self._program, request.row, part)))
                self.counts.parts += 1
                for _ in self._messages(self._line.now() + PACE_SECONDS):
                    pass  # what it says meanwhile is said again

    def _silence(self, asks: bool) -> str:
        if self._asked is not None:
            what = "asks again and again for" if asks else "fell silent at"
            return f"the robot {what} row {self._asked.row}: what it has stays there, run the command again"
        if self._own is not None:
            return (f"the robot has version {self._own} and does not ask for version {self._program.version}: the"
                    f" program that runs is on trial still, or its flash does not hold")  # fmt: skip
        return (f"no robot answered within {self._wait:g} s: its firmware has to take programs from this port, as"
                f" firmware/apps/spreading does")  # fmt: skip

    def activate(self) -> None:
        """Until the robot says that the program is activated. Raises RobotError when it does not."""
        limit = self._line.now() + self._wait
        while self._line.now() < limit:
            self._advertise(True)
            self._greet()  # who hears its own said keeps quiet, but not towards one that has nothing
            for said in self._messages(self._line.now() + GREETING_SECONDS):
                if isinstance(said, Advertisement) and self._is_it(said) and said.is_active:
                    return
        raise RobotError(f"the robot has version {self._program.version} and does not activate it")
