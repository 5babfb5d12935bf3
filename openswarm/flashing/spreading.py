"""A program to a robot that runs, and by it to its swarm: the host is one more neighbour, at the end of a serial line.

What enters: a line and a program. What leaves: a robot that holds it whole, which it advertises once it has checked the
CRC; or a `RobotError` in words. Messages are those of firmware/openswarm/io/update/README.md, each a frame of COBS with
a CRC-16/CCITT-FALSE between zeros; what else the robot says, such as text, is passed over.
"""

from __future__ import annotations

import binascii
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.program import Program
from openswarm.flashing.serial import Line
from openswarm.flashing.talk import RobotError

MESSAGE: Final = 8
_KINDS, _ROW = 0xE0, 0x1F
_ADVERTISEMENT, _REQUEST, _DATA = 0x80, 0xA0, 0xC0
_IDENTITY: Final = 0x07FF
_PART: Final = 5
_PARTS: Final = 20
"""Of a row; the last one is a byte."""
_LONGEST: Final = 255
"""Of what may be a frame; a line of text without an end is not kept."""
GREETING_SECONDS: Final = 2.5
"""Between advertisements of the host. A robot's comes within 2 s of one that differs from its own; who hears its own
said keeps quiet, so it must not be said too often."""
PACE_SECONDS: Final = 0.006
"""Between parts: a robot looks at what it has received every 20 ms, and keeps less than 16."""
_CRC_START: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class Advertisement:
    """What a robot says it has; version 0: nothing."""

    version: int
    rows: int
    crc: int
    is_active: bool

    def packed(self) -> bytes:
        """As a message."""
        head = bytes([_ADVERTISEMENT | self.is_active]) + self.version.to_bytes(2, "little") + bytes([self.rows])
        return head + self.crc.to_bytes(4, "little")


@dataclass(frozen=True, slots=True)
class Request:
    """The parts of a row that a robot lacks: bit n is part n."""

    version: int
    row: int
    parts: int
    identity: int


def read(message: bytes) -> Advertisement | Request | None:
    """What a message says; None for those that a host has no use for."""
    kind, row = message[0] & _KINDS, message[0] & _ROW
    version = int.from_bytes(message[1:3], "little")
    if kind == _ADVERTISEMENT:
        return Advertisement(version, message[3], int.from_bytes(message[4:], "little"), bool(row & 1))
    if kind == _REQUEST:
        identity = int.from_bytes(message[6:], "little")
        return Request(version, row, int.from_bytes(message[3:6], "little") & (1 << _PARTS) - 1, identity)
    return None


NOTHING: Final = Advertisement(0, 0, 0xFFFFFFFF, False)
"""Older than what any robot has, so each says what that is, and not the same as having nothing."""


def data(program: Program, row: int, part: int) -> bytes:
    """A part of a row as a message."""
    identity = program.crc & _IDENTITY
    head = bytes([_DATA | row, part << 3 | identity >> 8, identity & 0xFF])
    return head + program.rows[row][part * _PART : (part + 1) * _PART].ljust(_PART, b"\0")


def framed(message: bytes) -> bytes:
    """A message between zeros."""
    rest = message + binascii.crc_hqx(message, _CRC_START).to_bytes(2, "big")
    return b"\0" + b"".join(bytes([len(run) + 1]) + run for run in rest.split(b"\0")) + b"\0"


def unframed(frame: bytes) -> bytes:
    """The message of a frame without its zeros; empty for what is none, or damaged."""
    out, at = b"", 0
    while at < len(frame):
        run = frame[at + 1 : at + frame[at]]
        if len(run) != frame[at] - 1:
            return b""
        out += run + b"\0"
        at += frame[at]
    message = out[:-3]
    return message if len(message) == MESSAGE and not binascii.crc_hqx(out[:-1], _CRC_START) else b""


@dataclass(slots=True)
class Counts:
    """What happened on the way."""

    requests: int = 0
    parts: int = 0


