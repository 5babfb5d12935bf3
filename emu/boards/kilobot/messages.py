"""Infrared messages of kilolib as pulses of light, both ways (kilobot.md §2).

Input: messages, or the times of a robot's pulses. Output: times of pulses, or messages. Times are ticks of 125 ns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

SLOT: Final = 270
"""Ticks of a bit as measured from a compiled image; the nominal value is 269."""
TOLERANCE: Final = 134
"""Ticks that a pulse may be off the middle of its slot at kilolib's receiver."""
LEADER_PULSES: Final = 2
"""Pulses around the silent byte 0."""
STOP_OF_LEADER: Final = 2_420
"""Ticks from the first pulse to the pulse that ends the silent byte 0."""
BYTE_AFTER_LEADER: Final = 286
"""Ticks from that pulse to the start of the first byte."""
BYTE_AFTER_BYTE: Final = 282
"""Ticks from the stop pulse of a byte to the start of the next one."""
STOP_SLOT: Final = 9
SIZE: Final = 12
DATA_SIZE: Final = 9
LONGEST_PAUSE: Final = 2_959
"""Ticks after which a receiver gives up."""
TYPES: Final = {"boot": 0x80, "reset": 0x83, "sleep": 0x84, "wakeup": 0x85, "charge": 0x86, "voltage": 0x87,
                "run": 0x88, "readuid": 0x89, "calibrate": 0x8A}  # fmt: skip
"""Message types of the overhead controller's commands."""
MOST_UID: Final = 0xFFFF
"""Largest number (UID) of a robot: its EEPROM has two bytes for it."""
OHC_GAP: Final = 48_000
"""Ticks between two messages of the overhead controller: 6 ms."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message: 9 data bytes and a type. `is_whole`: whether its CRC is right."""

    data: bytes
    type: int
    is_whole: bool = True


def crc16(octets: bytes) -> int:
    """Return the CRC with the reflected polynomial 0x1021 and start 0xFFFF (avr-libc `_crc_ccitt_update`)."""
    crc = 0xFFFF
    for octet in octets:
        crc ^= octet
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc


def frame(message: Message) -> bytes:
    """Return the 12 bytes that are sent for a message. Raises ValueError if it does not have 9 data bytes."""
    if len(message.data) != DATA_SIZE:
        raise ValueError(f"a message has {DATA_SIZE} data bytes, not {len(message.data)}")
    content = message.data + bytes([message.type])
    return content + crc16(content).to_bytes(2, "little")


def pulses_of(octets: bytes, start: int = 0) -> Iterator[int]:
    """Yield the ticks of the pulses of a frame whose first pulse is at `start`."""
    yield start
    at = start + STOP_OF_LEADER
    yield at
    at += BYTE_AFTER_LEADER
    for octet in octets:
        yield at
        for bit in range(8):
            if octet >> bit & 1:
                yield at + SLOT * (bit + 1)
        at += SLOT * STOP_SLOT
        yield at
        at += BYTE_AFTER_BYTE


class PulseDecoder:
    """Decoder of the pulses of one robot. `damaged` counts incomplete frames."""

    def __init__(self) -> None:
        self.damaged = 0
        self._start: int | None = None
        self._octets: list[int] = []
        self._octet = 0

    def pulse(self, at: int) -> Message | None:
        """Take the tick of a pulse's rising edge; return the message that it completes."""
        if self._start is None or at - self._start > LONGEST_PAUSE:
            if self._octets:
                self.damaged += 1
            self._restart(at)
            return None
        slot = (at - self._start + TOLERANCE) // SLOT
        if slot < STOP_SLOT:
            if not self._octets and slot:  # light in the silent byte
                self._restart(at)
                return None
            self._octet |= 1 << (slot - 1) if slot else 0
            return None
        if slot > STOP_SLOT:  # the start of the next byte
            self._start, self._octet = at, 0
            return None
        self._octets.append(self._octet)
        if len(self._octets) <= SIZE:  # byte 0 is silence
            return None
        octets = bytes(self._octets[1:])
        self._start, self._octets = None, []
        content, crc = octets[: DATA_SIZE + 1], int.from_bytes(octets[DATA_SIZE + 1 :], "little")
        return Message(content[:DATA_SIZE], content[DATA_SIZE], crc16(content) == crc)

    def _restart(self, at: int) -> None:
        self._start, self._octets, self._octet = at, [], 0
