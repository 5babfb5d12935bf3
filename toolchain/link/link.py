"""The linker: links objects and libraries to an image.  `_link` lists the steps in order."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from itertools import pairwise

from emu.chips.chip import Chip
from emu.image.elf_facts import (
    GENERIC_PROCESSORS,
    OCTETS_PER_UNIT,
    PROCESSOR_MASK,
    PSV_PAGE_UNITS,
    ExtendedAttribute,
    SectionFlag,
)
from toolchain.elf import constants as c
from toolchain.elf.archive import Archive
from toolchain.elf.model import Bind, Executable, Home, ObjectFile, Section, Symbol
from toolchain.errors import ToolError
from toolchain.link import dinit, part, synthesize
from toolchain.link.gc import SECTION_LIMIT, live_sections, vector_names
from toolchain.link.image import Output, build_executable, build_outputs
from toolchain.link.memory import HANDLE_LIMIT, ChipMemory
from toolchain.link.options import LinkOptions
from toolchain.link.place import Layout, Placer, even, is_const, largest_symbols, space_of
from toolchain.link.relocate import Relocator
from toolchain.link.resolve import Resolution, check, place_of, resolve

LINKER_OBJECT = "<linker>"


@dataclass(slots=True)
class Linked:
    """Result of a link: the image, and the data for map file and reports."""

    image: Executable
    resolution: Resolution
    layout: Layout
    outputs: list[Output]
    records: list[dinit.DinitRecord]
    live: set[Section]
    stack: tuple[int, int]  # first address of the stack, and stack limit (SPLIM)
    messages: list[str]


def link(objects: list[ObjectFile], archives: list[Archive], options: LinkOptions) -> Linked:
    """Link `objects` with the members of `archives` that they need.  Raise `ToolError` with all errors.

    GOTO slots for function pointers are reserved only if the address of a function exceeds 16 bits.
    """
    linked = _link(objects, archives, options, False) or _link(objects, archives, options, True)
    assert linked is not None, "with slots every function is within reach"
    return linked


def _link(objects: list[ObjectFile], archives: list[Archive], options: LinkOptions, with_slots: bool) -> Linked | None:
    """Link once; return None if function pointers need GOTO slots and `with_slots` did not reserve them."""
    inputs = _gather_inputs(objects, archives, options)
    handles = _handles(inputs, options, with_slots)
    memory = ChipMemory(options.chip, options.part)
    absolute = memory.script_symbols() | options.define | dict.fromkeys(_LINKER_SYMBOLS, 0)
    _check_inputs(inputs, set(absolute), options)
    placement = _place_sections(inputs, memory, options)
    if not with_slots and any(_beyond_pointers(placement.layout, target) for target in handles.slots):
        return None
    stack = (0, 0) if options.part is not None else _stack(inputs.resolution, placement, options)
    absolute |= _linker_symbols(inputs.resolution, placement, stack, options)
    absolute |= _section_limits(inputs.resolution, placement.layout)
    relocator = Relocator(inputs.resolution, placement.layout, absolute, handles.slots, handles.section)
    outputs = build_outputs(
        placement.layout, _relocate(relocator, placement, options), options.fill_upper, options.debug_phantoms
    )
    entry = relocator.target(synthesize.undefined_symbol(options.entry)).address
    image = build_executable(inputs.resolution, outputs, relocator, entry, options.chip.processors[0])
    messages = _foreign_processors(objects, options.chip) + _missing_heap(inputs)
    return Linked(image, inputs.resolution, placement.layout, outputs, placement.records, inputs.live, stack, messages)


@dataclass(slots=True)
class _Inputs:
    """The input sections of a link: resolved symbols, the object that the linker generates, and the live sections."""

    resolution: Resolution
    generated: ObjectFile
    live: set[Section]

    def adopt(self) -> None:
        """Add the sections and symbols of the object that the linker generates to the resolution."""
        for section in self.generated.sections:
            self.resolution.owner[section] = self.generated
        for symbol in self.generated.symbols:
            self.resolution.globals.setdefault(symbol.name, symbol)
            self.resolution.defined_in.setdefault(symbol.name, self.generated)


@dataclass(slots=True)
class _Handles:
    """The `.handle` section, and the offset of each function's GOTO slot in it."""

    section: Section
    slots: dict[Symbol, int]


