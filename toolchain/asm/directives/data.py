"""Data and location directives (abi-elf.md §4.3 and §4.4)."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

from emu.image.elf_facts import RELOCATION_BY_NAME, RelocationType
from toolchain.asm.expr import ExprError, unescape
from toolchain.asm.macro import split_arguments
from toolchain.asm.state import Assembler
from toolchain.asm.symbols import ExprValue, PendingOperation, SymbolValue
from toolchain.elf import constants as c
from toolchain.files import read_bytes

Handler = Callable[[Assembler, str], None]

_NUMBER = re.compile(r"0|[1-9][0-9]*|0x[0-9A-Fa-f]+")
"""The most frequent operands, which need no parser. A leading 0 starts an octal number, which `int` would refuse."""
_NUMBERS = re.compile(r"(?:0|[1-9][0-9]*)(?:,(?:0|[1-9][0-9]*))*")
"""Operands of most directives of a compiler."""

# Relocation of a datum by its size in bytes and its operator ("": none) (abi-elf.md §5).
_DATA_KINDS: dict[int, dict[str, str]] = {
    1: {"": "8"},
    2: {
        "": "16", "handle": "HANDLE", "psvoffset": "PSVOFFSET", "tbloffset": "TBLOFFSET", "psvpage": "PSVPAGE",
        "tblpage": "TBLPAGE", "edspage": "EDSPAGE", "edsoffset": "EDSOFFSET", "addr_lo": "ADDR_LO",
        "addr_hi": "ADDR_HI",
    },
    4: {"": "32", "paddr": "PADDR"},
}  # fmt: skip
_PACKED_KINDS: dict[int, dict[str, str]] = {
    1: {"": "PBYTE"},
    3: {
        "": "PWORD", "paddr": "P_PADDR", "handle": "P_HANDLE", "psvoffset": "P_PSVOFFSET", "tbloffset": "P_TBLOFFSET",
        "psvpage": "P_PSVPAGE", "tblpage": "P_TBLPAGE", "edspage": "P_EDSPAGE", "edsoffset": "P_EDSOFFSET",
        "addr_lo": "P_ADDR_LO",
    },
}  # fmt: skip


def operator_of(value: ExprValue) -> str:
    """Return the operator that is applied to a value, "" for none."""
    if isinstance(value, SymbolValue):
        return value.op
    if isinstance(value, PendingOperation) and value.op[0] == "f":
        return value.op[1:]
    return ""


def file_argument(text: str, directive: str) -> str:
    """Return the file name in the quoted string in `text`; a backslash separates folders and is no escape."""
    match = re.fullmatch(r'\s*"([^"]*)"\s*', text)
    if match is None:
        raise ExprError(f"{directive} expects a file name in double quotes")
    return match[1]


def string_argument(text: str, directive: str) -> str:
    """Return the content of the quoted string that is the only argument in `text`."""
    match = re.fullmatch(r'\s*"((?:\\.|[^"\\])*)"\s*', text)
    if match is None:
        raise ExprError(f"{directive} expects one string in double quotes")
    return unescape(match[1]).decode("utf-8", "replace")


def _no_content(asm: Assembler) -> ExprError:
    """Return the error for a nonzero value in a section without content (bss)."""
    label = f" at {asm.label}" if asm.label else ""
    return ExprError(f"section {asm.section.name} has no content: only zero may be stored into it{label}")


def _put(asm: Assembler, data: bytes, packed: bool) -> int:
    asm.after_repeat = ""
    if asm.section.type == c.SHT_NOBITS and any(data):
        raise _no_content(asm)
    return asm.section.put_packed(data) if packed else asm.section.put_bytes(data)


def _range_error(value: int, kind: RelocationType) -> ExprError:
    return ExprError(f"value {value} is outside {kind.low}..{kind.high}")


def _integers(size: int, packed: bool = False) -> Handler:
    kinds = {op: RELOCATION_BY_NAME[name] for op, name in (_PACKED_KINDS if packed else _DATA_KINDS)[size].items()}
    plain = kinds[""]
    mask = (1 << 8 * size) - 1

    def emit(asm: Assembler, text: str) -> None:
        if packed and not asm.section.is_code:
            raise ExprError(
                f"section {asm.section.name} holds no program words: .p directives belong into code sections"
            )
        if packed and size == 3:
            asm.section.align_word()
        if _NUMBERS.fullmatch(text):
            values = list(map(int, text.split(",")))
            if max(values) <= plain.high:
                _put(asm, b"".join([value.to_bytes(size, "little") for value in values]), packed)
                return
        for part in split_arguments(text, spaces=False) or [""]:
            value = int(part, 0) if _NUMBER.fullmatch(part) else asm.evaluate(part)
            if isinstance(value, int):
                if not plain.low <= value <= plain.high:
                    raise _range_error(value, plain)
                _put(asm, (value & mask).to_bytes(size, "little"), packed)
                continue
            op = operator_of(value)
            if op not in kinds:
                raise ExprError(f"{op}() cannot be stored in {size} byte{'s' * (size > 1)}")
            asm.section.add_fixup(_put(asm, bytes(size), packed), kinds[op], value, asm.source.place)

    return emit


def _strings(terminated: bool, packed: bool = False) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        for part in split_arguments(text, spaces=False):
            match = re.fullmatch(r'"((?:\\.|[^"\\])*)"', part, re.DOTALL)
            if match is None:
                raise ExprError(f"expected a string in double quotes, got {part!r}")
            _put(asm, unescape(match[1]) + b"\0" * terminated, packed)

    return emit


def _reals(form: str) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        for part in split_arguments(text, spaces=False):
            _put(asm, struct.pack(form, _real(part, form)), packed=False)

    return emit


def _real(text: str, form: str) -> float:
    cleaned = re.sub(r"^([-+]?)0[defghDEFGH]", r"\1", text.strip())  # 0f1.5 is a float in GNU as
    try:
        value = float(cleaned)
        struct.pack(form, value)
    except (ValueError, OverflowError):
        raise ExprError(f"{text!r} is not a real number that fits") from None
    return value


def _fixed(asm: Assembler, text: str) -> None:
    """Store 1.15 fixed-point fractions x with -1 <= x < 1."""
    for part in split_arguments(text, spaces=False):
        value = _real(part, "<d")
        if not -1.0 <= value < 1.0:
            raise ExprError(f"{part} is outside -1.0 .. 1.0 of a 1.15 fraction")
        _put(asm, struct.pack("<h", min(round(value * 32768), 32767)), packed=False)


def _leb128(signed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        for part in split_arguments(text, spaces=False):
            value = asm.constant(part)
            if value < 0 and not signed:
                raise ExprError(f".uleb128 of the negative value {value}")
            _put(asm, leb128(value, signed), packed=False)

    return emit


def leb128(value: int, signed: bool) -> bytes:
    """Return `value` as LEB128, DWARF's variable-length integer."""
    out = bytearray()
    while True:
        byte, value = value & 0x7F, value >> 7
        done = value in ((-1,) if byte & 0x40 else (0,)) if signed else value == 0
        out.append(byte | 0x80 * (not done))
        if done:
            return bytes(out)


