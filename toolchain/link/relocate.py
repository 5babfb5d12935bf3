"""Relocation: fills every field with its value (abi-elf.md §5)."""

from __future__ import annotations

from dataclasses import dataclass

from emu.image.elf_facts import PSV_WINDOW, RELOCATIONS, UNSUPPORTED_RELOCATIONS, Formula, RelocationType
from toolchain.elf import fields
from toolchain.elf.fields import FieldError
from toolchain.elf.model import Bind, Home, Reloc, Section, Symbol
from toolchain.errors import ToolError
from toolchain.link.memory import HANDLE_LIMIT
from toolchain.link.place import Layout, space_of
from toolchain.link.resolve import Resolution

_NEAR_FORMS = frozenset((4, 5))  # relocations FILE_REG_BYTE and FILE_REG, whose target must be near
_LSB, _MSB = 32, 33
_DATA_WORD = frozenset((2, 8))  # relocations of `.word` and MOV #lit16, which a code address does not fit (§4.2)

_LISTS = frozenset((".debug_loc", ".debug_ranges"))


@dataclass(frozen=True, slots=True)
class SymbolTarget:
    """Value of a symbol: address, load address, and its memory space ("" for numbers)."""

    address: int
    load: int
    space: str


class Relocator:
    """Applies relocations and collects all errors of a link."""

    def __init__(
        self,
        resolution: Resolution,
        layout: Layout,
        absolute: dict[str, int],
        slots: dict[Symbol, int],
        handle: Section,
    ) -> None:
        self.resolution, self.layout, self.absolute = resolution, layout, absolute
        self.slots, self.handle = slots, handle
        self.findings: list[str] = []
        self._targets: dict[Symbol, SymbolTarget] = {}

    def target(self, symbol: Symbol) -> SymbolTarget:
        """Return the value of the definition of a symbol."""
        known = self._targets.get(symbol)
        if known is None:
            known = self._targets[symbol] = self._find(self.resolution.lookup(symbol))
        return known

    def _find(self, symbol: Symbol) -> SymbolTarget:
        if symbol.home is Home.SECTION and symbol.section is not None:
            placed = self.layout.placed.get(symbol.section)
            if placed is None:
                return SymbolTarget(0, 0, "")  # the section is discarded; only debug information refers to it
            space = space_of(symbol.section)
            return SymbolTarget(placed.address + symbol.value, placed.load + symbol.value, space)
        if symbol.home is Home.UNDEFINED:
            value = self.absolute.get(symbol.name, 0)  # undefined weak symbols are 0 (§5)
            return SymbolTarget(value, value, "")
        value = symbol.value - (1 << 32) if symbol.value >= 1 << 31 else symbol.value  # st_value of a negative number
        return SymbolTarget(value, value, "")

    def apply(self, section: Section) -> bytearray:
        """Return a copy of the section's octets with all fields filled."""
        data = bytearray(section.data)
        placed = self.layout.placed[section]
        call_addend: tuple[int, Symbol, int] | None = None
        for reloc in section.relocs:
            kind = RELOCATIONS.get(reloc.type)
            try:
                if kind is None:
                    raise FieldError(_unknown(reloc.type))
                field = fields.load(data, reloc.offset, kind, section.is_code)
                if reloc.type == _LSB:
                    call_addend = (reloc.offset + 4, reloc.symbol, _signed(field, 16))
                elif reloc.type == _MSB:
                    belongs = call_addend is not None and call_addend[:2] == (reloc.offset, reloc.symbol)
                    field = call_addend[2] if belongs and call_addend is not None else 0
                value = self._value(section, reloc, kind, field, placed.address + reloc.offset // 2)
                fields.store(data, reloc.offset, kind, section.is_code, value)
            except FieldError as error:
                self._complain(section, reloc, kind, str(error))
        return data

    def _value(self, section: Section, reloc: Reloc, kind: RelocationType, field: int, place: int) -> int:
        """Return the raw field content for one relocation."""
        target = self.target(reloc.symbol)
        formula = kind.formula
        if section.name in _LISTS and self._is_discarded(reloc.symbol):
            return 1  # not 0: in debug information a pair of zeros ends a list
        if formula is Formula.ADDRESS:
            if (
                target.space == "program"
                and kind.number in _DATA_WORD
                and section.flags
                and self._is_code(reloc.symbol)
            ):
                raise FieldError("cannot reference executable symbol as data: use handle() or tbloffset()")
            return self._address(kind, target, field)
        if formula in (Formula.BRANCH, Formula.DO_END):
            distance = target.address + _signed(field, 16) - (place + 2)
            if distance & 1:
                raise FieldError(f"target {target.address + _signed(field, 16):#x} is odd")
            if formula is Formula.DO_END and distance >> 1 in (-2, -1, 0):
                raise FieldError("DO loop shorter than two instructions")
            if formula is Formula.BRANCH and not kind.low <= distance >> 1 <= kind.high:
                raise FieldError(
                    f"the target is {abs(distance) // 2} words away, a branch or RCALL reaches {kind.high}: "
                    "compile with -mlarge-code, or use CALL and GOTO"
                )
            return fields.checked(kind, distance >> 1)
        if formula is Formula.HALF:
            if target.address & 1:
                raise FieldError(f"word access to the odd address {target.address:#x}")
            signed = target.address + 2 * _signed(field, kind.width)
            return fields.checked(kind, signed if signed >= 0 else target.address + 2 * field) >> 1
        if formula is Formula.LOW16:
            address = target.address + _signed(field, 16)
            if address & 1:
                raise FieldError(f"target {address:#x} is odd")
            return address & 0xFFFF
        if formula is Formula.HIGH7:
            return fields.checked(kind, target.address + field >> 16)
        return self._program_value(reloc.symbol, kind, target, target.load + _signed(field, kind.width))

    def _is_code(self, symbol: Symbol) -> bool:
        home = self.resolution.lookup(symbol).section
        return home is not None and home.is_code

    def _is_discarded(self, symbol: Symbol) -> bool:
        home = self.resolution.lookup(symbol).section
        return home is not None and home not in self.layout.placed

    def _address(self, kind: RelocationType, target: SymbolTarget, field: int) -> int:
        """Return S+A; the addend is signed, or unsigned if the signed sum is out of range, as in GNU ld."""
        signed = target.address + _signed(field, kind.width)
        value = signed if kind.low <= signed <= kind.high else target.address + field
        if kind.number in _NEAR_FORMS and not kind.low <= value <= kind.high:
            near = self.layout.memory.near.end
            raise FieldError(
                f"cannot access it at {signed:#x} with near addressing: the address must be below {near:#x}"
            )
        return fields.checked(kind, value)

    def _program_value(self, symbol: Symbol, kind: RelocationType, target: SymbolTarget, load: int) -> int:
        """Return the value of an operator of abi-elf.md §4.2 applied to the load address."""
        formula = kind.formula
        if target.space == "data" and formula in _PROGRAM_ONLY:
            raise FieldError(f"{formula.name.lower()}() needs a program address, this symbol is data")
        if formula is Formula.HANDLE:
            return fields.checked(kind, self._handle(symbol, load))
        if formula is Formula.LOAD:
            value = load
        elif formula is Formula.PSVOFFSET:
            value = load & 0xFFFF | PSV_WINDOW
        elif formula in (Formula.TBLOFFSET, Formula.ADDR_LOW):
            value = load & 0xFFFF
        elif formula is Formula.PSVPAGE:
            value = load >> 15
        elif formula in (Formula.TBLPAGE, Formula.ADDR_HIGH):
            value = load >> 16
        elif formula is Formula.EDSPAGE:
            value = 0 if target.space == "data" else load >> 15
        elif formula is Formula.EDSOFFSET:
            value = load & 0xFFFF if target.space == "data" else load & 0xFFFF | PSV_WINDOW
        else:
            return 0
        return fields.checked(kind, value)

    def _handle(self, symbol: Symbol, load: int) -> int:
        """Return the address of a function if it is below 0x10000, else that of its GOTO slot (abi-elf.md §1.5)."""
        target = self.resolution.lookup(symbol)
        if target.home is Home.UNDEFINED and target.bind is Bind.WEAK:
            return 0
        if load < HANDLE_LIMIT:
            return load
        if target not in self.slots:
            raise FieldError("its address does not fit a function pointer, and --no-handles allows no GOTO slot")
        return self.layout.placed[self.handle].address + self.slots[target]

    def _complain(self, section: Section, reloc: Reloc, kind: RelocationType | None, message: str) -> None:
        owner = self.resolution.owner[section].name
        name = reloc.symbol.name or "a section"
        what = f" ({kind.name})" if kind else ""
        self.findings.append(f"{owner}:({section.name}+{reloc.offset // 2:#x}): error: {name}: {message}{what}")

    def check(self) -> None:
        """Raise `ToolError` if any relocation has failed."""
        if self.findings:
            raise ToolError.of(self.findings)


_PROGRAM_ONLY = frozenset(
    (Formula.HANDLE, Formula.LOAD, Formula.PSVOFFSET, Formula.TBLOFFSET, Formula.PSVPAGE, Formula.TBLPAGE)
)


def _signed(field: int, width: int) -> int:
    return field - (1 << width) if width and field >> (width - 1) & 1 else field


def _unknown(number: int) -> str:
    reason = UNSUPPORTED_RELOCATIONS.get(number)
    return f"relocation {number} is not supported: {reason}" if reason else f"relocation {number} does not exist"
