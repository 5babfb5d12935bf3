"""Firmware images of an ATmega328P: ELF executables of avr-gcc and Intel HEX files.

Input: a path. Output: an `AvrImage`, or a LoadError that says what is wrong with the file. avr-gcc places data memory
at 0x800000 and the EEPROM at 0x810000 (binutils' emulation `avr5`).
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

from emu.avr.core.state import EEPROM_BYTES, FLASH_BYTES
from emu.host.files import read_file
from emu.image.hex import DATA, END, LINEAR, SEGMENT, parse_record
from emu.image.lines import LineTable
from emu.image.model import LoadError
from emu.image.symbols import Symbol, Symbols

if TYPE_CHECKING:
    from elftools.elf.elffile import ELFFile

DATA_SPACE: Final = 0x800000
EEPROM_SPACE: Final = 0x810000
INFO_SPACE: Final = 0x820000
"""Start of fuses, lock bits and signature in the address space of an ELF file."""
INFO_END: Final = 0x860000
EM_AVR: Final = 83
AVR5: Final = 5
"""Architecture of the ATmega328P in `e_flags`: two-word vectors, 16 KB of flash and more (binutils' `avr5`)."""
DEVICE_NOTE: Final = ".note.gnu.avr.deviceinfo"
_DEVICE: Final = re.compile(rb"at(?:mega|tiny|xmega|90)[a-z0-9]*")
_COMPATIBLE: Final = re.compile(r"atmega(?:168|328).*")
"""Devices with the registers and vectors of the ATmega328P. The ATmega168 has less memory."""
MAX_OCTETS: Final = 16 << 20
"""Maximum size of a file in octets."""
EXPECTED: Final = "expected an ELF executable for AVR (ATmega328P) or an Intel HEX file"
_KINDS: Final = {"STT_FUNC": "function", "STT_OBJECT": "object"}


@dataclass(frozen=True, eq=False)
class AvrImage:
    """A loaded image: `flash` (erased where the file defines nothing), EEPROM bytes by address, symbols and DWARF."""

    path: str
    flash: bytes
    flash_used: int
    """Bytes of flash that the file defines."""
    eeprom: dict[int, int]
    raw_symbols: tuple[Symbol, ...] = ()
    debug_sections: tuple[tuple[str, bytes], ...] = ()

    @cached_property
    def symbols(self) -> Symbols:
        """Return the symbols by name and by byte address; empty for HEX files."""
        return Symbols(self.raw_symbols)

    @cached_property
    def lines(self) -> LineTable:
        """Return the source lines by byte address; empty without DWARF."""
        return LineTable(dict(self.debug_sections))

    def place(self, address: int) -> str:
        """Return a byte address of flash as `0x000123 (main+0x4, main.c:12)`, with what the image knows of it."""
        symbol = self.symbols.text(address) if self.symbols.code(address) else None
        line = self.lines.find(address)
        known = ", ".join(str(part) for part in (symbol, line) if part)
        return f"{address:#06x} ({known})" if known else f"{address:#06x}"


def load_avr_image(path: str) -> AvrImage:
    """Read an ELF or Intel HEX file; the content decides. Raises LoadError, never OSError."""
    try:
        if Path(path).is_dir():
            raise LoadError(path, f"is a directory; {EXPECTED}")
        data = read_file(path, MAX_OCTETS + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, LoadError):
            raise
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise LoadError(path, f"cannot be read: {reason}") from error
    if len(data) > MAX_OCTETS:
        raise LoadError(path, f"is larger than {MAX_OCTETS >> 20} MiB; {EXPECTED}")
    return parse_avr_image(data, path)


def parse_avr_image(data: bytes, path: str) -> AvrImage:
    """Parse file contents, as `load_avr_image` does; messages use `path`."""
    if data.startswith(b"\x7fELF"):
        try:
            return _read_elf(data, path)
        except LoadError:
            raise
        except Exception as error:  # pyelftools raises many unrelated exceptions for damaged input
            raise LoadError(path, f"is damaged: {type(error).__name__} while reading the ELF file") from error
    if data.lstrip(b" \t\r\n\xef\xbb\xbf").startswith(b":"):
        return _read_hex(data, path)
    if not data:
        raise LoadError(path, f"is empty; {EXPECTED}")
    raise LoadError(path, f"is neither ELF nor Intel HEX (it starts with {data[:4].hex(' ')}); {EXPECTED}")


class _Memory:
    """Bytes of flash and EEPROM as a file defines them."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.flash: dict[int, int] = {}
        self.eeprom: dict[int, int] = {}

    def put(self, address: int, octets: bytes, where: str) -> None:
        """Define bytes at an address of an ELF file's space. Raises LoadError."""
        end = address + len(octets)
        if end <= FLASH_BYTES:
            target, start = self.flash, address
        elif address >= EEPROM_SPACE and end <= EEPROM_SPACE + EEPROM_BYTES:
            target, start = self.eeprom, address - EEPROM_SPACE
        else:
            outside = max(address, FLASH_BYTES) if address < DATA_SPACE else address
            raise LoadError(self.path, f"{where}: bytes at {outside:#x} are outside the ATmega328P's"
                                       f" {FLASH_BYTES:#x} bytes of flash")  # fmt: skip
        for place, octet in enumerate(octets, start):
            if target.setdefault(place, octet) != octet:
                raise LoadError(self.path, f"{where}: overlaps earlier bytes at {place:#x}")

    def image(self, symbols: tuple[Symbol, ...] = (), sections: tuple[tuple[str, bytes], ...] = ()) -> AvrImage:
        """Return the image. Raises LoadError if it defines no flash."""
        if not self.flash:
            raise LoadError(self.path, "defines no byte of flash")
        flash = bytearray(b"\xff" * FLASH_BYTES)
        for place, octet in self.flash.items():
            flash[place] = octet
        return AvrImage(self.path, bytes(flash), len(self.flash), self.eeprom, symbols, sections)


def _read_hex(data: bytes, path: str) -> AvrImage:
    memory = _Memory(path)
    upper, ended, number = 0, False, 0
    for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").splitlines(), start=1):
        text, where = line.strip(), f"line {number}"
        if not text:
            continue
        if ended:
            raise LoadError(path, f"{where}: text after the end-of-file record")
        kind, address, payload = parse_record(text, where, path)
        if kind == END:
            ended = True
        elif kind in (LINEAR, SEGMENT):
            upper = int.from_bytes(payload, "big") << (16 if kind == LINEAR else 4)
        elif kind == DATA and not INFO_SPACE <= upper + address < INFO_END:
            memory.put(upper + address, payload, where)
    if not ended:
        raise LoadError(path, f"is truncated: no end-of-file record after line {number}")
    return memory.image()


def _read_elf(data: bytes, path: str) -> AvrImage:
    from elftools.elf.elffile import ELFFile

    elf = ELFFile(io.BytesIO(data))
    if elf["e_machine"] not in ("EM_AVR", EM_AVR):
        raise LoadError(path, f"is an ELF file for {elf['e_machine']}; {EXPECTED}")
    if elf["e_type"] != "ET_EXEC":
        raise LoadError(path, f"is an object or library that is not linked; {EXPECTED}")
    _refuse_other_device(elf, path)
    memory = _Memory(path)
    for number, segment in enumerate(elf.iter_segments()):
        if segment["p_type"] != "PT_LOAD" or not segment["p_filesz"] or segment["p_paddr"] >= INFO_SPACE:
            continue
        content = segment.data()
        if len(content) != segment["p_filesz"]:
            raise LoadError(path, f"is truncated: segment {number} ends behind the file")
        memory.put(segment["p_paddr"], content, f"segment {number}")
    table = elf.get_section_by_name(".symtab")
    symbols = tuple(_symbols(table)) if table is not None else ()
    sections = tuple((section.name, section.data()) for section in elf.iter_sections()
                     if section.name.startswith(".debug_") and section["sh_type"] != "SHT_NOBITS")  # fmt: skip
    return memory.image(symbols, sections)


def _refuse_other_device(elf: ELFFile, path: str) -> None:
    """Raise LoadError if the file is built for a microcontroller whose code the ATmega328P cannot run."""
    note = elf.get_section_by_name(DEVICE_NOTE)
    named = _DEVICE.search(note.data()) if note is not None else None
    if named and not _COMPATIBLE.fullmatch(device := named[0].decode("ascii")):
        raise LoadError(path, f"is built for the {device}; {EXPECTED}")
    family = elf["e_flags"] & 0x7F  # bit 7: prepared for linker relaxation
    if family != AVR5:
        raise LoadError(path, f"is built for the architecture avr{family}, not avr{AVR5}; {EXPECTED}")


def _symbols(table: object) -> list[Symbol]:
    """Return the defined symbols that name code or data."""
    found = []
    for entry in table.iter_symbols():  # type: ignore[attr-defined]
        kind, section = entry["st_info"]["type"], entry["st_shndx"]
        if not entry.name or section in ("SHN_UNDEF", "SHN_ABS") or kind in ("STT_FILE", "STT_SECTION"):
            continue
        value = entry["st_value"]
        space = "code" if value < DATA_SPACE else "data" if value < EEPROM_SPACE else "eedata"
        found.append(Symbol(
            entry.name, value - {"code": 0, "data": DATA_SPACE, "eedata": EEPROM_SPACE}[space], entry["st_size"],
            _KINDS.get(kind, "label"), space, entry["st_info"]["bind"] != "STB_LOCAL",
            value if space == "code" else None,
        ))  # fmt: skip
    return found
