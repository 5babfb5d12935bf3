"""CAN frames as bits, and the duration of a frame (CAN 2.0 part A §3, part B §3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

_POLYNOMIAL: Final = 0x4599
"""Generator polynomial of CRC-15 in CAN 2.0."""
_TAIL_BITS: Final = 1 + 1 + 1 + 7 + 3
"""Number of bits after the CRC: CRC delimiter, ACK slot and delimiter, end of frame, intermission. Never stuffed."""


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One message. `identifier` has 11 bits, or 29 if `extended`."""

    identifier: int
    extended: bool
    remote: bool
    length: int
    """DLC as sent, 0..15. Values above 8 mean 8 bytes."""
    data: bytes

    def wire_bits(self) -> int:
        """Return the number of bits from start of frame to the end of intermission, including stuff bits."""
        bits = self._header()
        if not self.remote:
            bits += "".join(f"{byte:08b}" for byte in self.data)
        bits += f"{_crc(bits):015b}"
        return len(bits) + _stuff_bits(bits) + _TAIL_BITS

    def _header(self) -> str:
        """Return the bits from start of frame to DLC; a dominant bit is 0."""
        remote = "1" if self.remote else "0"
        if not self.extended:
            return f"0{self.identifier & 0x7FF:011b}{remote}00{self.length:04b}"
        high, low = self.identifier >> 18, self.identifier & 0x3FFFF
        return f"0{high:011b}11{low:018b}{remote}00{self.length:04b}"


def _crc(bits: str) -> int:
    crc = 0
    for bit in bits:
        feedback = (bit == "1") ^ (crc >> 14 & 1)
        crc = crc << 1 & 0x7FFF
        if feedback:
            crc ^= _POLYNOMIAL
    return crc


def _stuff_bits(bits: str) -> int:
    """Return the number of stuff bits. A stuff bit follows five equal bits and counts for the next run of bits."""
    count, run, last = 0, 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            count += 1
            last = "1" if bit == "0" else "0"
            run = 1
    return count
