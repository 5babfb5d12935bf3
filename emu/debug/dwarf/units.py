"""Functions, variables and types of an image from its DWARF 2 to 5 sections (abi-elf.md §6.7).

Input: an image with debug sections. Output: `DebugInfo`. Entries that cannot be read are omitted, so that damaged debug
information never makes a run fail. Addresses are PC units for code and bytes for data.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final
from weakref import WeakKeyDictionary

from emu.debug.dwarf.types import TAGGED, VOID, Member, Type
from emu.image.lines import dwarf_of, file_names, remove_phantom_octets
from emu.image.model import Image

Ranges = tuple[tuple[int, int], ...]
"""Half-open ranges of program addresses."""
ENCODINGS: Final = {2: "bool", 4: "float", 5: "signed", 6: "char", 7: "unsigned", 8: "char"}
"""Kinds of base types by their DW_ATE code (DWARF 2 §7.8)."""
SIGNED: Final = (5, 6)
TYPE_KINDS: Final = {
    "DW_TAG_structure_type": "struct",
    "DW_TAG_union_type": "union",
    "DW_TAG_enumeration_type": "enum",
    "DW_TAG_pointer_type": "pointer",
    "DW_TAG_array_type": "array",
    "DW_TAG_typedef": "typedef",
    "DW_TAG_const_type": "const",
    "DW_TAG_volatile_type": "volatile",
    "DW_TAG_subroutine_type": "function",
    "DW_TAG_base_type": "unsigned",
    "DW_TAG_unspecified_type": "void",
}
ADDRESS: Final = 4
"""Size in bytes of an address in debug sections (abi-elf.md §6.7)."""
BASE_SELECTION: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class VariableLocation:
    """Location of a variable: DWARF expressions, each valid for a range of program addresses or for all."""

    entries: tuple[tuple[int | None, int, bytes], ...]
    """Tuples of (start, end, expression). A start of None means all program addresses."""

    def at(self, pc: int) -> bytes | None:
        """Return the expression that is valid at `pc`, None if the variable is optimised out there."""
        return next((code for start, end, code in self.entries if start is None or start <= pc < end), None)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable or parameter. A variable without a location may have a `constant` value."""

    name: str
    type: Type
    location: VariableLocation | None
    constant: int | bytes | None = None
    is_parameter: bool = False
    file: str = ""
    line: int = 0

    def __repr__(self) -> str:
        return f"<Variable {self.name[:80]}: {str(self.type)[:80]}>"


@dataclass(eq=False, slots=True)
class Scope:
    """Scope of names: a function, a block inside it, or a function inlined into it."""

    kind: str
    """Kind of scope: "function", "block" or "inlined"."""
    name: str
    ranges: Ranges
    variables: list[Variable] = field(default_factory=list)
    inner: list[Scope] = field(default_factory=list)
    frame_base: VariableLocation | None = None
    file: str = ""
    line: int = 0
    call_file: str = ""
    call_line: int = 0
    """For an inlined function, the source line of its call."""
    unit: int = 0
    returns: Type | None = None
    """Type of a function's result; None for void."""

    def __repr__(self) -> str:
        return f"<Scope {self.kind} {self.name[:80]}: {len(self.variables)} variables>"

    def contains(self, pc: int) -> bool:
        """Whether the scope contains the instruction at `pc`."""
        return any(start <= pc < end for start, end in self.ranges)

    def chain(self, pc: int) -> list[Scope]:
        """Return this scope and those nested in it that contain `pc`, outermost first."""
        found = [self]
        while True:
            deeper = next((scope for scope in found[-1].inner if scope.contains(pc)), None)
            if deeper is None:
                return found
            found.append(deeper)


