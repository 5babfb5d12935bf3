"""Completion of an object: relaxation, fixups to bits or relocations, the symbol table.

Precondition: all statements are read; values of fixups are unresolved.  Result: fields that depend on no symbol are
final; every field that depends on a symbol has a relocation, even a local branch (abi-elf.md §5).
"""

from __future__ import annotations

from emu.image.elf_facts import RELOCATION_BY_NAME, Formula, RelocationType
from toolchain.asm.debug import debug_sections
from toolchain.asm.expr import ExprError, resolve
from toolchain.asm.relax import relax
from toolchain.asm.sections import AsmSection, Fixup, SectionPiece
from toolchain.asm.state import Assembler
from toolchain.asm.symbols import AsmSymbol, ExprValue, Label, LabelledSection, PendingOperation, SymbolValue
from toolchain.elf import constants as c
from toolchain.elf import fields
from toolchain.elf.model import Bind, Home, ObjectFile, Reloc, Section, Symbol

KEEP_PREFIX = "__keep_"
"""Prefix of the local absolute symbol that makes --gc-sections keep a section; other linkers ignore it."""

_ABSOLUTE = {"PCREL_BRANCH": "BRANCH_ABSOLUTE", "PCREL_DO": "DO_ABSOLUTE"}
_HIGH = RELOCATION_BY_NAME["PGM_ADDR_MSB"]


def finish(asm: Assembler) -> ObjectFile:
    """Return the object; errors are in `asm.findings`."""
    for section in asm.sections.values():
        relax(section)
    return _Finisher(asm).run()


