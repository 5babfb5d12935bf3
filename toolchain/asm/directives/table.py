"""Table of all directives, and handlers of those for sections, symbols and messages (abi-elf.md §4.3)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

from toolchain.asm.directives import attributes
from toolchain.asm.directives.blocks import BLOCK_DIRECTIVES, symbol_names
from toolchain.asm.directives.data import DATA_DIRECTIVES, move_location, string_argument
from toolchain.asm.expr import ExprError
from toolchain.asm.sections import AsmSection
from toolchain.asm.state import Assembler
from toolchain.elf import constants as c
from toolchain.elf.model import Bind

Handler = Callable[[Assembler, str], None]
_NAME = re.compile(r"[A-Za-z_.$][\w.$]*")


def _name_and_rest(text: str, directive: str) -> tuple[str, str]:
    name, comma, rest = text.partition(",")
    if not comma or not _NAME.fullmatch(name.strip()):
        raise ExprError(f"{directive} expects a symbol, a comma and a value")
    return name.strip(), rest


# -- sections ----------------------------------------------------------------------------------------------------


def _enter(asm: Assembler, section: AsmSection) -> None:
    asm.section.align_word()
    asm.previous, asm.section = asm.section, section
    asm.after_repeat = ""


def _section(asm: Assembler, text: str) -> None:
    name, comma, rest = text.partition(",")
    name = name.strip()
    if len(name) >= 2 and name[0] == name[-1] == '"':
        name = name[1:-1]
    if not name or re.search(r"[\s\"'()\[\]]", name):
        raise ExprError(f"bad section name {name!r}")
    if name == "*":  # a private section with a generated name, unique within the object (§1.4)
        name = f"*_{len(asm.sections):08x}"
    existing = asm.sections.get(name)
    if existing is None:
        existing = asm.sections[name] = AsmSection(name, 0, c.SHT_NOTE, asm.source.place)
        _configure(existing, rest if comma else attributes.implied(name))
    elif comma and existing.is_untouched():
        _configure(existing, rest)
    elif comma:
        wanted = attributes.parse(rest, name)
        same = wanted.flags | existing.flags & attributes.OMITTED == existing.flags and wanted.type == existing.type
        if not same or wanted.address not in (None, existing.load):
            raise ExprError(f"section {name} already exists with other attributes (first used at {existing.place})")
        existing.keep |= wanted.keep
    _enter(asm, existing)


def _configure(section: AsmSection, text: str) -> None:
    try:
        wanted = attributes.parse(text, section.name)
    except ExprError as error:
        raise ExprError(f"section {section.name}: {error}") from error
    section.configure(wanted.flags, wanted.type)
    section.extended, section.load, section.keep = wanted.extended, wanted.address, wanted.keep
    if wanted.align is not None:
        section.align = max(section.align, wanted.align)


def _fixed_section(name: str) -> Handler:
    def enter(asm: Assembler, text: str) -> None:
        if text:
            raise ExprError(f"{name} takes no operands")
        _enter(asm, asm.sections[name])

    return enter


def _push_section(asm: Assembler, text: str) -> None:
    state = (asm.section, asm.previous)
    _section(asm, text)
    asm.section_stack.append(state)


def _pop_section(asm: Assembler, text: str) -> None:
    if not asm.section_stack:
        raise ExprError(".popsection without .pushsection")
    asm.section, asm.previous = asm.section_stack.pop()


def _previous(asm: Assembler, text: str) -> None:
    _enter(asm, asm.previous)


# -- symbols -----------------------------------------------------------------------------------------------------


def _binder(bind: Bind) -> Handler:
    def set_bind(asm: Assembler, text: str) -> None:
        for name in symbol_names(text):
            symbol = asm.symbol(name)
            if bind is Bind.LOCAL and symbol.bind not in (None, Bind.LOCAL):
                raise ExprError(f"symbol {name} is already global")
            if bind is Bind.WEAK or symbol.bind is not Bind.WEAK:
                symbol.bind = bind

    return set_bind


def _declare(asm: Assembler, text: str) -> None:
    """Record `.extern` for `.ifdecl`; it has no other effect, because every undefined symbol is external."""
    asm.declared.update(symbol_names(text))


def _visibility(value: int) -> Handler:
    def set_visibility(asm: Assembler, text: str) -> None:
        for name in symbol_names(text):
            asm.symbol(name).visibility = value

    return set_visibility


def set_symbol(asm: Assembler, name: str, value: str, once: bool = False) -> None:
    """Assign the value of an expression to a symbol (.set, =); an assignment to `.` moves the location counter."""
    if name in (".", "$"):
        move_location(asm, value)
    else:
        asm.assign(name, value, once)


def _equate(once: bool) -> Handler:
    def assign(asm: Assembler, text: str) -> None:
        name, value = _name_and_rest(text, ".equiv" if once else ".equ")
        set_symbol(asm, name, value, once)

    return assign


def _common(asm: Assembler, text: str) -> None:
    name, size, align = _sized(asm, text, ".comm")
    symbol = asm.symbol(name)
    if symbol.place is not None:
        raise ExprError(f"symbol {name} is already defined")
    symbol.common, symbol.bind, symbol.type = (size, align), symbol.bind or Bind.GLOBAL, c.STT_OBJECT


def _local_common(asm: Assembler, text: str) -> None:
    name, size, align = _sized(asm, text, ".lcomm")
    current = asm.section
    asm.section = asm.sections[".bss"]
    try:
        asm.section.align_to(align, 0)
        asm.define_label(name)
        asm.section.skip(size, 0)
    finally:
        asm.section = current


def _bss(asm: Assembler, text: str) -> None:
    """Switch to section .bss; with operands, reserve bytes in it as .lcomm does."""
    if text:
        _local_common(asm, text)
    else:
        _enter(asm, asm.sections[".bss"])


def _sized(asm: Assembler, text: str, directive: str) -> tuple[str, int, int]:
    name, rest = _name_and_rest(text, directive)
    numbers = [asm.constant(part) for part in rest.split(",")]
    size, align = numbers[0], numbers[1] if len(numbers) > 1 else 2
    if not 0 <= size <= 0x10000:
        raise ExprError(f"{directive} size {size} is outside the data space")
    if align < 1 or align & (align - 1):
        raise ExprError(f"alignment {align} is not a power of two")
    return name, size, align


_SYMBOL_TYPES = {"function": c.STT_FUNC, "object": c.STT_OBJECT, "notype": c.STT_NOTYPE}


def _type(asm: Assembler, text: str) -> None:
    name, kind = _name_and_rest(text, ".type")
    key = kind.strip().lstrip("@%").strip('"').lower().removeprefix("stt_").replace("func", "function", 1)
    key = "function" if key.startswith("function") else key
    if key not in _SYMBOL_TYPES:
        raise ExprError(f"unknown symbol type {kind.strip()!r}: expected @function or @object")
    asm.symbol(name).type = _SYMBOL_TYPES[key]


def _size(asm: Assembler, text: str) -> None:
    name, value = _name_and_rest(text, ".size")
    asm.symbol(name).size = asm.evaluate(value)


# -- control and messages ----------------------------------------------------------------------------------------


def _end(asm: Assembler, text: str) -> None:
    asm.ended = True


def _error(asm: Assembler, text: str) -> None:
    raise ExprError(string_argument(text, ".error") if text.strip() else ".err encountered")


def _abort(asm: Assembler, text: str) -> None:
    asm.error(".abort: assembly ends here")
    asm.ended = True


def _print(asm: Assembler, text: str) -> None:
    asm.messages.append(string_argument(text, ".print"))


def _ignore(asm: Assembler, text: str) -> None:
    """Do nothing: listing and note directives have no effect on the object."""


def _file(asm: Assembler, text: str) -> None:
    numbered = re.match(r"\s*\d+\s+", text)
    name = string_argument(text[numbered.end() :] if numbered else text, ".file")
    if not numbered:
        asm.file_name = name


def _line(asm: Assembler, text: str) -> None:
    number = asm.constant(text, ".line")
    frame = asm.source.frames[-1]
    if number < 0:
        raise ExprError(f"line number {number} is negative")
    if not frame.fixed:
        frame.line = number - 1
        asm.source.place = replace(asm.source.place, line=number)


def _fill_setter(attribute: str) -> Handler:
    def set_fill(asm: Assembler, text: str) -> None:
        value = _byte(asm, text, 0)
        if asm.section.is_code:
            setattr(asm.section, attribute, value)
        else:
            asm.warn(f"fill values apply to code sections only: in section {asm.section.name} this line has no effect")

    return set_fill


def _byte(asm: Assembler, text: str, default: int) -> int:
    value = asm.constant(text) if text.strip() else default
    if not -128 <= value <= 255:
        raise ExprError(f"fill value {value} does not fit a byte")
    return value & 0xFF


def _unsupported(reason: str) -> Handler:
    def refuse(asm: Assembler, text: str) -> None:
        raise ExprError(reason)

    return refuse


DIRECTIVES: dict[str, Handler] = {
    ".text": _fixed_section(".text"),
    ".data": _fixed_section(".data"),
    ".bss": _bss,
    ".section": _section,
    ".sect": _section,
    ".pushsection": _push_section,
    ".popsection": _pop_section,
    ".previous": _previous,
    ".attribute": _unsupported(".attribute is not supported: write the attributes on .section"),
    ".memory": _unsupported(".memory is not supported: the 30F6014A has no user-defined memory regions"),
    ".global": _binder(Bind.GLOBAL),
    ".globl": _binder(Bind.GLOBAL),
    ".weak": _binder(Bind.WEAK),
    ".local": _binder(Bind.LOCAL),
    ".extern": _declare,
    ".hidden": _visibility(c.STV_HIDDEN),
    ".internal": _visibility(c.STV_INTERNAL),
    ".protected": _visibility(c.STV_PROTECTED),
    ".equ": _equate(once=False),
    ".set": _equate(once=False),
    ".equiv": _equate(once=True),
    ".comm": _common,
    ".lcomm": _local_common,
    ".type": _type,
    ".size": _size,
    ".end": _end,
    ".abort": _abort,
    ".err": _error,
    ".error": _error,
    ".print": _print,
    ".file": _file,
    ".line": _line,
    ".fillupper": _fill_setter("fill_upper"),
    ".fillvalue": _fill_setter("fill_value"),
    ".pfillvalue": _fill_setter("packed_fill_value"),
    **dict.fromkeys((".list", ".nolist", ".eject", ".psize", ".title", ".sbttl", ".ident", ".version"), _ignore),
    **BLOCK_DIRECTIVES,
    **DATA_DIRECTIVES,
}

REJECTED: dict[str, str] = {  # pic30-as refuses these directives, too (abi-elf.md §4.3)
    ".zero": "use .space",
    ".balign": "use .align",
    ".balignw": "use .align",
    ".balignl": "use .align",
    ".p2align": "use .align",
    ".p2alignw": "use .align",
    ".p2alignl": "use .align",
    ".ds": "use .space",
    ".ds.b": "use .space",
    ".ds.w": "use .space",
    ".ds.l": "use .space",
    ".dcb": "use .fill",
    ".dcb.b": "use .fill",
    ".dcb.w": "use .fill",
    ".dcb.l": "use .fill",
    ".quad": "use two .long",
    ".octa": "use four .long",
    ".loc": "write .debug_line as data",
    ".ln": "use .line",
    ".warning": "use .print",
}


def rejection(word: str) -> str | None:
    """Return the suggested replacement for a directive that pic30-as refuses, None for other directives."""
    if word.startswith(".cfi_"):
        return "omit it, callers of assembly are found from its instructions"
    return REJECTED.get(word)