class DebugInfo:
    """Content of an image's debug sections, given by name."""

    def __init__(self, named: Mapping[str, bytes]) -> None:
        self.functions: Final[list[Scope]] = []
        """Functions with code, sorted by address."""
        self.globals: Final[dict[str, list[Variable]]] = {}
        """Variables outside functions, by name. Several files may define variables of the same name."""
        self.statics: Final[dict[int, dict[str, Variable]]] = {}
        """Variables outside functions, by compile unit and name."""
        self.types: Final[dict[str, dict[int, Type]]] = {}
        """Complete types by name and compile unit: base types, typedefs, and tags such as `struct node`."""
        self.constants: Final[dict[str, int]] = {}
        """Enumerators by name."""
        sections = remove_phantom_octets(named)
        if sections.get(".debug_info") and sections.get(".debug_abbrev"):
            _Reader(self, sections).read()
        self.functions.sort(key=lambda one: one.ranges[0])
        self._starts: Final = [one.ranges[0][0] for one in self.functions]

    def type(self, name: str, unit: int = -1) -> Type | None:
        """Return the type called `name` (`node`, `struct node`), preferably of compile unit `unit`;

        None if there is none.
        """
        known = self.types.get(name, {})
        return known.get(unit) or next(iter(known.values()), None)

    def function(self, pc: int) -> Scope | None:
        """Return the function that contains `pc`, None if there is none."""
        index = bisect_right(self._starts, pc) - 1
        if index >= 0 and self.functions[index].contains(pc):
            return self.functions[index]
        return next((one for one in self.functions if one.contains(pc)), None)


_KNOWN: Final[WeakKeyDictionary[Image, DebugInfo]] = WeakKeyDictionary()


def debug_of(image: Image) -> DebugInfo:
    """Return the debug information of `image`. The first call reads it."""
    found = _KNOWN.get(image)
    if found is None:
        found = _KNOWN[image] = DebugInfo(
            {one.name: one.octets for one in image.sections if one.name.startswith(".debug_")}
        )
    return found