@dataclass(slots=True)
class _Placement:
    """Result of placement: all sections in input order, the `.dinit` section (or None) and its records."""

    layout: Layout
    order: list[Section]
    table: Section | None
    records: list[dinit.DinitRecord]


def _gather_inputs(objects: list[ObjectFile], archives: list[Archive], options: LinkOptions) -> _Inputs:
    """Resolve symbols, select the live sections, and generate the sections that the program does not define."""
    roots = [options.entry, *options.undefined]
    resolution = resolve(objects, archives, roots)
    if options.part is not None:
        part.adapt(resolution)
    inputs = _Inputs(resolution, ObjectFile(LINKER_OBJECT), set())
    resolution.objects.append(inputs.generated)
    if options.isr and options.part is None and "__DefaultInterrupt" not in resolution.globals:
        synthesize.default_interrupt(inputs.generated)
    inputs.adopt()
    inputs.live = live_sections(resolution, roots + sorted(vector_names()), options.gc_sections)
    _common_sections(resolution, inputs.generated)
    if options.part is None:
        _fixed_sections(resolution, inputs.generated, inputs.live, options)
    return inputs


def _handles(inputs: _Inputs, options: LinkOptions, with_slots: bool) -> _Handles:
    """Generate `.handle`; without slots it is an info section that lists the functions whose address is taken."""
    section, slots = synthesize.handle_section(inputs.resolution, inputs.live | set(inputs.generated.sections))
    if not with_slots:
        section.type, section.flags = c.SHT_NOTE, SectionFlag(0)
    if options.handles:
        inputs.generated.sections.append(section)
    inputs.adopt()
    inputs.live |= set(inputs.generated.sections)
    return _Handles(section, slots if options.handles else {})


def _check_inputs(inputs: _Inputs, absolute: set[str], options: LinkOptions) -> None:
    """Raise `ToolError` for undefined and duplicate symbols, and for handlers without a vector."""
    limits = {name for name in inputs.resolution.wanted if SECTION_LIMIT.fullmatch(name)}
    check(inputs.resolution, absolute | limits, inputs.live)
    if options.part is None:
        _check_handlers(inputs.resolution, inputs.live)
    else:
        part.check(inputs.resolution, inputs.live)


def _place_sections(inputs: _Inputs, memory: ChipMemory, options: LinkOptions) -> _Placement:
    """Assign an address to every live section; data first, because the `.dinit` table depends on its placement."""
    sections = [section for obj in inputs.resolution.objects for section in obj.sections]
    order = [s for s in sections if s in inputs.live and s.name != c.SIGNATURE_SECTION]
    placer = Placer(inputs.resolution, order, memory)
    placer.place_data()
    records: list[dinit.DinitRecord] = []
    table: Section | None = None
    if options.data_init:
        records = dinit.plan(placer.layout, options.pack_data)
        table = dinit.empty_section(records)
        inputs.generated.sections.append(table)
        inputs.resolution.owner[table] = inputs.generated
        placer.by_space.setdefault("program", []).append(table)
    placer.place_fixed_program()
    placer.place_program()
    placer.place_eeprom()
    placer.place_info()
    return _Placement(placer.layout, order, table, records)


def _relocate(relocator: Relocator, placement: _Placement, options: LinkOptions) -> dict[Section, bytearray]:
    """Return the relocated contents of all sections, including the `.dinit` table; raises `ToolError`."""
    contents = {section: relocator.apply(section) for section in placement.layout.placed}
    relocator.check()
    if placement.table is not None:
        dinit.fill(placement.table, placement.records, contents, options.fill_upper)
        contents[placement.table] = placement.table.data
    return contents


def _beyond_pointers(layout: Layout, target: Symbol) -> bool:
    """Whether the address of a function exceeds a 16-bit pointer (abi-elf.md §1.5)."""
    if target.section is None or target.section not in layout.placed:
        return target.home is Home.ABSOLUTE and target.value >= HANDLE_LIMIT
    return layout.placed[target.section].load + target.value >= HANDLE_LIMIT


