"""Sections that the linker generates: reset, vector tables, default handler, handles, RETURN of .user_init.

They have ordinary relocations, so that placement and relocation need no special cases.
"""

from __future__ import annotations

from emu.chips.family import SLOTS
from emu.dspic30f.isa import text
from emu.dspic30f.isa.debugger_words import HALT
from emu.image.elf_facts import OCTETS_PER_WORD, RELOCATION_BY_NAME, RELOCATIONS, Formula, SectionFlag
from toolchain.elf.model import Bind, Home, ObjectFile, Reloc, Section, Symbol
from toolchain.link.resolve import Resolution

CODE = SectionFlag.ALLOC | SectionFlag.EXECINSTR
_LSB, _MSB = RELOCATION_BY_NAME["PGM_ADDR_LSB"].number, RELOCATION_BY_NAME["PGM_ADDR_MSB"].number
_PADDR = RELOCATION_BY_NAME["P_PADDR"].number
HANDLES = frozenset(number for number, kind in RELOCATIONS.items() if kind.formula is Formula.HANDLE)


def code_words(statement: str) -> bytes:
    """Return the octets of one instruction."""
    return words_octets(*text.parse(statement).encode(0))


def words_octets(*words: int) -> bytes:
    """Return program words as file octets (abi-elf.md §6.2)."""
    return b"".join(word.to_bytes(OCTETS_PER_WORD, "little") for word in words)


def _goto(section: Section, symbol: Symbol) -> None:
    at = len(section.data)
    section.data += code_words("goto 0")
    section.relocs += [Reloc(at, _LSB, symbol), Reloc(at + OCTETS_PER_WORD, _MSB, symbol)]


def undefined_symbol(name: str) -> Symbol:
    """Return an undefined global symbol, to which a relocation refers."""
    return Symbol(name, Home.UNDEFINED, bind=Bind.GLOBAL)


def reset_section(entry: str) -> Section:
    """Return the reset section, a GOTO to `entry` at address 0 (abi-elf.md §3.1)."""
    section = Section(".reset", CODE)
    _goto(section, undefined_symbol(entry))
    return section


def default_interrupt(obj: ObjectFile) -> None:
    """Add a `__DefaultInterrupt` to `obj`: breakpoint word, RESET (abi-elf.md §3.3)."""
    section = Section(".isr", CODE, data=bytearray(words_octets(HALT) + code_words("reset")))
    obj.sections.append(section)
    obj.symbols.append(Symbol("__DefaultInterrupt", Home.SECTION, section, 0, section.units, Bind.GLOBAL))


def vector_tables(resolution: Resolution, filled: bool) -> tuple[Section, Section]:
    """Return .ivt and .aivt: vector X is `__X` or `__AltX` if defined, else the default (abi-elf.md §2.7)."""
    tables = (Section(".ivt", CODE), Section(".aivt", CODE))
    for vector in SLOTS:
        choices = ((vector.symbol,), (vector.alternate_symbol, vector.symbol))
        for table, names in zip(tables, choices, strict=True):
            name = next((n for n in names if n in resolution.globals), "__DefaultInterrupt" if filled else "")
            if name:
                table.relocs.append(Reloc(len(table.data), _PADDR, undefined_symbol(name)))
            table.data += words_octets(0)
    return tables


def handle_section(resolution: Resolution, live: set[Section]) -> tuple[Section, dict[Symbol, int]]:
    """Return .handle, a GOTO slot per function whose address is taken, and the slot offsets (abi-elf.md §1.5)."""
    section = Section(".handle", CODE)
    slots: dict[Symbol, int] = {}
    for obj in resolution.objects:
        for source in obj.sections:
            if source not in live:
                continue
            for reloc in source.relocs:
                if reloc.type not in HANDLES:
                    continue
                target = resolution.lookup(reloc.symbol)
                if target not in slots and target.home is not Home.UNDEFINED:
                    slots[target] = section.units
                    _goto(section, target)
    return section, slots


def user_init_return() -> Section:
    """Return the RETURN that ends the .user_init calls (abi-elf.md §3.3)."""
    return Section(".user_init", CODE, data=bytearray(code_words("return")))
