"""Instructions: translation of statements to program words and fixups by the parser of the instruction table.

Results are cached by statement text, because compiler output contains many equal statements. The parsed statement is
cached if it contains only literals and plain symbols; its encoding is cached if it contains no symbol.
"""

from __future__ import annotations

from dataclasses import dataclass

from emu.dspic30f.isa.text import Parsed, Slot, StatementError, parse
from emu.image.elf_facts import RELOCATION_BY_NAME, RelocationType
from toolchain.asm import expr
from toolchain.asm.directives.data import operator_of
from toolchain.asm.expr import ExprError, combine
from toolchain.asm.sections import Fixup, Relaxable
from toolchain.asm.state import Assembler
from toolchain.asm.symbols import ExprValue, SymbolValue
from toolchain.elf.model import Bind

CACHE_LIMIT = 100_000  # maximum number of cached statements; bounds the memory of long-lived processes
_TARGETS = frozenset(("PCREL_BRANCH", "PCREL_DO"))
_SHORT = {"CALL": "rcall 0", "GOTO": "bra 0"}


@dataclass(frozen=True, slots=True)
class _Operand:
    """An operand expression as the table's parser reads it; `value` is set if it is already a number."""

    tree: expr.Tree
    value: int | None


@dataclass(slots=True)
class _Known:
    """A cached statement; `words` is its encoding if that depends neither on symbols nor on the location."""

    parsed: Parsed
    words: tuple[int, ...] | None


_cache: dict[str, _Known] = {}


def assemble_instruction(asm: Assembler, mnemonic: str, operands: str) -> None:
    """Assemble one instruction at the current location of a code section."""
    statement = f"{mnemonic} {asm.with_registers(operands)}" if operands else mnemonic
    known = _cache.get(statement) or _read(asm, statement)
    parsed = known.parsed
    asm.section.align_word()
    if asm.after_repeat:
        asm.after_repeat = ""
        if not parsed.row.repeat_ok:
            raise ExprError(f"{parsed.row.mnemonic} cannot be repeated by REPEAT (isa.md §7.5)")
    if parsed.row.mnemonic == "REPEAT":
        asm.after_repeat = parsed.row.mnemonic
    if asm.options.debug:
        asm.line_rows.append((asm.section.label(), asm.source.place))
    if known.words is not None:
        for word in known.words:
            asm.section.put_word(word)
        return
    _put(asm, parsed)


def _read(asm: Assembler, statement: str) -> _Known:
    depends = False

    def operand(text: str) -> _Operand:
        nonlocal depends
        tree = expr.parse(text)
        if isinstance(tree, int):
            return _Operand(tree, tree)
        value = asm.value_of(tree)
        if isinstance(value, int):
            depends = True  # the encoding depends on a symbol that may be redefined
            return _Operand(tree, value)
        return _Operand(tree, None)

    parsed = parse(statement, operand)
    words = None
    if not depends:
        if all(slot.expression.value is not None and slot.relocation not in _TARGETS for slot in parsed.slots):
            words = parsed.encode(0)
        if len(_cache) >= CACHE_LIMIT:
            _cache.clear()
        _cache[statement] = _Known(parsed, words)
    return _Known(parsed, words)


def _put(asm: Assembler, parsed: Parsed) -> None:
    values: dict[int, int | None] = {}
    open_slots: list[tuple[Slot, ExprValue]] = []
    for index, slot in enumerate(parsed.slots):
        value = asm.value_of(slot.expression.tree)
        if isinstance(value, int) and slot.relocation not in _TARGETS:
            values[index] = value
        else:
            values[index] = None
            open_slots.append((slot, value))
    words = parsed.encode(0, values)
    if (
        asm.options.relax
        and parsed.row.mnemonic in _SHORT
        and open_slots
        and _put_relaxable(asm, parsed, words, open_slots[0][1])
    ):
        return
    section = asm.section
    offset = section.put_word(words[0])
    for word in words[1:]:
        section.put_word(word)
    for slot, value in open_slots:
        kind, place = _kind(slot, value)
        section.add_fixup(
            offset + place, kind, combine("+", value, slot.addend) if slot.addend else value, asm.source.place
        )


def _kind(slot: Slot, value: ExprValue) -> tuple[RelocationType, int]:
    """Return the relocation of an operand and the octet offset of its word within the instruction."""
    name = slot.relocation
    if not name:
        raise ExprError("this operand must be a number known here")
    op = operator_of(value)
    if op:
        suffix = op.upper()
        candidate = f"WORD_{suffix}" if name == "WORD" else f"{name}_{suffix}"
        if candidate not in RELOCATION_BY_NAME or name not in ("WORD", "UNSIGNED_10"):
            raise ExprError(f"{op}() cannot be used in this operand")
        return RELOCATION_BY_NAME[candidate], 0
    if name == "PGM_ADDR":
        return RELOCATION_BY_NAME["PGM_ADDR_LSB"], 0
    return RELOCATION_BY_NAME[name], 4 if name == "PCREL_DO" else 0


def _put_relaxable(asm: Assembler, parsed: Parsed, words: tuple[int, ...], value: ExprValue) -> bool:
    """Emit CALL or GOTO in its own piece, so that relaxation can shorten it; False if its target rules that out."""
    if not isinstance(value, SymbolValue) or value.add is None or value.offset or value.sub or value.op:
        return False
    if value.add.bind is Bind.WEAK:
        return False
    section = asm.section
    piece = section.close_piece()
    for word in words:
        section.put_word(word)
    place = asm.source.place
    long_fixup = Fixup(piece, 0, RELOCATION_BY_NAME["PGM_ADDR_LSB"], value, place)
    short_fixup = Fixup(piece, 0, RELOCATION_BY_NAME["PCREL_BRANCH"], value, place)
    short = parse(_SHORT[parsed.row.mnemonic]).encode(0, {0: None})[0].to_bytes(4, "little")
    section.relaxables.append(Relaxable(piece, value.add, short, long_fixup, short_fixup))
    section.close_piece()
    return True


__all__ = ["StatementError", "assemble_instruction"]