def _common_sections(resolution: Resolution, own: ObjectFile) -> None:
    """Create a zeroed section for every COMMON symbol; it is near if it fits, as small-data code assumes (§1.4)."""
    for name, symbol in resolution.globals.items():
        if symbol.home is not Home.COMMON:
            continue
        flags = SectionFlag.ALLOC | SectionFlag.WRITE | SectionFlag.NEAR
        section = Section("COMMON", flags, c.SHT_NOBITS, nobits_units=symbol.size, align=max(symbol.value, 2))
        own.sections.append(section)
        placed = Symbol(name, Home.SECTION, section, 0, symbol.size, symbol.bind, c.STT_OBJECT)
        resolution.globals[name] = placed
        own.symbols.append(placed)


def _fixed_sections(resolution: Resolution, own: ObjectFile, live: set[Section], options: LinkOptions) -> None:
    """Generate reset, vector tables, heap and the RETURN of .user_init, unless the program defines them."""
    present = {s.name for s in live if s.units}
    if ".reset" not in present:
        own.sections.append(synthesize.reset_section(options.entry))
    for table in synthesize.vector_tables(resolution, options.isr):
        if table.name not in present:
            own.sections.append(table)
    if options.heap:
        flags = SectionFlag.ALLOC | SectionFlag.WRITE
        heap = Section(".heap", flags, c.SHT_NOBITS, nobits_units=even(options.heap), extended=ExtendedAttribute.HEAP)
        own.sections.append(heap)
    if ".user_init" in present:
        own.sections.append(synthesize.user_init_return())


_LINKER_SYMBOLS = (
    "__SP_init", "__SPLIM_init", "__MIN_STACK_SIZE", "__STACKGUARD_SIZE", "__heap", "__eheap", "__const_psvpage",
    "__const_length", "__dinit_tblpage", "__dinit_tbloffset", "__user_init", "__has_user_init",
    "__bootconst_psvpage", "__secureconst_psvpage", "__enable_fixed",
)  # fmt: skip
"""Absolute symbols that the linker defines (abi-elf.md §3.3); `__enable_fixed` is 0: no fixed-point types (§3.1)."""


def _linker_symbols(
    resolution: Resolution, placement: _Placement, stack: tuple[int, int], options: LinkOptions
) -> dict[str, int]:
    """Return the values of `_LINKER_SYMBOLS`, without those that the program defines itself."""
    layout, table = placement.layout, placement.table
    values = dict.fromkeys(_LINKER_SYMBOLS, 0)
    values["__SP_init"], values["__SPLIM_init"] = stack
    values["__MIN_STACK_SIZE"], values["__STACKGUARD_SIZE"] = options.stack, options.stack_guard
    heaps = [p for s, p in layout.placed.items() if s.extended & ExtendedAttribute.HEAP]
    if heaps:
        values["__heap"] = min(p.address for p in heaps)
        values["__eheap"] = max(p.address + p.size for p in heaps)
    const = [p for s, p in layout.placed.items() if s.is_psv and is_const(s) and p.size]
    if const:
        start = min(p.load for p in const)
        values["__const_psvpage"] = start // PSV_PAGE_UNITS
        values["__const_length"] = max(p.load + p.size for p in const) - start
    if table is not None:
        load = layout.placed[table].load
        values["__dinit_tblpage"], values["__dinit_tbloffset"] = load >> 16, load & 0xFFFF
    calls = sorted((p.load, p.size) for s, p in layout.placed.items() if s.name == ".user_init" and p.size)
    if calls:
        gaps = [a for (a, size), (b, _) in pairwise(calls) if a + size != b]
        if gaps:
            raise ToolError(f".user_init is split at {gaps[0]:#x} by a section with a fixed address")
        values["__user_init"], values["__has_user_init"] = calls[0][0], 1
    return {name: value for name, value in values.items() if name not in resolution.globals}


def _section_limits(resolution: Resolution, layout: Layout) -> dict[str, int]:
    """Values of `.startof.(x)`, `.sizeof.(x)`, `.endof.(x)` in address units (abi-elf.md §4.2)."""
    result: dict[str, int] = {}
    for name in resolution.wanted:
        match = SECTION_LIMIT.fullmatch(name)
        if match is None:
            continue
        parts = [p for s, p in layout.placed.items() if s.name == match[2] or s.name.startswith(match[2] + ".")]
        start = min((p.address for p in parts), default=0)
        end = max((p.address + p.size for p in parts), default=0)
        result[name] = {"startof": start, "endof": end, "sizeof": end - start}[match[1]]
    return result