def _numbers(asm: Assembler, text: str, directive: str, least: int, most: int) -> list[int]:
    parts = split_arguments(text, spaces=False)
    if not least <= len(parts) <= most:
        raise ExprError(f"{directive} expects {least} to {most} operands")
    return [asm.constant(part) for part in parts]


def _space(packed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        numbers = _numbers(asm, text, ".pspace" if packed else ".space", 1, 2)
        fill = numbers[1] if len(numbers) > 1 else asm.section.default_fill(packed)
        if packed:
            _check_count(asm, numbers[0])
            _put(asm, bytes((fill & 0xFF,)) * numbers[0], packed=True)
        else:
            if asm.section.type == c.SHT_NOBITS and fill:
                raise _no_content(asm)
            asm.section.skip(numbers[0], fill)
        asm.after_repeat = ""

    return emit


def _check_count(asm: Assembler, count: int) -> None:
    if not 0 <= count <= 3 * asm.section.limit:
        raise ExprError(f"{count} bytes are more than the address space holds")


def _fill(packed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        numbers = _numbers(asm, text, ".fill", 1, 3)
        count, size, value = (*numbers, *(1, asm.section.default_fill(packed))[len(numbers) - 1 :])
        if not 0 <= size <= 8:
            raise ExprError(f".fill size {size} is outside 0..8")
        _check_count(asm, count * max(size, 1))
        _put(asm, (value & ((1 << 8 * size) - 1)).to_bytes(size, "little") * count, packed)

    return emit


def _align(packed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        parts = split_arguments(text, spaces=False)
        if len(parts) > 3:
            raise ExprError(".align expects an alignment, optionally a fill value and a maximum")
        section = asm.section
        units = asm.constant(parts[0]) if parts else 2
        fill = asm.constant(parts[1]) if len(parts) > 1 and parts[1] else section.default_fill(packed)
        most = asm.constant(parts[2]) if len(parts) > 2 else 0
        if most and units > 0 and section.bytes_to(units) > most:
            return
        section.align_to(units, fill, packed)
        asm.after_repeat = ""

    return emit


def _org(packed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        parts = split_arguments(text, spaces=False)
        if not 1 <= len(parts) <= 2:
            raise ExprError(".org expects a location and optionally a fill value")
        section = asm.section
        fill = asm.constant(parts[1]) if len(parts) > 1 else section.default_fill(packed)
        if section.relaxables:
            raise ExprError(".org after a call that --relax may shorten: use a section of its own")
        target = asm.location(parts[0])
        section.align_word(fill & 0xFF, packed)
        gap = target - section.location()
        if gap < 0:
            raise ExprError(f".org {target:#x} is before the current location {section.location():#x}")
        section.skip(gap, fill, packed)

    return emit


move_location: Handler = _org(packed=False)
"""Handler of an assignment to `.`; its operands are those of `.org`."""


def _include_binary(packed: bool) -> Handler:
    def emit(asm: Assembler, text: str) -> None:
        parts = split_arguments(text, spaces=False)
        if not 1 <= len(parts) <= 3:
            raise ExprError(".incbin expects a file name, optionally bytes to skip and a count")
        data = read_bytes(asm.find_file(file_argument(parts[0], ".incbin")))
        skip = asm.constant(parts[1]) if len(parts) > 1 and parts[1] else 0
        count = asm.constant(parts[2]) if len(parts) > 2 else len(data)
        if skip < 0 or count < 0:
            raise ExprError(".incbin skip and count cannot be negative")
        _put(asm, data[skip : skip + count], packed)

    return emit


DATA_DIRECTIVES: dict[str, Handler] = {
    ".byte": _integers(1),
    ".word": _integers(2),
    ".hword": _integers(2),
    ".short": _integers(2),
    ".2byte": _integers(2),
    ".long": _integers(4),
    ".int": _integers(4),  # four bytes in pic30-as, although int of C has two (§4.3)
    ".4byte": _integers(4),
    ".dc": _integers(2),
    ".dc.b": _integers(1),
    ".dc.w": _integers(2),
    ".dc.l": _integers(4),
    ".pbyte": _integers(1, packed=True),
    ".pword": _integers(3, packed=True),
    ".ascii": _strings(terminated=False),
    ".asciz": _strings(terminated=True),
    ".string": _strings(terminated=True),
    ".pascii": _strings(terminated=False, packed=True),
    ".pasciz": _strings(terminated=True, packed=True),
    ".pstring": _strings(terminated=True, packed=True),
    ".float": _reals("<f"),
    ".single": _reals("<f"),
    ".dc.s": _reals("<f"),
    ".double": _reals("<d"),
    ".dc.d": _reals("<d"),
    ".fixed": _fixed,
    ".sleb128": _leb128(signed=True),
    ".uleb128": _leb128(signed=False),
    ".space": _space(packed=False),
    ".skip": _space(packed=False),
    ".pspace": _space(packed=True),
    ".pskip": _space(packed=True),
    ".fill": _fill(packed=False),
    ".pfill": _fill(packed=True),
    ".align": _align(packed=False),
    ".palign": _align(packed=True),
    ".org": move_location,
    ".porg": _org(packed=True),
    ".incbin": _include_binary(packed=False),
    ".pincbin": _include_binary(packed=True),
}