class _Reader:
    """Reader of all compile units.

    pyelftools raises many kinds of exceptions for damaged input; the reader skips a damaged unit.
    """

    def __init__(self, info: DebugInfo, sections: dict[str, bytes]) -> None:
        self.info: Final = info
        self.dwarf: Final = dwarf_of(sections)
        self.loc: Final = sections.get(".debug_loc", b"")
        self.range: Final = sections.get(".debug_ranges", b"")
        self.types: Final[dict[int, Type]] = {}
        self.files: list[str] = []
        self.unit_base = 0
        self.unit = 0

    def read(self) -> None:
        units = self._units()
        for number, unit in enumerate(units):
            try:
                program = self.dwarf.line_program_for_CU(unit)
                self.files = file_names(program.header) if program is not None else []
                top = unit.get_top_DIE()
                self.unit, self.unit_base = number, _number(top, "DW_AT_low_pc") or 0
                for die in top.iter_children():
                    self._entry(die)
            except Exception:
                continue

    def _units(self) -> Iterator[Any]:
        units = self.dwarf.iter_CUs()
        while True:
            try:
                unit = next(units, None)
            except Exception:
                return
            if unit is None:
                return
            yield unit

    def _entry(self, die: Any) -> None:
        if die.tag == "DW_TAG_variable":
            one = self._variable(die)
            if one is not None and (one.location is not None or one.constant is not None):
                self.info.globals.setdefault(one.name, []).append(one)
                self.info.statics.setdefault(self.unit, {})[one.name] = one
        elif die.tag == "DW_TAG_subprogram":
            ranges = self._ranges(die)
            if ranges:
                self.info.functions.append(self._scope(die, "function", ranges))
        elif die.tag in TYPE_KINDS:
            self._register_type(die)

    def _register_type(self, die: Any, is_local: bool = False) -> None:
        """Register a type by its name. A type that is local to a function does not replace a type at file scope."""
        made = self._type(die)
        if made.name and (made.bytes or made.members):
            known = self.info.types.setdefault(f"{made.kind} {made.name}" if made.kind in TAGGED else made.name, {})
            known[self.unit] = known.get(self.unit, made) if is_local else made
        if made.kind == "enum":
            names = {name: value for value, name in made.names.items()}
            self.info.constants.update(names | self.info.constants if is_local else names)

    # Scopes and variables

    def _scope(self, die: Any, kind: str, ranges: Ranges) -> Scope:
        base = self._location(die, "DW_AT_frame_base")
        origin = _origin(die)
        scope = Scope(
            kind, _text(origin, "DW_AT_name"), ranges, frame_base=base,
            file=self._file(origin, "DW_AT_decl_file"), line=_number(origin, "DW_AT_decl_line") or 0,
            call_file=self._file(die, "DW_AT_call_file"), call_line=_number(die, "DW_AT_call_line") or 0,
            unit=self.unit, returns=self._type_of(origin) if "DW_AT_type" in origin.attributes else None,
        )  # fmt: skip
        for child in die.iter_children():
            if child.tag in ("DW_TAG_variable", "DW_TAG_formal_parameter"):
                one = self._variable(child)
                if one is not None:
                    scope.variables.append(one)
            elif child.tag in ("DW_TAG_lexical_block", "DW_TAG_inlined_subroutine"):
                inside = self._ranges(child) or ranges
                scope.inner.append(self._scope(child, "block" if "lexical" in child.tag else "inlined", inside))
            elif child.tag in TYPE_KINDS:
                self._register_type(child, is_local=True)
        return scope

    def _variable(self, die: Any) -> Variable | None:
        origin = _origin(die)
        name = _text(origin, "DW_AT_name")
        if not name or "DW_AT_declaration" in die.attributes:
            return None
        constant = die.attributes.get("DW_AT_const_value")
        value = constant.value if constant is not None else None
        return Variable(
            name, self._type_of(origin), self._location(die, "DW_AT_location"),
            bytes(value) if isinstance(value, list) else value, die.tag == "DW_TAG_formal_parameter",
            self._file(origin, "DW_AT_decl_file"), _number(origin, "DW_AT_decl_line") or 0,
        )  # fmt: skip

    def _file(self, die: Any, attribute: str) -> str:
        number = _number(die, attribute)
        return self.files[number] if number is not None and 0 <= number < len(self.files) else ""

    def _location(self, die: Any, attribute: str) -> VariableLocation | None:
        found = die.attributes.get(attribute)
        if found is None:
            return None
        if isinstance(found.value, list):
            return VariableLocation(((None, 0, bytes(found.value)),))
        return VariableLocation(tuple(self._location_list(found.value)))

    def _location_list(self, offset: int) -> Iterator[tuple[int, int, bytes]]:
        """Yield (start, end, expression) of each entry in a location list (DWARF 2 §2.4.6)."""
        for start, end, place in self._pairs(self.loc, offset):
            size = int.from_bytes(self.loc[place : place + 2], "little")
            yield start, end, self.loc[place + 2 : place + 2 + size]

    def _pairs(self, section: bytes, offset: int) -> Iterator[tuple[int, int, int]]:
        """Yield (start, end, offset of the next byte) for every entry of a list.

        In a location list, that byte begins the entry's expression.
        """
        base = self.unit_base
        carries_more = section is self.loc
        while offset + 2 * ADDRESS <= len(section):
            start = int.from_bytes(section[offset : offset + ADDRESS], "little")
            end = int.from_bytes(section[offset + ADDRESS : offset + 2 * ADDRESS], "little")
            offset += 2 * ADDRESS
            if start == end == 0:
                return
            if start == BASE_SELECTION:
                base = end
                continue
            yield base + start, base + end, offset
            if carries_more:
                offset += 2 + int.from_bytes(section[offset : offset + 2], "little")

    def _ranges(self, die: Any) -> Ranges:
        low, high = die.attributes.get("DW_AT_low_pc"), die.attributes.get("DW_AT_high_pc")
        if low is not None and high is not None:
            end = high.value if high.form == "DW_FORM_addr" else low.value + high.value
            return ((low.value, end),) if end > low.value else ()
        listed = _number(die, "DW_AT_ranges")
        if listed is None:
            return ()
        return tuple((start, end) for start, end, _ in self._pairs(self.range, listed) if end > start)

    # Types

    def _type_of(self, die: Any) -> Type:
        if "DW_AT_type" not in die.attributes:
            return VOID
        return self._type(die.get_DIE_from_attribute("DW_AT_type"))

    def _type(self, die: Any) -> Type:
        found = self.types.get(die.offset)
        if found is not None:
            return found
        kind = TYPE_KINDS.get(die.tag, "void")
        made = self.types[die.offset] = Type(kind, _text(die, "DW_AT_name"), _number(die, "DW_AT_byte_size") or 0)
        if die.tag == "DW_TAG_base_type":
            code = _number(die, "DW_AT_encoding") or 7
            made.kind, made.is_signed = ENCODINGS.get(code, "unsigned"), code in SIGNED
        elif kind in ("struct", "union"):
            made.members = tuple(self._members(die))
        elif kind == "enum":
            made.names = {
                _number(child, "DW_AT_const_value") or 0: _text(child, "DW_AT_name") for child in die.iter_children()
            }
            made.is_signed = min(made.names, default=0) < 0
        elif kind == "array":
            self._array(die, made)
        elif kind != "void":
            made.target = self._type_of(die) if "DW_AT_type" in die.attributes else None
            if kind in ("typedef", "const", "volatile") and made.target is None:
                made.target = VOID
        return made

    def _array(self, die: Any, made: Type) -> None:
        counts = [_count(child) for child in die.iter_children() if child.tag == "DW_TAG_subrange_type"] or [0]
        inner = self._type_of(die)
        for count in reversed(counts[1:]):
            inner = Type("array", target=inner, count=count)
        made.target, made.count = inner, counts[0]

    def _members(self, die: Any) -> Iterator[Member]:
        for child in die.iter_children():
            if child.tag != "DW_TAG_member":
                continue
            kind = self._type_of(child)
            offset = _member_offset(child)
            bits = _number(child, "DW_AT_bit_size") or 0
            lsb = 0
            if bits and "DW_AT_data_bit_offset" in child.attributes:
                first = _number(child, "DW_AT_data_bit_offset") or 0
                offset, lsb = first // 8, first % 8
            elif bits:  # counted from the most significant bit of the storage unit (DWARF 2 §5.5.4)
                storage = _number(child, "DW_AT_byte_size") or kind.bytes
                lsb = 8 * storage - bits - (_number(child, "DW_AT_bit_offset") or 0)
            yield Member(_text(child, "DW_AT_name"), kind, offset, bits, lsb)