class Neighbour:
    """The host, beside one robot."""

    def __init__(self, line: Line, program: Program, wait: float) -> None:
        """A robot that says nothing of use for `wait` seconds is given up."""
        self.counts: Final = Counts()
        self._line: Final = line
        self._program: Final = program
        self._wait: Final = wait
        self._heard = b""

    def _messages(self, until: float) -> Iterator[Advertisement | Request]:
        """What the robot says until then."""
        while (left := until - self._line.now()) > 0:
            byte = self._line.read(left)
            if byte != b"\0":
                self._heard = (self._heard + byte)[-_LONGEST:]
                continue
            message, self._heard = unframed(self._heard), b""
            said = read(message) if message else None
            if said is not None:
                yield said

    def _advertise(self, is_active: bool) -> None:
        facts = Advertisement(self._program.version, len(self._program.rows), self._program.crc, is_active)
        self._line.write(framed(facts.packed()))

    def _is_it(self, said: Advertisement | Request) -> bool:
        if isinstance(said, Request):
            return (said.version, said.identity) == (self._program.version, self._program.crc & _IDENTITY)
        return (said.version, said.rows, said.crc) == (
            self._program.version, len(self._program.rows), self._program.crc)  # fmt: skip

    def give(self, progress: Callable[[int, int], None]) -> bool:
        """Until the robot has it whole; whether it is activated. `progress` hears how many rows of how many the robot
        has. Raises RobotError when it does not ask, or cannot take it."""
        total = len(self._program.rows)
        greeting = True
        limit = self._line.now() + self._wait
        own = asked = None
        while True:
            if asked is None and greeting:
                self._line.write(framed(NOTHING.packed()))
            elif asked is None:
                self._advertise(False)
            greeting = asked is None and not greeting
            for said in self._messages(self._line.now() + GREETING_SECONDS):
                if isinstance(said, Advertisement) and self._is_it(said):
                    progress(total, total)
                    return said.is_active
                if isinstance(said, Advertisement):
                    own = said.version
                    self._check(said)
                    asked, greeting = None, False  # it may have begun anew
                    break
                if self._is_it(said) and said.row < total:
                    limit = self._line.now() + self._wait
                    asked = said.row
                    progress(said.row, total)
                    self._serve(said)
            if self._line.now() >= limit:
                raise RobotError(self._silence(own, asked))

    def _check(self, said: Advertisement) -> None:
        if said.version > self._program.version:
            raise RobotError(f"the robot has version {said.version}, and takes only what is above it: build the program"
                             f" with --version {said.version + 1} or more")  # fmt: skip
        if said.version == self._program.version:
            raise RobotError(f"the robot has another program of version {said.version}: give this one a higher one")

    def _serve(self, request: Request) -> None:
        self.counts.requests += 1
        for part in range(_PARTS):
            if request.parts >> part & 1:
                self._line.write(framed(data(self._program, request.row, part)))
                self.counts.parts += 1
                for _ in self._messages(self._line.now() + PACE_SECONDS):
                    pass  # what it says meanwhile is said again

    def _silence(self, own: int | None, asked: int | None) -> str:
        if asked is not None:
            return f"the robot fell silent at row {asked}: what it has stays there, run the command again"
        if own is not None:
            return (f"the robot has version {own} and does not ask for version {self._program.version}: the program"
                    f" that runs is on trial still, or its flash does not hold")  # fmt: skip
        return (f"no robot answered within {self._wait:g} s: its firmware has to take programs from this port, as"
                f" firmware/apps/spreading does")  # fmt: skip

    def activate(self) -> None:
        """Until the robot says that the program is activated. Raises RobotError when it does not."""
        limit = self._line.now() + self._wait
        patience = GREETING_SECONDS
        while self._line.now() < limit:
            self._advertise(True)
            patience *= 2  # who hears its own said keeps quiet
            for said in self._messages(self._line.now() + patience):
                if isinstance(said, Advertisement) and self._is_it(said) and said.is_active:
                    return
        raise RobotError(f"the robot has version {self._program.version} and does not activate it")
