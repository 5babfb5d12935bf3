"""Placement: every live input section gets an address and a load address (abi-elf.md §3.3, "Allocation").

In: sections with their sizes.  Out: a `PlacedSection` for each, without overlaps, by the rules of PSV, near, X, Y,
`address()` and alignment.  If memory is exhausted, a `ToolError` states the number of missing bytes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from emu.image.elf_facts import PSV_PAGE_UNITS, PSV_WINDOW, ExtendedAttribute, SectionFlag
from toolchain.elf.model import Section
from toolchain.elf.symbols import symbol_sizes
from toolchain.errors import ToolError
from toolchain.link.memory import CONFIG_SECTIONS, HANDLE_LIMIT, ChipMemory, Pool
from toolchain.link.resolve import Resolution

_FIRST_CODE = (".init", ".user_init", ".handle", ".isr", ".libc", ".libm", ".libdsp", ".lib")
"""Order of the first sections of the program region (abi-elf.md §3.3)."""


@dataclass(frozen=True, slots=True)
class PlacedSection:
    """Address of a section, in address units; `size` is even."""

    address: int
    load: int
    size: int


@dataclass(slots=True)
class Layout:
    """Addresses by section, and the free intervals of the memories."""

    memory: ChipMemory
    placed: dict[Section, PlacedSection] = field(default_factory=dict)
    data: Pool = field(init=False)
    program: Pool = field(init=False)
    eeprom: Pool = field(init=False)

    def __post_init__(self) -> None:
        memory = self.memory
        self.data = Pool(memory.ram.start, memory.ram.end)
        self.program = Pool(memory.program.start, memory.program.end)
        self.eeprom = Pool(memory.eeprom.start, memory.eeprom.end)


def even(units: int) -> int:
    """Round up to whole words, to which sections are padded (abi-elf.md §3.2)."""
    return (units + 1) // 2 * 2


def space_of(section: Section) -> str:
    """Return "data", "program", "eeprom", "config", or "info" for a section outside all memories."""
    if section.name in CONFIG_SECTIONS:
        return "config"
    if section.flags & SectionFlag.EEDATA:
        return "eeprom"
    if section.flags & (SectionFlag.EXECINSTR | SectionFlag.PSV):
        return "program"
    return "data" if section.is_ram else "info"


class Placer:
    """Places sections space by space; the most constrained sections first."""

    def __init__(self, resolution: Resolution, sections: list[Section], memory: ChipMemory) -> None:
        self.resolution, self.layout, self.memory = resolution, Layout(memory), memory
        self.ram, self.near, self.program, self.eeprom = memory.ram, memory.near, memory.program, memory.eeprom
        self.by_space: dict[str, list[Section]] = {}
        for section in sections:
            self.by_space.setdefault(space_of(section), []).append(section)

    def _record(self, section: Section, address: int, load: int | None = None) -> None:
        self.layout.placed[section] = PlacedSection(address, address if load is None else load, even(section.units))

    def _name(self, section: Section) -> str:
        return f"{self.resolution.owner[section].name}:({section.name})"

    # -- data ----------------------------------------------------------------------------------------------------

    def place_data(self) -> None:
        """Place RAM sections: fixed addresses, X and Y memory, near from the bottom, the rest (abi-elf.md §3.3)."""
        sections = [s for s in self.by_space.get("data", []) if not s.extended & ExtendedAttribute.STACK]
        fixed = [s for s in sections if s.flags & SectionFlag.ABSOLUTE]
        free = [s for s in sections if not s.flags & SectionFlag.ABSOLUTE]
        for section in fixed:
            self._fix(section, self.layout.data, section.load, section.load, "data memory")
        groups = (
            ([s for s in free if s.flags & SectionFlag.YMEM], self.memory.y_ram.start, self.memory.y_ram.end, True),
            ([s for s in free if s.flags & SectionFlag.XMEM], self.memory.x_ram.start, self.memory.x_ram.end, False),
            ([s for s in free if _is_near(s)], self.ram.start, self.near.end, False),
            ([s for s in free if not _is_near(s) and not s.flags & _XY], self.ram.start, self.ram.end, False),
        )
        for members, low, high, from_top in groups:
            for section in sorted(members, key=_data_order):
                top = from_top or section.flags & SectionFlag.REVERSE
                take = self._take_top if top else self._take
                at = take(section, low, high)
                if at is None:
                    rivals = sections if high == self.ram.end else members
                    raise self._overflow(members, self.layout.data, low, high, section, rivals)
                self._record(section, at)

    def _take(self, section: Section, low: int, high: int) -> int | None:
        return self.layout.data.allocate(even(section.units), max(section.align, 2), low, high)

    def _take_top(self, section: Section, low: int, high: int) -> int | None:
        reverse = bool(section.flags & SectionFlag.REVERSE)
        return self.layout.data.allocate_top(even(section.units), max(section.align, 2), low, high, reverse)

    def _fix(self, section: Section, pool: Pool, load: int, address: int, what: str) -> None:
        if load % 2 or not pool.reserve(load, even(section.units)):
            raise self._conflict(section, load, what)
        self._record(section, address, load)

    def _conflict(self, section: Section, load: int, what: str) -> ToolError:
        """The error for a section that cannot have the address that `address(N)` gives it."""
        end = load + even(section.units)
        here = f"{self._name(section)} at {load:#x}..{end - 1:#x}"
        if load % 2:
            return ToolError(f"{here}: the address is odd")
        for other, at in self.layout.placed.items():
            if space_of(other) == space_of(section) and at.load < end and load < at.load + at.size:
                there = f"{self._name(other)} at {at.load:#x}..{at.load + at.size - 1:#x}"
                return ToolError(f"{here} overlaps {there}: give one of them another address")
        return ToolError(f"{here} leaves {what}")

    # -- program -------------------------------------------------------------------------------------------------

    def place_fixed_program(self) -> None:
        """Place reset, vector tables, code and constants with `address()`, and configuration words."""
        starts = {".reset": self.memory.reset, ".ivt": self.memory.ivt, ".aivt": self.memory.aivt}
        for section in self.by_space.get("program", []):
            if section.name in starts:
                region = starts[section.name]
                if section.units > region.size:
                    raise ToolError(f"{self._name(section)} is {section.units - region.size} address units too long")
                self._record(section, region.start)
            elif section.flags & SectionFlag.ABSOLUTE:
                address = psv_address(section.load) if section.is_psv else section.load
                if section.is_psv and address + section.units > PSV_WINDOW + PSV_PAGE_UNITS:
                    raise ToolError(f"{self._name(section)} at {section.load:#x} crosses a PSV window of 32 KB")
                self._fix(section, self.layout.program, section.load, address, "program memory")
        for section in self.by_space.get("config", []):
            self._config(section)

    def _config(self, section: Section) -> None:
        address = self.memory.config_sections.get(section.name)
        if address is None:
            raise ToolError(f"{self._name(section)}: error: the {self.memory.chip.name} has no such configuration word")
        if section.units > 2:
            raise ToolError(f"{self._name(section)} holds {section.units // 2} words, a configuration register is one")
        for other, placed in self.layout.placed.items():
            if placed.address == address and space_of(other) == "config" and section.units:
                raise ToolError(f"{self._name(section)}: error: already set by {self._name(other)}")
        if section.units:
            self._record(section, address)

    def place_program(self) -> None:
        """Place start-up and library code, .const in one PSV window, other PSV sections, and the remaining code."""
        free = [s for s in self.by_space.get("program", []) if s not in self.layout.placed]
        code = [s for s in free if not s.is_psv]
        const = [s for s in free if s.is_psv and is_const(s)]
        first = sorted((s for s in code if _first_rank(s) < len(_FIRST_CODE)), key=_first_rank)
        for section in first:
            high = HANDLE_LIMIT if section.name == ".handle" else self.program.end
            self._program(section, free, high)
        self._const_group(const, free)
        for section in sorted((s for s in free if s.is_psv and not is_const(s)), key=lambda s: -s.units):
            self._program(section, free, self.program.end, PSV_PAGE_UNITS)
        for section in code:
            if section not in self.layout.placed:
                window = HANDLE_LIMIT if section.name == ".dinit" and section.units <= HANDLE_LIMIT else 0
                self._program(section, free, self.program.end, window)

    def _program(self, section: Section, everything: list[Section], high: int, window: int = 0) -> None:
        size, align = even(section.units), max(section.align, 2)
        at = self.layout.program.allocate(size, align, self.program.start, high, window)
        if at is None:
            raise self._overflow(everything, self.layout.program, self.program.start, high, section)
        self._record(section, psv_address(at) if section.is_psv else at, at)

    def _const_group(self, const: list[Section], everything: list[Section]) -> None:
        """Place all of .const in one PSV page, so that one PSVPAG value serves every object (abi-elf.md §1.4)."""
        if not const:
            return
        align = max(2, *(s.align for s in const))
        offsets, size = [], 0
        for section in const:
            size = -(-size // max(section.align, 2)) * max(section.align, 2)
            offsets.append(size)
            size += even(section.units)
        if size > PSV_PAGE_UNITS:
            largest = largest_symbols(self.resolution, const)
            raise ToolError(
                f"constants (.const) are {size - PSV_PAGE_UNITS} bytes too large for one PSV window of 32 KB{largest}; "
                "give large tables the attribute space(prog) and read them by __builtin_tblrdl"
            )
        first, end = self.program.start, self.program.end
        at = self.layout.program.allocate(size, align, first, end, PSV_PAGE_UNITS)
        if at is None:
            raise self._overflow(everything, self.layout.program, first, end, const[0])
        for section, offset in zip(const, offsets, strict=True):
            self._record(section, psv_address(at + offset), at + offset)

    def place_eeprom(self) -> None:
        """Place EEPROM contents; code uses the low half of the address, from 0xF000 on (abi-elf.md §6.4)."""
        members = self.by_space.get("eeprom", [])
        for section in members:
            if section.flags & SectionFlag.ABSOLUTE:
                self._fix(section, self.layout.eeprom, section.load, psv_address(section.load), "data EEPROM")
        for section in members:
            if section not in self.layout.placed:
                first, end = self.eeprom.start, self.eeprom.end
                at = self.layout.eeprom.allocate(even(section.units), max(section.align, 2), first, end)
                if at is None:
                    raise self._overflow(members, self.layout.eeprom, first, end, section)
                self._record(section, psv_address(at), at)

    def place_info(self) -> None:
        """Place debug sections of one name one after another, from offset 0."""
        ends: dict[str, int] = {}
        for section in self.by_space.get("info", []):
            start = ends.get(section.name, 0)
            self.layout.placed[section] = PlacedSection(start, start, section.units)
            ends[section.name] = start + section.units

    # -- errors --------------------------------------------------------------------------------------------------

    def _overflow(
        self,
        group: list[Section],
        pool: Pool,
        low: int,
        high: int,
        failed: Section,
        rivals: list[Section] | None = None,
    ) -> ToolError:
        """Return the error for a group that exceeds its memory; `rivals` are all sections in that memory."""
        waiting = sum(even(s.units) for s in group if s not in self.layout.placed)
        missing = waiting - pool.room(low, high)
        program = space_of(failed) == "program"
        what = f"{low:#x}..{high - 1:#x}"
        if missing <= 0:
            reason = f"no free block of {even(failed.units)} units is left between {what}"
        elif program:
            reason = f"program memory {what} overflows by {missing // 2 * 3} bytes ({missing // 2} instruction words)"
        else:
            data = "near data memory" if high == self.near.end else "data memory"
            kind = "EEPROM" if space_of(failed) == "eeprom" else data
            reason = f"{kind} {what} overflows by {missing} bytes"
        largest = largest_symbols(self.resolution, rivals or group)
        return ToolError(f"{self._name(failed)} does not fit: {reason}{self._reserved(failed, low, high)}{largest}")

    def _reserved(self, failed: Section, low: int, high: int) -> str:
        """Return a list of the sections with fixed addresses in the same memory, for the message."""
        found = []
        for section, at in self.layout.placed.items():
            is_rival = section.flags & SectionFlag.ABSOLUTE and space_of(section) == space_of(failed)
            if is_rival and at.size and low <= at.load < high:
                found.append(f"{section.name} {at.load:#x}..{at.load + at.size - 1:#x}")
        return f"; at fixed addresses: {', '.join(sorted(found))}" if found else ""


_XY = SectionFlag.XMEM | SectionFlag.YMEM


def _is_near(section: Section) -> bool:
    return bool(section.flags & SectionFlag.NEAR) and not section.flags & _XY


def _data_order(section: Section) -> tuple[int, int]:
    """Sort key: large alignments first to avoid gaps; then by kind, for a short .dinit table."""
    kind = 2 if section.flags & (SectionFlag.PERSIST | SectionFlag.NOLOAD) else 0 if section.nobits_units else 1
    return -section.align if section.align > 2 else 0, kind


def _first_rank(section: Section) -> int:
    names = enumerate(_FIRST_CODE)
    return next((i for i, n in names if section.name == n or section.name.startswith(n + ".")), len(_FIRST_CODE))


def memory_bytes(section: Section, units: int) -> int:
    """Return the bytes of memory of `units` address units: three per instruction word in code, else one each."""
    return (units + 1) // 2 * 3 if section.is_code else units


def is_const(section: Section) -> bool:
    """Whether a PSV section belongs to .const, which is in the page of PSVPAG's default value."""
    return section.name == ".const" or section.name.startswith(".const.")


def psv_address(load: int) -> int:
    """Return the data address of a program location in the PSV window (abi-elf.md §6.4)."""
    return PSV_WINDOW | load & (PSV_PAGE_UNITS - 1)


def largest_symbols(resolution: Resolution, group: Iterable[Section]) -> str:
    """Return the five largest symbols of a group of sections, with their bytes, for the message."""
    members = set(group)
    sizes: list[tuple[int, str]] = []
    for obj in resolution.objects:
        for symbol, units in symbol_sizes(obj.symbols):
            if symbol.section in members:
                sizes.append((memory_bytes(symbol.section, units), symbol.name))
    top = sorted(sizes, key=lambda entry: (-entry[0], entry[1]))[:5]
    return "; largest symbols: " + ", ".join(f"{name} ({size})" for size, name in top) if top else ""
