"""Loader of firmware files: ELF (from this project, XC16 and C30) and Intel HEX.

Input: a path. Output: an `Image`, or a `LoadError` that says what the file is and what to use instead.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from emu.chips import chip_named
from emu.chips.chip import Chip
from emu.host.files import read_file
from emu.image.model import Image, LoadError

MAX_OCTETS: Final = 32 << 20
"""Maximum size of a file in octets. A complete image with debug information has a few megabytes."""

COFF_MAGIC: Final = b"\x36\x12"
"""File magic 0x1236 of Microchip's COFF, little-endian (abi-elf.md §6.8, COFF)."""

EXPECTED: Final = "expected an ELF executable for dsPIC30F or an Intel HEX file"


def load_image(path: str | os.PathLike[str], chip: Chip | None = None) -> Image:
    """Read the firmware file at `path` for `chip`; the content decides whether it is ELF or Intel HEX.

    Without `chip`, an ELF file is loaded for the chip named in its flags, a HEX file for the dsPIC30F6014A.

    Raises LoadError for a file that is not a usable image; never raises OSError.
    """
    name = os.fspath(path)
    return parse_image(_contents(name), name, chip)


def parse_image(data: bytes, name: str, chip: Chip | None = None) -> Image:
    """Parse file contents that are already in memory, as `load_image` does; messages use `name`."""
    if data.startswith(b"\x7fELF"):
        from emu.image.elf import read_elf

        return read_elf(data, name, chip)
    stripped = data.lstrip(b" \t\r\n\xef\xbb\xbf")
    if stripped.startswith(b":"):
        from emu.image.hex import read_hex

        return read_hex(data, name, chip or chip_named())
    raise LoadError(name, _unknown_format(data))


def _contents(name: str) -> bytes:
    """Return the file's octets. Raises LoadError if it cannot be read."""
    try:
        if Path(name).is_dir():
            raise LoadError(name, f"is a directory; {EXPECTED}")
        data = read_file(name, MAX_OCTETS + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, LoadError):
            raise
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise LoadError(name, f"cannot be read: {reason}") from error
    if len(data) > MAX_OCTETS:
        raise LoadError(name, f"is larger than {MAX_OCTETS >> 20} MiB; {EXPECTED}")
    return data


def _unknown_format(data: bytes) -> str:
    """Return the error message for a file that is neither ELF nor HEX."""
    if not data:
        return f"is empty; {EXPECTED}"
    if data.startswith(COFF_MAGIC):
        return (
            "is a COFF file (offset 0: magic 0x1236), the old default of MPLAB C30; use the .hex file"
            " beside it, or build again with -omf=elf"
        )
    if data.startswith(b"!<arch>\n"):
        return f"is a library archive; {EXPECTED}: link it into an executable first"
    if b"\x7fELF".startswith(data[:4]):
        return f"is truncated after {len(data)} octets; {EXPECTED}"
    return f"is neither ELF nor Intel HEX (it starts with {data[:4].hex(' ')}); {EXPECTED}"