def _stack(resolution: Resolution, placement: _Placement, options: LinkOptions) -> tuple[int, int]:
    """Return (first address, limit) of the stack: the program's section, else the largest gap (abi-elf.md §3.3)."""
    layout, order = placement.layout, placement.order
    given = [s for s in order if s.extended & ExtendedAttribute.STACK and s.units]
    if given:
        size = even(sum(s.units for s in given))
        at = layout.data.allocate(size, max(2, *(s.align for s in given)), layout.data.start, layout.data.end)
        if at is None:
            raise ToolError(f"the stack section of {size} bytes does not fit into data memory")
        return at, at + size - options.stack_guard
    low, high = layout.data.largest()
    low = even(low)
    if high - low < options.stack + options.stack_guard:
        needed = options.stack + options.stack_guard
        largest = largest_symbols(resolution, (s for s in order if s.is_ram))
        raise ToolError(
            f"no room for the stack: {high - low} bytes of data memory are free, {needed} needed (--stack){largest}"
        )
    return low, high - options.stack_guard


_HANDLER = re.compile(r"__(?:Alt)?[A-Z]\w*(?:Interrupt|Fail|Error)")


def _check_handlers(resolution: Resolution, live: set[Section]) -> None:
    """Raise `ToolError` for a function that is named like an interrupt handler but belongs to no vector of the chip."""
    vectors = vector_names()
    called = {r.symbol.name for s in resolution.owner if s in live for r in s.relocs}
    findings: list[str] = []
    for name, symbol in resolution.globals.items():
        if not _HANDLER.fullmatch(name) or name in vectors or name in called or symbol.bind is Bind.LOCAL:
            continue
        if symbol.section is None or not symbol.section.is_code:
            continue
        near = difflib.get_close_matches(name, vectors, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        owner = resolution.defined_in[name].name
        findings.append(f"{owner}: error: {name} looks like an interrupt handler but the chip has no such vector{hint}")
    if findings:
        raise ToolError.of(findings)


def _foreign_processors(objects: list[ObjectFile], chip: Chip) -> list[str]:
    """Return a warning for each object assembled for another chip: register addresses may differ (abi-elf.md §6.1)."""
    fitting = (*chip.processors, *GENERIC_PROCESSORS)
    part = chip.name.removeprefix("dsPIC")
    return [
        f"{obj.name}: warning: assembled for processor id {obj.processor & PROCESSOR_MASK:#x}, not the {part}"
        for obj in objects
        if obj.processor & PROCESSOR_MASK not in fitting
    ]


def _missing_heap(inputs: _Inputs) -> list[str]:
    """Return a warning if `malloc` of the run-time library is linked and there is no heap, so that it always fails."""
    resolution = inputs.resolution
    malloc = resolution.globals.get("_malloc")
    if malloc is None or malloc.section not in inputs.live or "__eheap" in resolution.globals:
        return []
    if any(section.extended & ExtendedAttribute.HEAP for section in inputs.live):
        return []
    if not any(reloc.symbol.name == "__eheap" for reloc in malloc.section.relocs):
        return []  # the program's own malloc
    library = resolution.owner[malloc.section]
    functions = {symbol.name for symbol in library.symbols if symbol.bind is not Bind.LOCAL}
    callers = [place_of(resolution.owner[section], section, reloc.offset // 2) for section in resolution.owner
               if section in inputs.live and section.is_code and resolution.owner[section] is not library
               for reloc in section.relocs if reloc.symbol.name in functions]  # fmt: skip
    called = f" (called at {', '.join(callers[:3])})" if callers else ""
    return [f"warning: malloc always fails, because there is no heap{called}: link with -Wl,--heap=BYTES"]


def memory_use(linked: Linked) -> dict[str, int]:
    """Return bytes used: "flash" (three per instruction word), "data", "eeprom", and the bytes free for the "stack"."""
    used = {"flash": 0, "data": 0, "eeprom": 0}
    for section, placed in linked.layout.placed.items():
        space = space_of(section)
        if space == "program":
            used["flash"] += placed.size // OCTETS_PER_UNIT * 3
        elif space in ("data", "eeprom"):
            used[space] += placed.size
    used["stack"] = linked.stack[1] - linked.stack[0]
    return used
