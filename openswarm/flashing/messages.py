"""Codec of update messages (eight bytes) and of their frames on a serial line.

The robot's counterpart is firmware/openswarm/io/update/spread.c, with io/framing.c for frames: COBS with a
CRC-16/CCITT-FALSE, here enclosed in zeros. Damaged frames decode to no message. tests/firmware/update/test_update.py
compares both implementations.
"""

from __future__ import annotations

import binascii
from dataclasses import dataclass
from typing import Final

from openswarm.flashing.ascon import BYTES, tag
from openswarm.flashing.loaders import ROW_BYTES
from openswarm.flashing.program import Program

MESSAGE: Final = 8
_KINDS, _ROW = 0xE0, 0x1F
_ADVERTISEMENT, _REQUEST, _DATA, _PROOF = 0x80, 0xA0, 0xC0, 0xE0
_IDENTITY: Final = 0x07FF
_PART: Final = 5
PARTS: Final = -(-ROW_BYTES // _PART)
"""Number of parts of a row; the last part has one byte."""
LONGEST_FRAME: Final = 255
"""Maximum number of bytes of a frame.

Longer input, such as text without an end of line, is discarded.
"""
_CRC_START: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class Advertisement:
    """Advertisement of a robot's program; version 0 means that it has none."""

    version: int
    rows: int
    crc: int
    is_active: bool

    def packed(self) -> bytes:
        """Return the encoded message."""
        head = bytes([_ADVERTISEMENT | self.is_active]) + self.version.to_bytes(2, "little") + bytes([self.rows])
        return head + self.crc.to_bytes(4, "little")


@dataclass(frozen=True, slots=True)
class Request:
    """A robot's request for the missing parts of a row; bit n stands for part n."""

    version: int
    row: int
    parts: int
    identity: int


def read(message: bytes) -> Advertisement | Request | None:
    """Decode a message; return None for messages that a host ignores."""
    kind, row = message[0] & _KINDS, message[0] & _ROW
    version = int.from_bytes(message[1:3], "little")
    if kind == _ADVERTISEMENT:
        return Advertisement(version, message[3], int.from_bytes(message[4:], "little"), bool(row & 1))
    if kind == _REQUEST:
        parts = int.from_bytes(message[3:6], "little") & (1 << PARTS) - 1
        return Request(version, row, parts, int.from_bytes(message[6:], "little"))
    return None


NOTHING: Final = Advertisement(0, 0, 0xFFFFFFFF, False)
"""Advertisement that makes every robot answer with its own, because version 0 is older than any program.

It differs from the advertisement of a robot without a program, which does not answer an equal one.
"""


def identity(crc: int) -> int:
    """Return the bits of the CRC with which requests and data distinguish programs of one version."""
    return crc & _IDENTITY


def data(program: Program, row: int, part: int) -> bytes:
    """Return the data message with one part of a row."""
    own = identity(program.crc)
    head = bytes([_DATA | row, part << 3 | own >> 8, own & 0xFF])
    return head + program.rows[row][part * _PART : (part + 1) * _PART].ljust(_PART, b"\0")


def proof(advertisement: bytes, key: bytes) -> bytes:
    """Return the message that proves an advertisement to robots with the key of the swarm (16 bytes).

    It is the start of the advertisement's tag, with the kind of the message instead of the first byte.
    """
    return bytes([_PROOF]) + tag(key, advertisement.ljust(BYTES, b"\0"), advertisement)[1:MESSAGE]


def framed(message: bytes) -> bytes:
    """Return the frame of a message, enclosed in zeros."""
    rest = message + binascii.crc_hqx(message, _CRC_START).to_bytes(2, "big")
    return b"\0" + b"".join(bytes([len(run) + 1]) + run for run in rest.split(b"\0")) + b"\0"


def unframed(frame: bytes) -> bytes:
    """Return the message in a frame without its zeros; return no bytes if the frame is invalid or damaged."""
    out, at = b"", 0
    while at < len(frame):
        run = frame[at + 1 : at + frame[at]]
        if len(run) != frame[at] - 1:
            return b""
        out += run + b"\0"
        at += frame[at]
    message = out[:-3]
    return message if len(message) == MESSAGE and not binascii.crc_hqx(out[:-1], _CRC_START) else b""
