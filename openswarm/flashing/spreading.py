"""Transfer of a program to a running robot: the host acts as a neighbour robot at the other end of a serial line.

The transfer ends when the robot has checked the CRC and advertises the program, or with a `RobotError`. Other output
of the robot, such as text, is skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.boot_session import ECHO, RobotError
from openswarm.flashing.messages import (
    LONGEST_FRAME,
    NOTHING,
    PARTS,
    Advertisement,
    Request,
    data,
    framed,
    identity,
    proof,
    read,
    unframed,
)
from openswarm.flashing.program import LAST_VERSION, Program
from openswarm.flashing.serial import Line

GREETING_SECONDS: Final = 2.5
"""Seconds between the host's advertisements.

A robot answers an advertisement that differs from its own within 2 s. It stays silent after one that equals its own,
so that the host must not advertise too often.
"""
PACE_SECONDS: Final = 0.006
"""Seconds between parts: a robot processes received messages every 20 ms and buffers fewer than 16."""
MOST_RESETS: Final = 3
"""Maximum number of restarts of the transfer by the robot: beyond it, the robot is assumed to restart for ever."""


@dataclass(slots=True)
class TransferCounts:
    """Statistics of a transfer."""

    requests: int = 0
    parts: int = 0
    resets: int = 0
    """Number of times the robot restarted the transfer."""


class HostNeighbour:
    """Host side of a transfer: acts as a neighbour of one robot."""

    def __init__(self, line: Line, program: Program, wait: float, key: bytes | None = None) -> None:
        """Create the neighbour. The transfer fails if the robot makes no progress for `wait` seconds.

        `key` proves the advertisements to robots that authenticate them.
        """
        self.counts: Final = TransferCounts()
        self._line: Final = line
        self._program: Final = program
        self._wait: Final = wait
        self._key: Final = key
        self._heard = b""
        self._own: int | None = None
        """Version that the robot has advertised."""
        self._asked: Request | None = None
        """The last request that showed progress."""

    def _messages(self, until: float) -> Iterator[Advertisement | Request]:
        """Yield the robot's messages until a time."""
        while (left := until - self._line.now()) > 0:
            byte = self._line.read(left)
            if byte != b"\0":
                self._heard = (self._heard + byte)[-LONGEST_FRAME:]
                continue
            message, self._heard = unframed(self._heard), b""
            said = read(message) if message else None
            if said == NOTHING:
                raise RobotError(ECHO)  # otherwise the host would take its own messages for the robot's
            if said is not None:
                yield said

    def _greet(self) -> None:
        self._line.write(framed(NOTHING.packed()))

    def _advertise(self, is_active: bool) -> None:
        facts = Advertisement(self._program.version, len(self._program.rows), self._program.crc, is_active).packed()
        self._line.write(framed(facts))
        if self._key is not None:
            self._line.write(framed(proof(facts, self._key)))

    def _matches(self, said: Advertisement | Request) -> bool:
        if isinstance(said, Request):
            return (said.version, said.identity) == (self._program.version, identity(self._program.crc))
        return (said.version, said.rows, said.crc) == (
            self._program.version, len(self._program.rows), self._program.crc)  # fmt: skip

    def send(self, progress: Callable[[int, int], None]) -> bool:
        """Send the program until the robot has all of it; return whether the robot has activated it.

        `progress` is called with the number of received rows and the total. Raises RobotError if the robot requests
        no rows, makes no progress, or cannot receive the program.
        """
        total = len(self._program.rows)
        greets = True
        limit = self._line.now() + self._wait
        asks = False
        while self._line.now() < limit:
            if not asks:
                if greets:
                    self._greet()  # first, so that an echo is detected before any message is trusted
                else:
                    self._advertise(False)
                greets = not greets
            asks = False
            for said in self._messages(self._line.now() + GREETING_SECONDS):
                if isinstance(said, Request):
                    if self._matches(said) and said.row < total and said.parts:
                        asks = True
                        limit = self._line.now() + self._wait if self._is_progress(said) else limit
                        progress(said.row, total)
                        self._serve(said)
                elif self._matches(said):
                    progress(total, total)
                    return said.is_active
                else:
                    self._check(said)
                    greets = False  # a new greeting is only needed if the robot has restarted
                    break
                if self._line.now() >= limit:
                    break
        raise RobotError(self._silence(asks))

    def _check(self, said: Advertisement) -> None:
        self._own = said.version
        if said.version > self._program.version:
            raise RobotError(f"the robot has version {said.version} and accepts only a higher one: " + (
                f"build the program with --version {said.version + 1} or more" if said.version < LAST_VERSION else
                "there is none, so only a programmer can replace it"))  # fmt: skip
        if said.version == self._program.version:
            raise RobotError(f"the robot has another program of version {said.version}: give this one a higher one")

    def _is_progress(self, request: Request) -> bool:
        """Whether a request shows progress, or restarts the transfer. Raises RobotError after MOST_RESETS restarts."""
        before, self._asked = self._asked, request
        if before is None or request.row > before.row:
            return True
        if request.row < before.row:
            self.counts.resets += 1
            if self.counts.resets > MOST_RESETS:
                raise RobotError(
                    f"the robot has restarted the transfer {self.counts.resets} times, last from row {before.row}: it"
                    " resets during the transfer, its flash does not keep data, or the program lacks the tag of the"
                    " robot's key (--key)"
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
                    pass  # skip: the robot repeats messages that arrive meanwhile

    def _silence(self, asks: bool) -> str:
        if self._asked is not None and self._asked.row == len(self._program.rows) - 1:
            return ("the robot does not keep the program after its last row: the line or its flash is damaged, or the"
                    " program lacks the tag of the robot's key (--key)")  # fmt: skip
        if self._asked is not None:
            what = "repeats its request for" if asks else "fell silent at"
            return f"the robot {what} row {self._asked.row}: it keeps the rows that it has, run the command again"
        if self._own is not None:
            lacks = "" if self._key is not None else ", or it believes only a host with its key (--key)"
            return (f"the robot has version {self._own} and does not ask for version {self._program.version}: the"
                    f" running program is still on trial, or the flash does not keep data{lacks}")  # fmt: skip
        return (f"no robot answered within {self._wait:g} s: its firmware must accept programs from this port, as"
                f" firmware/apps/spreading does")  # fmt: skip

    def activate(self) -> None:
        """Advertise the program as active until the robot does, too. Raises RobotError if the robot does not."""
        limit = self._line.now() + self._wait
        while self._line.now() < limit:
            self._advertise(True)
            self._greet()  # advertise version 0: after an advertisement equal to its own the robot stays silent
            for said in self._messages(self._line.now() + GREETING_SECONDS):
                if isinstance(said, Advertisement) and self._matches(said) and said.is_active:
                    return
        lacks = "" if self._key is not None else ": it may believe only a host with its key (--key)"
        raise RobotError(f"the robot has version {self._program.version} and does not activate it{lacks}")