class _Finisher:
    def __init__(self, asm: Assembler) -> None:
        self.asm = asm
        self.sections: dict[LabelledSection, Section] = {}
        self.symbols: dict[AsmSymbol, Symbol] = {}
        self.absolutes: dict[int, Symbol] = {}
        self.sums: dict[tuple[AsmSymbol, int], AsmSymbol] = {}

    def run(self) -> ObjectFile:
        for source in self.asm.sections.values():
            section = Section(source.name, source.flags, source.type, align=source.align, extended=source.extended)
            section.load = section.address = source.load or 0
            if source.type == c.SHT_NOBITS:
                section.nobits_units = source.closed_units + len(source.piece.data)
            else:
                section.data = source.content()
            self.sections[source] = section
        for source in self.asm.sections.values():
            for fixup in source.fixups:
                try:
                    self._fill(source, fixup)
                except (ExprError, fields.FieldError) as error:
                    self.asm.error(str(error), fixup.place)
            self.sections[source].relocs.sort(key=lambda reloc: reloc.offset)
        extra, symbols = debug_sections(self.asm, self.sections)
        if c.SIGNATURE_SECTION not in self.asm.sections:
            extra.append(_signature())
        return ObjectFile(
            self.asm.file_name or self.asm.source.place.file,
            list(self.sections.values()) + extra,
            self._symbol_table() + symbols,
            self.asm.options.chip.processors[0],
        )

    # -- fixups --------------------------------------------------------------------------------------------------

    def _fill(self, source: AsmSection, fixup: Fixup) -> None:
        assert isinstance(fixup.frag, SectionPiece)
        section, kind = self.sections[source], fixup.kind
        offset = source.octets(fixup.frag, fixup.offset)
        value = resolve(fixup.value, final=True)
        if isinstance(value, PendingOperation) or (isinstance(value, SymbolValue) and value.sub is not None):
            raise ExprError(f"{_describe(value)} is neither a constant nor a symbol plus a constant")
        branch = kind.formula in (Formula.BRANCH, Formula.DO_END)
        if isinstance(value, int):
            if branch:
                self._absolute_branch(section, offset, kind, value)
            elif kind.formula is Formula.LOW16:
                _absolute_call(section, offset, kind, value)
            else:
                raw = fields.checked(kind, value)
                fields.store(section.data, offset, kind, source.is_code, raw >> (kind.formula is Formula.HALF))
            return
        if value.add is None:
            raise ExprError(f"{_describe(value)} has no symbol to relocate against")
        self._check_target(source, value, kind)
        symbol, addend = value.add, value.offset
        if branch and self._same_section(source, symbol) and _is_anonymous(symbol):
            self._local_branch(section, source, offset, kind, symbol, addend)
            return
        if kind.formula is Formula.DO_END and self._same_section(source, symbol):
            _check_do(self._distance(source, offset, symbol, addend))
        if kind.formula is Formula.LOW16:
            symbol = self._without_addend(symbol, addend)
            section.relocs.append(Reloc(offset + 4, _HIGH.number, self._reference(symbol)))
            addend = 0
        self._store_addend(section, source, offset, kind, addend)
        section.relocs.append(Reloc(offset, kind.number, self._reference(symbol)))

    def _same_section(self, source: AsmSection, symbol: AsmSymbol) -> bool:
        return isinstance(symbol.place, Label) and symbol.place.frag.section is source

    def _distance(self, source: AsmSection, offset: int, symbol: AsmSymbol, addend: int) -> int:
        """Return the branch distance in words from the word at octet `offset`."""
        assert isinstance(symbol.place, Label)
        target = symbol.place.frag.start + symbol.place.offset + addend
        return (target - (offset // 2 + 2)) // 2

    def _local_branch(
        self, section: Section, source: AsmSection, offset: int, kind: RelocationType, symbol: AsmSymbol, addend: int
    ) -> None:
        """Resolve a branch such as `bra .+4`: its distance is final, so it needs no relocation."""
        if addend & 1:
            raise ExprError(f"branch to an odd address (. + {addend})")
        distance = self._distance(source, offset, symbol, addend)
        if kind.formula is Formula.DO_END:
            _check_do(distance)
        fields.store(section.data, offset, kind, True, fields.checked(kind, distance))

    def _absolute_branch(self, section: Section, offset: int, kind: RelocationType, value: int) -> None:
        if value & 1 or not 0 <= value <= 0xFFFFFF:
            raise ExprError(f"{value:#x} is no instruction address")
        symbol = self.absolutes.get(value)
        if symbol is None:
            symbol = self.absolutes[value] = Symbol(f".LA{value:x}", Home.ABSOLUTE, value=value)
        number = RELOCATION_BY_NAME[_ABSOLUTE[kind.name.removeprefix("R_PIC30_")]].number
        section.relocs.append(Reloc(offset, number, symbol))

    def _check_target(self, source: AsmSection, value: SymbolValue, kind: RelocationType) -> None:
        """Raise `ExprError` for an operator that does not fit the section of its target (abi-elf.md §4.2)."""
        assert value.add is not None
        place = value.add.place
        if not isinstance(place, Label):
            return
        target = place.frag.section
        if value.op == "handle" and not target.is_code:
            raise ExprError(f"handle() needs a function, {value.add.name} is in section {target.name}")
        if value.op in ("", "edspage", "edsoffset") or target.is_code or target.flags & _PROGRAM or not target.flags:
            executable = target.is_code and not value.op and kind.number in _DATA_ONLY and source.flags
            if executable:
                raise ExprError(
                    f"Cannot reference executable symbol {value.add.name} as data: use handle() or tbloffset()"
                )
            return
        raise ExprError(f"{value.op}() needs a program address, {value.add.name} is in data section {target.name}")

    def _without_addend(self, symbol: AsmSymbol, addend: int) -> AsmSymbol:
        """Return a new symbol for symbol + addend, because the second word of CALL and GOTO has no addend (§5, 33)."""
        if addend == 0:
            return symbol
        if not isinstance(symbol.place, Label):
            raise ExprError(f"call or goto to {symbol.name} plus an offset cannot be expressed: define a label there")
        key = (symbol, addend)
        if key not in self.sums:
            label = Label(symbol.place.frag, symbol.place.offset + addend)
            self.sums[key] = AsmSymbol(f".LS{len(self.sums)}", label)
        return self.sums[key]

    def _store_addend(
        self, section: Section, source: AsmSection, offset: int, kind: RelocationType, addend: int
    ) -> None:
        if kind.formula is Formula.HALF:
            if addend & 1 or not -0x8000 <= addend <= 0xFFFF:
                raise fields.FieldError(f"offset {addend} of a word access must be even and 16 bits long")
            fields.store(section.data, offset, kind, True, addend >> 1)
        elif kind.formula is Formula.BRANCH or kind.formula is Formula.DO_END:
            if addend & 1 or not -0x8000 <= addend <= 0x7FFF:
                raise fields.FieldError(f"branch offset {addend} must be even and fit 16 bits: define a label there")
            fields.store(section.data, offset, kind, True, addend)
        else:
            half = 1 << kind.width - 1
            if not -half <= addend < 2 * half:
                raise fields.FieldError(f"offset {addend} does not fit the {kind.width}-bit field")
            if kind.formula is not Formula.LOW16:
                fields.store(section.data, offset, kind, source.is_code, addend)

    # -- symbols -------------------------------------------------------------------------------------------------

    def _reference(self, symbol: AsmSymbol) -> Symbol:
        """Return the object-file symbol for a relocation against `symbol`."""
        return self.symbols.get(symbol) or self._emit(symbol)

    def _emit(self, symbol: AsmSymbol) -> Symbol:
        result = self.symbols[symbol] = Symbol(symbol.name, type=symbol.type, visibility=symbol.visibility)
        result.bind = symbol.bind or Bind.LOCAL
        if symbol.common is not None:
            result.home, (result.size, result.value) = Home.COMMON, symbol.common
        elif symbol.place is None:
            if symbol.name.startswith(".L"):
                self.asm.error(f"{_local_name(symbol.name)} is used but never defined", symbol.first_use)
            elif symbol.bind in (None, Bind.GLOBAL):
                result.bind = Bind.GLOBAL
            elif symbol.bind is Bind.LOCAL:
                self.asm.error(f"local symbol {symbol.name} is used but never defined", symbol.first_use)
        elif isinstance(symbol.place, Label):
            label = symbol.place
            result.home, result.section = Home.SECTION, self.sections[label.frag.section]
            result.value = label.frag.start + label.offset
        else:
            self._emit_equate(symbol, result)
        if symbol.size is not None:
            size = resolve(symbol.size, final=True)
            if isinstance(size, int) and 0 <= size <= 0xFFFFFFFF:
                result.size = size
            else:
                self.asm.error(f".size of {symbol.name} is not a constant")
        return result

    def _emit_equate(self, symbol: AsmSymbol, result: Symbol) -> None:
        assert symbol.place is not None
        assert not isinstance(symbol.place, Label)
        value = resolve(symbol.place, final=True)
        if isinstance(value, int):
            result.home, result.value = Home.ABSOLUTE, value
        elif (
            isinstance(value, SymbolValue)
            and value.add
            and isinstance(value.add.place, Label)
            and not (value.op or value.sub)
        ):
            label = value.add.place
            result.home, result.section = Home.SECTION, self.sections[label.frag.section]
            result.value = label.frag.start + label.offset + value.offset
            result.type = result.type or value.add.type
        else:
            self.asm.error(f"symbol {symbol.name} cannot be exported: {_describe(value)} is not known in this file")

    def _symbol_table(self) -> list[Symbol]:
        """Emit the symbols that the file defines or exports; .L names and local equates only if needed."""
        for symbol in self.asm.symbols.values():
            if symbol in self.symbols:
                continue
            exported = symbol.bind is not None and (symbol.place is not None or symbol.common is not None)
            label = isinstance(symbol.place, Label) and not symbol.name.startswith(".L")
            if exported or label or (symbol.bind is Bind.WEAK and symbol.used):
                try:
                    self._emit(symbol)
                except ExprError as error:
                    self.asm.error(str(error))
        result = list(self.symbols.values()) + list(self.absolutes.values())
        for source in self.asm.sections.values():
            if source.keep:
                result.append(Symbol(KEEP_PREFIX + source.name, Home.ABSOLUTE, value=1))
        return result


_PROGRAM = 0x30000000  # section flags PSV | EEDATA
_DATA_ONLY = frozenset((RELOCATION_BY_NAME["WORD"].number, RELOCATION_BY_NAME["16"].number))


def _absolute_call(section: Section, offset: int, kind: RelocationType, value: int) -> None:
    """Store the numeric target of a CALL or GOTO in its two words (isa.md §7.1)."""
    if value & 1 or not 0 <= value <= 0x7FFFFE:
        raise ExprError(f"{value:#x} is no instruction address")
    fields.store(section.data, offset, kind, True, value)
    fields.store(section.data, offset + 4, _HIGH, True, value >> 16)


def _is_anonymous(symbol: AsmSymbol) -> bool:
    return symbol.name.startswith(".LH")


def _signature() -> Section:
    octets = b"".join(bytes((word & 0xFF, 0, word >> 8, 0)) for word in c.SIGNATURE_WORDS)
    return Section(c.SIGNATURE_SECTION, 0, c.SHT_NOTE, bytearray(octets), align=1)


def _local_name(name: str) -> str:
    """Return the name of a local label as it is spelled in the source."""
    return f"local label {name[3:].partition('.')[0]}:" if name.startswith(".LN") else f"local label {name}"


def _check_do(distance: int) -> None:
    """Raise `ExprError` for a DO loop of fewer than two instructions (isa.md §7.6)."""
    if distance in (-2, -1, 0):
        raise ExprError("DO loop shorter than two instructions")


def _describe(value: ExprValue) -> str:
    if isinstance(value, int):
        return str(value)
    if isinstance(value, PendingOperation):
        inner = f"{_describe(value.left)} {value.op} {_describe(value.right)}" if value.right is not None else value.op
        return f"({inner})"
    text = value.add.name if value.add else "0"
    if value.sub is not None:
        text += f" - {value.sub.name}"
    if value.offset:
        text += f" {'+' if value.offset > 0 else '-'} {abs(value.offset)}"
    return f"{value.op}({text})" if value.op else text
