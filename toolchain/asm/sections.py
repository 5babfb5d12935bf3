"""Sections under construction: location counting of abi-elf.md §4.4 and the octet layout of §6.2.

In code sections a location is a PC unit. Data fills the low and the middle byte of each program word; `.p` data fills
all three bytes.  In other sections a location is a byte; phantom octets are added when the section is finished.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from emu.image.elf_facts import OCTETS_PER_WORD, ExtendedAttribute, RelocationType, SectionFlag
from toolchain.asm.expr import ExprError
from toolchain.asm.symbols import AsmSymbol, ExprValue, Frag, Label, LabelledSection
from toolchain.elf import constants as c
from toolchain.errors import SourceLocation

CODE_LIMIT = 1 << 24  # PC units: no program address is longer than 24 bits (isa.md §1.1)
DATA_LIMIT = 1 << 16  # bytes; data space is 64 KB (isa.md §1.2)
INFO_LIMIT = 1 << 24  # bytes; debug sections are in no address space, the limit stops an unintended .space


@dataclass(slots=True)
class Fixup:
    """A field whose value is not yet a number."""

    frag: Frag
    offset: int  # from the start of the piece, in octets (code) or bytes (other sections)
    kind: RelocationType
    value: ExprValue
    place: SourceLocation


@dataclass(slots=True, eq=False)
class SectionPiece(Frag):
    """A fragment with its content, which is in octets in code and in bytes in other sections."""

    section: AsmSection
    data: bytearray = field(default_factory=bytearray)


@dataclass(slots=True)
class Relaxable:
    """CALL or GOTO alone in `piece`, with the one-word branch that may replace it."""

    piece: SectionPiece
    target: AsmSymbol
    short: bytes
    fixup: Fixup
    short_fixup: Fixup
    is_short: bool = False


def _spread(data: bytes, per_word: int, fill_upper: int) -> bytearray:
    """Return `data` as program words of `per_word` bytes each, the last one zero padded (abi-elf.md §6.2)."""
    count = -(-len(data) // per_word)
    padded = data.ljust(count * per_word, b"\0")
    octets = bytearray(count * OCTETS_PER_WORD)
    for lane in range(per_word):
        octets[lane::OCTETS_PER_WORD] = padded[lane::per_word]
    if per_word == 2 and fill_upper:
        octets[2::OCTETS_PER_WORD] = bytes((fill_upper,)) * count
    return octets


class AsmSection(LabelledSection):
    """One section of the object being assembled."""

    def __init__(self, name: str, flags: int, kind: int, place: SourceLocation) -> None:
        self.name, self.place = name, place
        self.extended = ExtendedAttribute(0)
        self.load: int | None = None
        self.keep = False
        self.labelled = False
        self.pieces: list[SectionPiece] = [SectionPiece(self)]
        self.piece = self.pieces[0]
        self.closed_units = 0  # length of all pieces except the current one, before relaxation
        self.fixups: list[Fixup] = []
        self.relaxables: list[Relaxable] = []
        self.fill_value = self.fill_upper = self.packed_fill_value = 0  # bytes that fill gaps
        self._data_bytes = 0  # data bytes in the last word, 0 or 1
        self._packed_bytes = 0  # .p bytes in the last word, 0..2
        self.configure(flags, kind)

    def configure(self, flags: int, kind: int) -> None:
        """Set flags, ELF type and unit of locations; the section must be empty."""
        self.flags, self.type = flags, kind
        self.align = 2 if flags & SectionFlag.ALLOC else 1
        self.is_code = bool(flags & SectionFlag.EXECINSTR)
        if kind == c.SHT_NOBITS:
            self.limit = DATA_LIMIT
        elif not flags & SectionFlag.ALLOC:
            self.limit = INFO_LIMIT
        else:
            self.limit = CODE_LIMIT if self.is_code else DATA_LIMIT

    def is_untouched(self) -> bool:
        """Whether the section has neither content nor labels, so that its attributes may change."""
        return not (self.closed_units or self.piece.data or self.labelled)

    def here(self) -> int:
        """Return the location within the current piece, in address units."""
        if not self.is_code:
            return len(self.piece.data)
        whole = len(self.piece.data) // 2
        return whole - 2 + self._data_bytes if self._data_bytes else whole

    def location(self) -> int:
        """Return the location from the section start, before relaxation."""
        return self.closed_units + self.here()

    def label(self) -> Label:
        """Return a label for the current location; in code it is the next free program word."""
        self.align_word()
        return self.dot()

    def dot(self) -> Label:
        """Return the value of `.`: the current location; in code it is the word being filled."""
        self.labelled = True
        if not self._data_bytes and not self._packed_bytes:
            return Label(self.piece, self.here())
        return Label(self.piece, len(self.piece.data) // 2 - 2)

    def put_word(self, word: int) -> int:
        """Append one program word at the next word boundary; return its octet offset in the current piece."""
        if self._data_bytes or self._packed_bytes:
            self.align_word()
        data = self.piece.data
        data += word.to_bytes(OCTETS_PER_WORD, "little")
        return len(data) - OCTETS_PER_WORD

    def align_word(self, fill: int | None = None, packed: bool = False) -> None:
        """Advance to the next program word; fill the rest of this one with `fill`, by default the section's value.

        The upper byte of a data word is that of `.fillupper`, unless `packed` fills all three bytes.
        """
        used = self._data_bytes or self._packed_bytes
        if not used:
            return
        packed = packed or bool(self._packed_bytes)
        fill = self.default_fill(packed) if fill is None else fill
        lanes = (fill, fill, fill if packed else self.fill_upper)
        octets = self.piece.data
        octets[used - OCTETS_PER_WORD : -1] = bytes(lanes[used:])
        self._data_bytes = self._packed_bytes = 0

    def put_bytes(self, data: bytes) -> int:
        """Append data bytes; return the offset of the first one within the piece, in octets (code) or bytes."""
        self._check_room(len(data))
        if not self.is_code:
            offset = len(self.piece.data)
            self.piece.data += data
            return offset
        if self._packed_bytes:
            self.align_word()
        octets, position = self.piece.data, 0
        first = len(octets) - 3 if self._data_bytes else len(octets)
        if self._data_bytes and data:
            octets[-3:-1] = (data[0], self.fill_upper)
            position = 1
        octets += _spread(data[position:], 2, self.fill_upper)
        self._data_bytes = (self._data_bytes + len(data)) & 1
        return first

    def put_packed(self, data: bytes) -> int:
        """Append `.p` bytes, three to a word; return the octet offset of the first one within the piece."""
        if not self.is_code:
            raise ExprError(f"section {self.name} holds no program words: .p directives belong into code sections")
        self._check_room(len(data))
        if self._data_bytes:
            self.align_word()
        octets = self.piece.data
        first = len(octets) - OCTETS_PER_WORD + self._packed_bytes if self._packed_bytes else len(octets)
        room = -self._packed_bytes % 3
        if room:
            head = data[:room]
            octets[first : first + len(head)] = head
            data = data[room:]
            self._packed_bytes = (self._packed_bytes + len(head)) % 3
        octets += _spread(data, 3, 0)
        if data:
            self._packed_bytes = len(data) % 3
        return first

    def _check_room(self, units: int) -> None:
        if self.closed_units + len(self.piece.data) + units > 2 * self.limit + 8:
            raise ExprError(f"section {self.name} grows beyond {self.limit:#x} address units")

    def default_fill(self, packed: bool) -> int:
        """Return the default fill byte of a directive; it is 0 in data sections."""
        return self.packed_fill_value if packed else self.fill_value

    def skip(self, units: int, fill: int, packed: bool = False) -> None:
        """Advance by `units` locations, filled with bytes `fill`; if `packed`, all three bytes of each word."""
        if units < 0:
            raise ExprError(f"cannot advance by {units}")
        self._check_room(units)
        if packed and self.is_code:
            self.put_packed(bytes((fill & 0xFF,)) * (units // 2 * 3))
        else:
            self.put_bytes(bytes((fill & 0xFF,)) * units)

    def bytes_to(self, units: int) -> int:
        """Return how many bytes `.align units` would fill, without the upper bytes of data words."""
        part = 3 - self._packed_bytes if self._packed_bytes else 0
        return part + -self.location() % units

    def align_to(self, units: int, fill: int, packed: bool = False) -> None:
        """Advance to the next multiple of `units` (a power of two); fill the gap as `skip` does."""
        if units <= 0 or units & (units - 1):
            raise ExprError(f"alignment {units} is not a power of two")
        if units > self.limit:
            raise ExprError(f"alignment {units} is beyond the address space")
        if self.is_code and units >= 2:
            self.align_word(fill & 0xFF, packed)
        if self.relaxables and units > 2:
            raise ExprError("alignment beyond 2 after a call that --relax may shorten: use a section of its own")
        self.align = max(self.align, units)
        self.skip(-self.location() % units, fill, packed)

    def add_fixup(self, offset: int, kind: RelocationType, value: ExprValue, place: SourceLocation) -> Fixup:
        """Record that the field at `offset` of the current piece gets `value`."""
        fixup = Fixup(self.piece, offset, kind, value, place)
        self.fixups.append(fixup)
        return fixup

    def close_piece(self) -> SectionPiece:
        """End the current piece and start the next one; return the new piece."""
        self.align_word()
        self.closed_units += self.here()
        self.piece = SectionPiece(self, self.closed_units)
        self.pieces.append(self.piece)
        return self.piece

    def octets(self, piece: SectionPiece, offset: int) -> int:
        """Return the file offset of a fixup's `offset`, in octets from the section start (abi-elf.md §5)."""
        return piece.start * 2 + (offset if self.is_code else offset * 2)

    def content(self) -> bytearray:
        """Return the finished octets of the section."""
        self.align_word()
        data = bytearray().join(p.data for p in self.pieces)
        if self.is_code:
            return data
        doubled = bytearray(2 * len(data))
        doubled[::2] = data
        return doubled