def _origin(die: Any) -> Any:
    """Return the debugging entry that holds the name. For an inlined or out-of-line instance it is the abstract one."""
    while "DW_AT_name" not in die.attributes and "DW_AT_type" not in die.attributes:
        if "DW_AT_abstract_origin" in die.attributes:
            die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
        elif "DW_AT_specification" in die.attributes:
            die = die.get_DIE_from_attribute("DW_AT_specification")
        else:
            break
    return die


def _text(die: Any, attribute: str) -> str:
    found = die.attributes.get(attribute)
    return found.value.decode("utf-8", "replace") if found is not None else ""


def _number(die: Any, attribute: str) -> int | None:
    found = die.attributes.get(attribute)
    return found.value if found is not None and isinstance(found.value, int) else None


def _count(die: Any) -> int:
    count = _number(die, "DW_AT_count")
    if count is not None:
        return count
    bound = _number(die, "DW_AT_upper_bound")
    return 0 if bound is None else bound + 1


def _member_offset(die: Any) -> int:
    """Return the byte offset of a member, given as a number or, in DWARF 2, as the operand of `plus_uconst N`."""
    found = die.attributes.get("DW_AT_data_member_location")
    if found is None:
        return 0
    if isinstance(found.value, int):
        return found.value
    offset = shift = 0
    for byte in found.value[1:]:
        offset |= (byte & 0x7F) << shift
        shift += 7
    return offset
