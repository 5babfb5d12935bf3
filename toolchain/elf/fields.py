"""Reading and writing of relocated fields in section octets, for assembler and linker (abi-elf.md §5)."""

from __future__ import annotations

from emu.image.elf_facts import OCTETS_PER_WORD, Formula, RelocatedField, RelocationType


class FieldError(Exception):
    """A value that does not fit its field, or a field outside its section; the caller adds the source location."""


def positions(kind: RelocationType, offset: int, code: bool) -> list[int]:
    """Return the octet positions, low byte first, of a data field at `offset`; some octets are skipped (§5)."""
    count = (kind.width + 7) // 8
    if not code:
        return [offset + 2 * i for i in range(count)]
    used = 2 if kind.place is RelocatedField.DATA else 3
    result = []
    for _ in range(count):
        if offset % OCTETS_PER_WORD >= used:
            offset += OCTETS_PER_WORD - offset % OCTETS_PER_WORD
        result.append(offset)
        offset += 1
    return result


def load(data: bytearray, offset: int, kind: RelocationType, code: bool) -> int:
    """Return the raw, unsigned content of the field."""
    try:
        if kind.place is RelocatedField.WORD:
            word = data[offset] | data[offset + 1] << 8 | data[offset + 2] << 16
            return word >> kind.lsb & (1 << kind.width) - 1
        return int.from_bytes(bytes(data[p] for p in positions(kind, offset, code)), "little")
    except IndexError:
        raise FieldError(f"{kind.name} at octet {offset:#x} lies outside its section") from None


def store(data: bytearray, offset: int, kind: RelocationType, code: bool, raw: int) -> None:
    """Replace the field by the low bits of `raw`."""
    try:
        if kind.place is RelocatedField.WORD:
            mask = (1 << kind.width) - 1 << kind.lsb
            word = data[offset] | data[offset + 1] << 8 | data[offset + 2] << 16
            word = word & ~mask | raw << kind.lsb & mask
            data[offset : offset + 3] = word.to_bytes(3, "little")
            return
        value = raw & (1 << kind.width) - 1
        for position in positions(kind, offset, code):
            data[position] = value & 0xFF
            value >>= 8
    except IndexError:
        raise FieldError(f"{kind.name} at octet {offset:#x} lies outside its section") from None


def checked(kind: RelocationType, value: int) -> int:
    """Return `value` if it is in the range of the field, else raise `FieldError` with the limits."""
    if not kind.low <= value <= kind.high:
        raise FieldError(f"value {_show(value)} is outside {_show(kind.low)}..{_show(kind.high)}")
    if kind.even and value & 1 and kind.formula in (Formula.ADDRESS, Formula.HALF):
        raise FieldError(f"value {_show(value)} must be even")
    return value


def _show(value: int) -> str:
    return str(value) if -1000 < value < 1000 else f"{value:#x}"
