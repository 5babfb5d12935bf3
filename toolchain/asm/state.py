"""State of an assembly: symbols, sections, location, errors.

Errors are collected, so that one run reports all of them; the assembly stops after MAX_ERRORS.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field

from emu.chips import chip_named
from emu.chips.chip import Chip
from emu.image.elf_facts import SectionFlag
from toolchain.asm import expr
from toolchain.asm.conditionals import Conditionals
from toolchain.asm.expr import ExprError
from toolchain.asm.macro import Macro
from toolchain.asm.sections import AsmSection
from toolchain.asm.source import Source, SourceFrame
from toolchain.asm.symbols import AsmSymbol, ExprValue, Label, SymbolValue
from toolchain.elf import constants as c
from toolchain.errors import SourceLocation, ToolError

MAX_ERRORS = 50
DEVICE_SYMBOLS = (
    "__dsPIC30F",
    "__HAS_DSP",
    "__HAS_EEDATA",
    "__HAS_5VOLTS",
    "__C30ELF",
)
"""Absolute symbols of value 1 that are always defined, in addition to the name of the chip (abi-elf.md §4.3)."""


def device_symbols(chip: Chip) -> tuple[str, ...]:
    """Return the predefined symbols of a chip, which have value 1."""
    guard = ("__HAS_CODEGUARD",) if "FBS" in chip.config else ()
    return (f"__{chip.name.removeprefix('dsPIC')}", *DEVICE_SYMBOLS, *guard)


_REGISTER = re.compile(r"[wW](?:1[0-5]|[0-9])")
_WORD = re.compile(r"'(?:\\.|[^\\])'?|(?<![\w.$])[A-Za-z_.$][\w.$]*")
_NUMERIC_LABEL = re.compile(r"(\d+)([fb])$")


@dataclass(slots=True, kw_only=True)
class Options:
    """Options of one run of the assembler."""

    include: list[str] = field(default_factory=list)
    define: dict[str, int] = field(default_factory=dict)
    relax: bool = False
    compiled: bool = False  # `file` is the source of the compiler; only line markers set line numbers
    debug: bool = False
    chip: Chip = field(default_factory=chip_named)
    prefix_map: list[tuple[str, str]] = field(default_factory=list)

    def recorded(self, path: str) -> str:
        """Return a path for debug information, with its prefix replaced by the last matching pair of `prefix_map`."""
        for old, new in reversed(self.prefix_map):
            if path.startswith(old):
                return new + path[len(old) :]
        return path


class Assembler:
    """State of one run of the assembler, shared by directives and instructions."""

    def __init__(self, text: str, file: str, options: Options) -> None:
        self.options = options
        self.source = Source(text, file, counted=not options.compiled)
        self.conditionals = Conditionals()
        self.source.on_end = self._frame_ended
        self.symbols: dict[str, AsmSymbol] = {}
        self.registers: dict[str, str] = {}  # working register by the name that .equ or .set defines for it
        self.declared: set[str] = set()  # symbols declared by .extern
        self.macros: dict[str, Macro] = {}
        self.serial = 0  # number of macro expansions so far, the value of `\@`
        self.findings: list[str] = []
        self.messages: list[str] = []  # text of .print and warnings, which the caller prints
        self.sections: dict[str, AsmSection] = {}
        self.section_stack: list[tuple[AsmSection, AsmSection]] = []
        self.numeric: dict[str, int] = {}
        self.anonymous = 0
        self.after_repeat = ""  # "REPEAT" or its suffixed form if the previous instruction is one, else ""
        self.file_name = ""
        self.label = ""  # last label defined, for messages
        self.line_rows: list[tuple[Label, SourceLocation]] = []
        self.ended = False
        place = SourceLocation(file, 0)
        code = int(SectionFlag.ALLOC | SectionFlag.EXECINSTR)
        data = int(SectionFlag.ALLOC | SectionFlag.WRITE)
        for name, flags, kind in (
            (".text", code, c.SHT_PROGBITS),
            (".data", data, c.SHT_PROGBITS),
            (".bss", data, c.SHT_NOBITS),
        ):
            self.sections[name] = AsmSection(name, flags, kind, place)  # emitted even if empty (§7 item 8)
        self.section = self.previous = self.sections[".text"]
        for name in device_symbols(options.chip):
            self.symbols[name] = AsmSymbol(name, 1)
        for name, value in options.define.items():
            self.symbols[name] = AsmSymbol(name, value)

    # -- errors ------------------------------------------------------------------------------------------------

    def error(self, message: str, place: SourceLocation | None = None) -> None:
        """Record an error at `place`, by default the current line; stop the assembly if there are too many."""
        self.findings.append(f"{place or self.source.place}: error: {message}")
        if len(self.findings) >= MAX_ERRORS:
            self.findings.append(f"{self.source.place.file}: error: more than {MAX_ERRORS} errors, giving up")
            raise ToolError.of(self.findings)

    def warn(self, message: str) -> None:
        """Record a warning at the current line; the caller prints it."""
        self.messages.append(f"{self.source.place}: warning: {message}")

    # -- symbols and expressions ---------------------------------------------------------------------------------

    def symbol(self, name: str) -> AsmSymbol:
        """Return the symbol called `name`, creating it as undefined."""
        found = self.symbols.get(name)
        if found is None:
            found = self.symbols[name] = AsmSymbol(name)
        return found

    def lookup(self, name: str) -> ExprValue:
        """Return the current value of a name; numeric local labels become their unique name."""
        if name[0].isdigit():
            match = _NUMERIC_LABEL.fullmatch(name)
            if match is None:
                raise ExprError(f"bad local label {name}")
            count = self.numeric.get(match[1], 0)
            if match[2] == "b" and count == 0:
                raise ExprError(f"local label {match[1]}: is not defined before this line")
            name = f".LN{match[1]}.{count + (match[2] == 'f')}"
        symbol = self.symbol(name)
        if symbol.place is None or isinstance(symbol.place, Label):
            symbol.used = True
            if symbol.first_use is None:
                symbol.first_use = self.source.place
            return SymbolValue(symbol)
        return symbol.place

    def here(self) -> ExprValue:
        """Return the current location as a value."""
        self.anonymous += 1
        return SymbolValue(AsmSymbol(f".LH{self.anonymous}", self.section.dot()))

    def evaluate(self, text: str) -> ExprValue:
        """Return the value of expression `text`, as far as it is known; a leading `#` is ignored."""
        return self.value_of(expr.parse(text.strip().removeprefix("#")))

    def value_of(self, tree: expr.Tree) -> ExprValue:
        """Return the value of a parsed expression, as far as it is known."""
        if isinstance(tree, int):
            return tree
        return expr.resolve(expr.evaluate(tree, self.lookup, self.here), final=False)

    def constant(self, text: str, what: str = "expression") -> int:
        """Return the value of `text`; raise `ExprError` if it is not yet a number."""
        value = self.evaluate(text)
        if not isinstance(value, int):
            raise ExprError(f"{what} {text.strip()!r} must be a constant at this point")
        return value

    def location(self, text: str) -> int:
        """Return the location in the current section that `text` denotes: a number, or a label plus a number."""
        value = self.evaluate(text)
        if isinstance(value, int):
            return value
        place = (
            value.add.place if isinstance(value, SymbolValue) and value.add and not (value.sub or value.op) else None
        )
        if not isinstance(place, Label) or place.frag.section is not self.section:
            raise ExprError(f"location {text.strip()!r} must be a number, or a label of this section plus a number")
        assert isinstance(value, SymbolValue)
        return place.frag.start + place.offset + value.offset

    def define_label(self, name: str) -> None:
        """Place label `name` at the current location."""
        if name.isdigit():
            self.numeric[name] = self.numeric.get(name, 0) + 1
            name = f".LN{name}.{self.numeric[name]}"
        symbol = self.symbol(name)
        if symbol.place is not None or symbol.common is not None or name in self.registers:
            raise ExprError(f"symbol {name} is already defined")
        symbol.place = self.section.label()
        self.label = name

    def assign(self, name: str, text: str, once: bool = False) -> None:
        """Assign the value of `text`, possibly a working register, to `name` (.set, .equ, =; `once`: .equiv)."""
        symbol = self.symbols.get(name)
        known = name in self.registers or (symbol is not None and symbol.place is not None)
        if (once and known) or (symbol is not None and isinstance(symbol.place, Label)):
            raise ExprError(f"symbol {name} is already defined")
        register = self.with_registers(text.strip())
        if _REGISTER.fullmatch(register):
            if symbol is not None:
                raise ExprError(f"symbol {name} is already in use: it cannot name a register any more")
            self.registers[name] = register
            return
        self.registers.pop(name, None)
        symbol = self.symbol(name)
        value = self.evaluate(text)
        if isinstance(value, SymbolValue) and value.add is symbol:
            raise ExprError(f"symbol {name} is defined in terms of itself")
        symbol.place = value

    def with_registers(self, operands: str) -> str:
        """Return `operands` with names that .equ or .set defines for registers replaced by the registers."""
        if not self.registers:
            return operands
        return _WORD.sub(lambda word: self.registers.get(word[0], word[0]), operands)

    def find_file(self, name: str) -> str:
        """Return the path of an include file, found in the folder of the including file, the current or an -I folder.

        If no file has that name, backslashes in it separate folders.
        """
        beside = os.path.dirname(self.source.place.file)
        for spelling in dict.fromkeys((name, name.replace("\\", "/"))):
            for folder in (beside, "", *self.options.include):
                path = os.path.join(folder, spelling)
                if os.path.isfile(path):
                    return path
        raise ExprError(f"cannot find {name!r} beside the source, here, or in the -I folders")

    # -- frames ------------------------------------------------------------------------------------------------------

    def _frame_ended(self, frame: SourceFrame) -> None:
        if self.conditionals.depth > frame.conditionals:
            opened = self.conditionals.innermost()
            self.conditionals.cut(frame.conditionals)
            if not self.ended:
                self.error(".if is never closed by .endif", opened)
