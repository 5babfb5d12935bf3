"""Reader of Intel HEX files: byte address = 2 x PC, four bytes per word, the fourth a phantom (abi-elf.md §6.8).

Input: file contents. Output: an `Image` without symbols. Missing bytes of a word read as erased. The package intelhex,
which the tests use for comparison, does not record the line of a byte, which error messages need.
"""

from __future__ import annotations

from array import array

from emu.chips.chip import Chip
from emu.image.chip_fit import misfits
from emu.image.elf_facts import OCTETS_PER_WORD, UNITS_PER_WORD
from emu.image.model import ERASED, LOADABLE, Block, Image, LoadError, check_blocks

DATA, END, SEGMENT, START_SEGMENT, LINEAR, START_LINEAR = range(6)
"""Numbers of record types. Microchip's tools never write 02, 03 and 05, but they are part of the format."""

_LENGTHS = {END: 0, SEGMENT: 2, START_SEGMENT: 4, LINEAR: 2, START_LINEAR: 4}


def read_hex(data: bytes, path: str, chip: Chip) -> Image:
    """Read the contents of an Intel HEX file. Raises LoadError with the line number of the first error."""
    octets, warnings = _collect(data, path, chip)
    words = _words(octets)
    blocks = check_blocks(path, chip, _blocks(words))
    if not blocks:
        raise LoadError(path, "holds no data records")
    return Image(path, "hex", chip, blocks, warnings=(*warnings, *misfits(chip, words)))


def _collect(data: bytes, path: str, chip: Chip) -> tuple[dict[int, int], tuple[str, ...]]:
    """Return the octets by byte address, without phantom octets, and warnings about phantoms that are not 0."""
    octets: dict[int, int] = {}
    upper = 0
    ended = False
    odd_phantom = 0
    number = 0
    for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").splitlines(), start=1):
        text = line.strip()
        if not text:
            continue
        if ended:
            raise LoadError(path, f"line {number}: text after the end-of-file record")
        kind, address, payload = parse_record(text, f"line {number}", path)
        if kind == END:
            ended = True
        elif kind == LINEAR:
            upper = int.from_bytes(payload, "big") << 16
        elif kind == SEGMENT:
            upper = int.from_bytes(payload, "big") << 4
        elif kind == DATA:
            _check_place(upper + address, len(payload), chip, f"line {number}", path)
            for place, octet in enumerate(payload, start=upper + address):
                if place % OCTETS_PER_WORD == OCTETS_PER_WORD - 1:
                    if octet and not odd_phantom:
                        odd_phantom = number
                elif octets.setdefault(place, octet) != octet:
                    raise LoadError(path, f"line {number}: overlaps an earlier record at byte address {place:#x}")
    if not ended:
        raise LoadError(path, f"is truncated: no end-of-file record after line {number}")
    warning = f"line {odd_phantom}: fourth byte of a program word is not 0 (ignored)"
    return octets, (warning,) if odd_phantom else ()


def _check_place(first: int, length: int, chip: Chip, where: str, path: str) -> None:
    """Raise LoadError if `length` octets from byte address `first` are not all in the chip's program memory."""
    for place in (first, first + max(length, 1) - 1):
        address = place // OCTETS_PER_WORD * UNITS_PER_WORD
        if not any(address in chip.program[name] for name in LOADABLE):
            raise LoadError(
                path,
                f"{where}: byte address {place:#x} (program address {address:#08x}) is outside the program memory"
                f" of the {chip.name}",
            )


def parse_record(text: bytes, where: str, path: str) -> tuple[int, int, bytes]:
    """Parse and check one line. Return record type, 16-bit address and payload."""
    if not text.startswith(b":"):
        raise LoadError(path, f"{where}: a record starts with ':', found {text[:1]!r}")
    try:
        record = bytes.fromhex(text[1:].decode("ascii"))
    except ValueError as error:
        raise LoadError(path, f"{where}: not an even number of hexadecimal digits") from error
    if len(record) < 5 or len(record) != record[0] + 5:
        raise LoadError(path, f"{where}: record has {len(record)} bytes, its length field asks for {_wanted(record)}")
    if sum(record) & 0xFF:
        right = -sum(record[:-1]) & 0xFF
        raise LoadError(path, f"{where}: checksum is {record[-1]:02X}, expected {right:02X}")
    kind = record[3]
    if kind > START_LINEAR:
        raise LoadError(path, f"{where}: unknown record type {kind:02X}")
    if record[0] != _LENGTHS.get(kind, record[0]):
        raise LoadError(path, f"{where}: record type {kind:02X} has {_LENGTHS[kind]} data bytes, found {record[0]}")
    return kind, int.from_bytes(record[1:3], "big"), record[4:-1]


def _wanted(record: bytes) -> int:
    return record[0] + 5 if record else 5


def _words(octets: dict[int, int]) -> dict[int, int]:
    """Return 24-bit words by program address. Missing bytes of a word count as erased (0xFF)."""
    words: dict[int, int] = {}
    for place, octet in octets.items():
        address, lane = place // OCTETS_PER_WORD * UNITS_PER_WORD, place % OCTETS_PER_WORD * 8
        words[address] = words.get(address, ERASED) & ~(0xFF << lane) | octet << lane
    return words


def _blocks(words: dict[int, int]) -> list[Block]:
    """Return the words as blocks of consecutive addresses."""
    blocks: list[Block] = []
    for address in sorted(words):
        if not blocks or blocks[-1].end != address:
            blocks.append(Block(address, array("I"), f"the run from {address:#08x}"))
        blocks[-1].words.append(words[address])
    return blocks
