"""The proof problem: the optimised IR of one C file, and the machine code that the back end generates from it.

The file is compiled and linked alone.  Symbols that it only declares have artificial addresses: variables in free RAM,
functions above its code.  Special function registers have their real addresses.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from emu.chips.chip import Chip
from emu.dspic30f.isa import codec
from emu.dspic30f.isa.row import Insn
from emu.image.elf_facts import OCTETS_PER_UNIT
from toolchain.abi.names import symbol
from toolchain.asm.assemble import assemble
from toolchain.asm.state import Options as AssemblerOptions
from toolchain.driver.driver import assembler_options, front_end, optimise
from toolchain.driver.pipeline import ModuleCompiler
from toolchain.elf.model import Home, ObjectFile, Symbol
from toolchain.elf.write import executable_bytes
from toolchain.emit.annotations import annotations_of, interrupt_kind, preserved
from toolchain.errors import ToolError
from toolchain.frontend.options import parse
from toolchain.ir.model import Module, size_of
from toolchain.ir.read import read_module
from toolchain.link.link import link
from toolchain.link.options import LinkOptions
from toolchain.proof.asm_statements import LABEL, Statement, marked, templates
from toolchain.proof.memory import STACK

PRIVATE = re.compile(r"^(@\S+ = )private ", re.MULTILINE)
DATA, DATA_END = 0x1000, STACK - 0x100
"""Address range of variables that are only declared."""
MAX_BYTES = 0x200
"""Distance in bytes between declared variables; a larger variable overlaps the next one."""
CODE, CODE_STEP = 0x6000, 0x10
"""First address of functions that are only declared, and distance between them, in PC units."""
WORD_UNITS = 2
PAGE = "__const_psvpage"
"""Linker symbol with the value of PSVPAG for constants (abi-elf.md §1.4)."""
ENTRY = "__entry"
"""Target of the reset vector; it has no code."""


@dataclass
class CompiledFile:
    """A compiled and linked C file with its IR."""

    module: Module
    symbols: dict[str, int]
    """Addresses by assembler name, of code in PC units."""
    ends: dict[str, int]
    """End address of each function's code, by assembler name."""
    code: dict[int, int]
    """24-bit words by address in PC units."""
    frame_offsets: dict[str, dict[str, int]]
    """By function, frame offsets of its variables (`ModuleCompiler.frame_offsets`)."""
    handlers: dict[str, str]
    """Interrupt functions and their kind (`interrupt_kind`)."""
    handlers_saving_variables: set[str]
    """Interrupt functions that also save variables."""
    statements: dict[int, list[Statement]]
    """Code sequences that match assembly statements, by start address."""
    object_file: ObjectFile
    options: LinkOptions

    @cached_property
    def functions(self) -> dict[int, str]:
        """Functions by address."""
        return {address: name for name, address in self.symbols.items() if name not in self._data}

    @property
    def _data(self) -> set[str]:
        return {symbol(self.module, name) for name in self.module.globals}

    def address(self, name: str) -> int:
        """Return the address of a variable or function of the IR; raises KeyError."""
        return self.symbols[symbol(self.module, name)]

    def image_with_start(self, text: str) -> bytes:
        """Return the file as an ELF image with start-up assembly that defines ENTRY; raises ToolError."""
        start, _ = assemble(text, "<start>", AssemblerOptions(chip=self.options.chip))
        return executable_bytes(link([self.object_file, start], [], self.options).image)

    def insn(self, pc: int) -> Insn | None:
        """Return the instruction at an address, None without one."""
        first = self.code.get(pc)
        return None if first is None else codec.decode(first, self.code.get(pc + WORD_UNITS, 0))


def compile_file(arguments: list[str], edit: Callable[[str], str] = str) -> CompiledFile:
    """Compile one file with the driver's options. Raises ToolError, ClangError.

    `edit` maps the compiler's assembly text to the text that is assembled.
    """
    options = parse(["-c", "-fno-lto", *arguments])
    if len(options.inputs) != 1 or options.inputs[0].language not in ("c", "c++", "cpp-output", "ir"):
        raise ToolError("expected one C, C++ or IR file")
    with tempfile.TemporaryDirectory(prefix="dspic-proof-") as scratch:
        modules = front_end(options, Path(scratch))
        ir = optimise(options, modules[options.inputs[0]], Path(scratch))
    ir = PRIVATE.sub(r"\1internal ", ir)  # private symbols would be local labels without an address in the image
    compiler = ModuleCompiler(read_module(ir), options)
    text = edit(compiler.run())
    module = read_module(ir)
    text, stretches = marked(text, templates(module))
    made, _ = assemble(text, options.inputs[0].path.name, assembler_options(options, compiled=True))
    found = link_alone(module, made, compiler.frame_offsets, options.chip)
    places = {name: found.symbols.pop(name) for name in [*found.symbols] if name.startswith(LABEL)}
    for start, template, texts, end in stretches:
        found.statements.setdefault(places[start], []).append(Statement(template, places[end], texts))
    return found


def link_alone(module: Module, made: ObjectFile, frame_offsets: dict[str, dict[str, int]], chip: Chip) -> CompiledFile:
    """Link an object alone, with artificial addresses for declared symbols; `statements` is empty."""
    options = LinkOptions(entry=ENTRY, data_init=False, isr=False, chip=chip)
    artificial = _artificial_addresses(module, made.symbols, options)
    options.define.update(artificial)
    image = link([made], [], replace(options, define=options.define | {ENTRY: CODE - CODE_STEP})).image
    symbols = {s.name: s.value for s in image.symbols if s.name and s.name not in artificial} | artificial
    symbols |= {f"_{name}": register.address for name, register in options.chip.sfrs.items()}
    ends = {s.name: s.value + s.size for s in image.symbols if s.size}
    code: dict[int, int] = {}
    for section in image.sections:
        if section.is_code:
            step = OCTETS_PER_UNIT * WORD_UNITS
            for at in range(0, len(section.data) - step + 1, step):
                word = int.from_bytes(section.data[at : at + step], "little")
                code[section.address + at // OCTETS_PER_UNIT] = word & 0xFFFFFF
    annotations = annotations_of(module)
    saving = {name for name, found in annotations.items() if preserved(found)}
    kinds = {name: interrupt_kind(annotations.get(name, set()), name) for name in module.functions}
    handlers = {name: kind.partition(",")[0] for name, kind in kinds.items() if kind}
    return CompiledFile(module, symbols, ends, code, frame_offsets, handlers, saving, {}, made, options)


def _artificial_addresses(module: Module, symbols: list[Symbol], options: LinkOptions) -> dict[str, int]:
    sizes = {symbol(module, name): size_of(v.type) for name, v in module.globals.items()}
    declared = [symbol(module, name) for name, v in module.globals.items() if v.init is None]
    declared += [symbol(module, name) for name, f in module.functions.items() if not f.blocks]
    undefined = [one.name for one in symbols if one.home is Home.UNDEFINED and one.name]
    registers = {f"_{name}" for name in options.chip.sfrs}
    data, code, found = DATA, CODE, {}
    for name in dict.fromkeys([*undefined, *declared]):
        if name in registers or name == PAGE:
            continue
        if name in sizes:
            found[name] = data
            data += (min(sizes[name], MAX_BYTES) + 3) // 2 * 2
        else:
            found[name] = code
            code += CODE_STEP
    if data > DATA_END:
        raise ToolError("the declared variables do not fit beside the stack of the proof")
    return found
