"""DWARF 2 as assembler data directives (abi-elf.md §6.7): units, functions, variables, types, lines and call frames.

Code addresses are PC units, variables data addresses, both 4 bytes. Frame variables are relative to W15 at entry, which
the frame base expresses through W15 or W14. Variables in registers have location lists; where neither applies,
debuggers report them as optimised out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..ir.model import Module
from .call_frames import CallFrames, FrameSection
from .debuginfo import DebugInfo
from .leb import sleb, uleb
from .mir import CONSTANT, GONE
from .names import symbol
from .scopes import Die, FunctionInfo, Scope, Scopes, split_name

PRODUCER = "toolchain for dsPIC30F, clang front end"
ADDRESS_BYTES = 4
REFERENCE = re.compile(r"!\d+")
VALUE = re.compile(r"DW_OP_const([us]), (-?\d+), DW_OP_stack_value")
# DWARF 2 §7.5.4
TAGS = {"array_type": 0x01, "enumeration_type": 0x04, "formal_parameter": 0x05, "lexical_block": 0x0B, "member": 0x0D,
        "pointer_type": 0x0F, "compile_unit": 0x11, "structure_type": 0x13, "subroutine_type": 0x15, "typedef": 0x16,
        "union_type": 0x17, "unspecified_parameters": 0x18, "inlined_subroutine": 0x1D, "subrange_type": 0x21,
        "base_type": 0x24, "const_type": 0x26, "enumerator": 0x28, "subprogram": 0x2E, "variable": 0x34,
        "volatile_type": 0x35}  # fmt: skip
ATTRIBUTES = {"location": 0x02, "name": 0x03, "byte_size": 0x0B, "bit_offset": 0x0C, "bit_size": 0x0D,
              "stmt_list": 0x10,
              "low_pc": 0x11, "high_pc": 0x12, "language": 0x13, "comp_dir": 0x1B, "const_value": 0x1C,
              "inline": 0x20, "abstract_origin": 0x31, "ranges": 0x55, "call_file": 0x58, "call_line": 0x59,  # DWARF 3
              "upper_bound": 0x2F, "producer": 0x25, "prototyped": 0x27, "data_member_location": 0x38,
              "decl_file": 0x3A, "decl_line": 0x3B, "declaration": 0x3C, "encoding": 0x3E, "external": 0x3F,
              "frame_base": 0x40, "type": 0x49}  # fmt: skip
FORMS = {"addr": 0x01, "block1": 0x0A, "data1": 0x0B, "data2": 0x05, "data4": 0x06, "string": 0x08, "flag": 0x0C,
         "sdata": 0x0D, "ref4": 0x13}  # fmt: skip
ENCODINGS = {"address": 1, "boolean": 2, "float": 4, "signed": 5, "signed_char": 6, "unsigned": 7, "unsigned_char": 8}
LANGUAGE_C89 = 1
INLINED = 1  # DW_INL_inlined
OP_ADDR, OP_PLUS_UCONST, OP_REG0, OP_BREG0, OP_FBREG, OP_PIECE = 0x03, 0x23, 0x50, 0x70, 0x91, 0x93  # DWARF 2 §7.7.1
OP_IMPLICIT_VALUE = 0x9E  # DWARF 4
LINE_BASE, LINE_RANGE, OPCODE_BASE = -10, 245, 10  # abi-elf.md §6.7, C units
STANDARD_LENGTHS = (0, 1, 1, 1, 1, 0, 0, 0, 1)
SPECIFIERS = {"DW_TAG_const_type": "const_type", "DW_TAG_volatile_type": "volatile_type",
              "DW_TAG_pointer_type": "pointer_type", "DW_TAG_typedef": "typedef"}  # fmt: skip
COMPOSITES = {"DW_TAG_structure_type": "structure_type", "DW_TAG_union_type": "union_type",
              "DW_TAG_enumeration_type": "enumeration_type", "DW_TAG_array_type": "array_type"}  # fmt: skip


def _string(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'\t.asciz "{escaped}"'


def _expression(f: FunctionInfo, where: tuple[int, ...]) -> list[str]:
    """Location of a variable: in the frame, in registers, or a value without a place (`mir.Located`)."""
    if where[0] < 0:
        return [str(OP_FBREG), *sleb(f.objects[-1 - where[0]])]
    if all(w >= CONSTANT for w in where):
        return [str(OP_IMPLICIT_VALUE), str(2 * len(where)), *(str(b) for w in where for b in _octets(w - CONSTANT))]
    data: list[str] = []
    for w in where:
        if w != GONE:
            data.append(str(OP_REG0 + w))
        if len(where) > 1:
            data += [str(OP_PIECE), "2"]
    return data


def _octets(word: int) -> bytes:
    return word.to_bytes(2, "little")


def _constant(value: bytes) -> tuple[str, str, str | int | list[str]]:
    """DW_AT_const_value."""
    if len(value) in (1, 2, 4):
        return ("const_value", f"data{len(value)}", int.from_bytes(value, "little"))
    return ("const_value", "block1", [str(b) for b in value])


class Unit:
    """Debug entries of one compile unit."""

    def __init__(self, info: DebugInfo, module: Module, ref: str, number: int) -> None:
        self.info = info
        self.module = module
        self.ref = ref
        self.number = number
        self.types: dict[str, Die] = {}
        self.files: list[tuple[str, str]] = []
        self.functions: list[FunctionInfo] = []
        self.globals: list[tuple[str, str | bytes]] = []  # DIGlobalVariable, assembler symbol or value
        self.lists: list[list[tuple[str, str, list[str]]]] = []  # location lists, for .debug_loc
        self.ranges: list[list[tuple[str, str]]] = []  # addresses of units and scopes, for .debug_ranges
        self.abstract: dict[str, Die] = {}  # functions that were inlined somewhere

    def file_number(self, ref: str) -> int:
        """1-based number of the file of a node."""
        name = self.info.file(ref)
        if name not in self.files:
            self.files.append(name)
        return self.files.index(name) + 1

    def tree(self) -> Die:
        """The unit's entry with everything below it."""
        directory, name = self.info.file(self.ref)
        top = Die("compile_unit", [
            ("producer", "string", PRODUCER), ("language", "data1", LANGUAGE_C89), ("name", "string", name),
            ("comp_dir", "string", directory), ("low_pc", "addr", 0), ("stmt_list", "data4",
            f".Ldbg_line{self.number}"),
        ])  # fmt: skip
        if self.functions:
            top.attributes.append(self._addresses([(f.name, f.end_label) for f in self.functions]))
        body = [self._variable(ref, place) for ref, place in self.globals] + [self._function(f) for f in self.functions]
        top.children = [*self.types.values(), *self.abstract.values(), *body]
        return top

    def _addresses(self, pieces: list[tuple[str, str]]) -> tuple[str, str, str]:
        """Attribute that leads to a list of ranges."""
        self.ranges.append(pieces)
        return ("ranges", "data4", f".Ldbg_ranges{self.number}_{len(self.ranges) - 1}")

    def _declared(self, ref: str) -> list[tuple[str, str, str | int | list[str]]]:
        node = self.info.node(ref)
        out: list[tuple[str, str, str | int | list[str]]] = []
        if node.get("name"):
            out.append(("name", "string", node["name"]))
        if self.info.number(ref, "line"):
            out.append(("decl_file", "data1", min(self.file_number(ref), 255)))
            out.append(("decl_line", "data2", self.info.number(ref, "line")))
        return out

    def _type_attribute(self, ref: str | None) -> list[tuple[str, str, str | int | list[str]]]:
        die = self.type(ref)
        return [("type", "ref4", die.label)] if die is not None else []

    def _variable(self, ref: str, place: str | bytes) -> Die:
        node = self.info.node(ref)
        attributes = self._declared(ref) + self._type_attribute(node.get("type"))
        attributes.append(("external", "flag", int(node.get("isLocal") != "true")))
        attributes.append(_constant(place) if isinstance(place, bytes) else ("location", "block1", ["addr", place]))
        return Die("variable", attributes)

    def _function(self, f: FunctionInfo) -> Die:
        node = self.info.node(f.subprogram)
        returns = self.info.items(self.info.node(node.get("type", "")).get("types", "")) if "type" in node else []
        register, offset = f.frame_base
        attributes = self._declared(f.subprogram)
        if returns and returns[0] != "null":
            attributes += self._type_attribute(returns[0])
        attributes += [
            ("external", "flag", int("LocalToUnit" not in node.get("spFlags", ""))),
            ("prototyped", "flag", 1),
            ("low_pc", "addr", f.name),
            ("high_pc", "addr", f.end_label),
            ("frame_base", "block1", [str(OP_BREG0 + register), *sleb(offset)]),
        ]
        die = Die("subprogram", attributes)
        scopes = Scopes(self.info, f)
        located = dict(f.variables)
        for name in dict.fromkeys([*self._parameters(node), *f.known]):
            ref, call = split_name(name)
            scopes.place(ref, call, self._local(f, name, located.get(name)))
        self._fill(die, scopes.top)
        return die

    def _fill(self, die: Die, scope: Scope) -> None:
        """Variables of a scope, and the scopes inside that have code or variables."""
        die.children += scope.variables
        for inner in scope.inside.values():
            if not inner.pieces:
                continue
            child = Die("lexical_block", [self._addresses(inner.pieces)])
            if inner.call:
                child.tag = "inlined_subroutine"
                child.attributes += [
                    ("abstract_origin", "ref4", self._abstract(inner.ref).label),
                    ("call_file", "data1", min(self.file_number(inner.call), 255)),
                    ("call_line", "data2", self.info.number(inner.call, "line")),
                ]
            self._fill(child, inner)
            die.children.append(child)

    def _abstract(self, subprogram: str) -> Die:
        """The entry that copies of an inlined function refer to."""
        if subprogram not in self.abstract:
            attributes = [*self._declared(subprogram), ("prototyped", "flag", 1), ("inline", "data1", INLINED)]
            label = f".Ldbg_a{self.number}_{len(self.abstract)}"
            self.abstract[subprogram] = Die("subprogram", attributes, [], label)
        return self.abstract[subprogram]

    def _parameters(self, subprogram: dict[str, str]) -> list[str]:
        retained = self.info.items(subprogram.get("retainedNodes", ""))
        return [r for r in retained if self.info.number(r, "arg")]

    def _local(self, f: FunctionInfo, name: str, offset: int | None) -> Die:
        ref, ranges = split_name(name)[0], f.ranges.get(name)
        attributes = self._declared(ref) + self._type_attribute(self.info.node(ref).get("type"))
        if offset is not None:
            attributes.append(("location", "block1", [str(OP_FBREG), *sleb(offset)]))
        elif name in f.constants:
            attributes.append(_constant(f.constants[name]))
        elif ranges:
            attributes.append(("location", "data4", f".Ldbg_loc{self.number}_{len(self.lists)}"))
            self.lists.append([(start, end, _expression(f, where)) for start, end, where in ranges])
        return Die("formal_parameter" if self.info.number(ref, "arg") else "variable", attributes)

    # -- types --------------------------------------------------------------------------------------------------------

    def type(self, ref: str | None) -> Die | None:
        """Entry of a type node; None for void."""
        if ref is None or not ref.startswith("!"):
            return None
        found = self.types.get(ref)
        if found is not None:
            return found
        node = self.info.node(ref)
        die = Die("base_type", [], [], f".Ldbg_t{self.number}_{len(self.types)}")
        self.types[ref] = die
        tag = node.get("tag", "")
        if node["kind"] == "DIBasicType":
            self._base(die, ref, node)
        elif tag in SPECIFIERS:
            self._specifier(die, ref, node, SPECIFIERS[tag])
        elif tag in COMPOSITES:
            self._composite(die, ref, node, COMPOSITES[tag])
        elif node["kind"] == "DISubroutineType":
            self._subroutine(die, node)
        else:
            die.attributes = [("name", "string", node.get("name", "?")), ("byte_size", "data2", 0),
                              ("encoding", "data1", ENCODINGS["unsigned"])]  # fmt: skip
        return die

    def _bytes(self, ref: str) -> int:
        return (self.info.number(ref, "size") + 7) // 8

    def _base(self, die: Die, ref: str, node: dict[str, str]) -> None:
        encoding = ENCODINGS.get(node.get("encoding", "").removeprefix("DW_ATE_"), ENCODINGS["unsigned"])
        die.attributes = [("name", "string", node.get("name", "?")), ("byte_size", "data2", self._bytes(ref)),
                          ("encoding", "data1", encoding)]  # fmt: skip

    def _specifier(self, die: Die, ref: str, node: dict[str, str], tag: str) -> None:
        die.tag = tag
        if tag == "typedef":
            die.attributes = self._declared(ref)
        elif tag == "pointer_type":
            die.attributes = [("byte_size", "data2", self._bytes(ref))]
        die.attributes = die.attributes + self._type_attribute(node.get("baseType"))

    def _composite(self, die: Die, ref: str, node: dict[str, str], tag: str) -> None:
        die.tag = tag
        elements = self.info.items(node.get("elements", ""))
        if tag == "array_type":
            die.attributes = self._type_attribute(node.get("baseType"))
            die.children = [self._subrange(e) for e in elements]
            return
        die.attributes = self._declared(ref)
        if "DIFlagFwdDecl" in node.get("flags", ""):
            die.attributes.append(("declaration", "flag", 1))
            return
        die.attributes.append(("byte_size", "data2", self._bytes(ref)))
        if tag == "enumeration_type":
            die.children = [
                Die("enumerator", [("name", "string", self.info.node(e).get("name", "?")),
                                   ("const_value", "sdata", self.info.number(e, "value"))])
                for e in elements
            ]  # fmt: skip
        else:
            die.children = [self._member(e, tag) for e in elements]

    def _subrange(self, ref: str) -> Die:
        count = self.info.number(ref, "count", -1)
        return Die("subrange_type", [("upper_bound", "data2", count - 1)] if count > 0 else [])

    def _member(self, ref: str, parent: str) -> Die:
        node = self.info.node(ref)
        attributes = self._declared(ref) + self._type_attribute(node.get("baseType"))
        bit = self.info.number(ref, "offset")
        size = self.info.number(ref, "size")
        at = bit // 8
        if "DIFlagBitField" in node.get("flags", ""):
            storage = max(1, self._storage(node.get("baseType")))
            at = bit // (8 * storage) * storage
            attributes += [("byte_size", "data2", storage), ("bit_size", "data1", size),
                           ("bit_offset", "data1", max(0, 8 * storage - size - (bit - 8 * at)))]  # fmt: skip
        if parent == "structure_type":
            attributes.append(("data_member_location", "block1", [str(OP_PLUS_UCONST), *uleb(at)]))
        return Die("member", attributes)

    def _storage(self, ref: str | None) -> int:
        """Bytes of a bit-field's declared type."""
        for _ in range(16):
            if ref is None or not ref.startswith("!"):
                return 2
            if size := self._bytes(ref):
                return size
            ref = self.info.node(ref).get("baseType")
        return 2

    def _subroutine(self, die: Die, node: dict[str, str]) -> None:
        die.tag = "subroutine_type"
        types = self.info.items(node.get("types", ""))
        die.attributes = [("prototyped", "flag", 1)]
        if types and types[0] != "null":
            die.attributes += self._type_attribute(types[0])
        for t in types[1:]:
            if t == "null":
                die.children.append(Die("unspecified_parameters", []))
            else:
                die.children.append(Die("formal_parameter", self._type_attribute(t)))


class DwarfWriter:
    """Text of all debug sections of one module."""

    def __init__(self, module: Module) -> None:
        self.module = module
        self.info = DebugInfo(module)
        self.units: dict[str, Unit] = {}
        self.abbreviations: dict[tuple[object, ...], int] = {}
        self.frames = FrameSection()
        self.out: list[str] = []

    def unit(self, ref: str) -> Unit:
        """The unit for a DICompileUnit."""
        if ref not in self.units:
            self.units[ref] = Unit(self.info, self.module, ref, len(self.units))
        return self.units[ref]

    def add_function(self, f: FunctionInfo) -> None:
        """Record one compiled function."""
        unit = self.info.node(f.subprogram).get("unit", "")
        if unit.startswith("!"):
            self.unit(unit).functions.append(f)

    def add_frames(self, name: str, end: str, frames: CallFrames) -> None:
        """Record the call frames of one compiled function, which need not be one of the source."""
        self.frames.add(name, end, frames)

    def _collect_globals(self) -> None:
        owners = self._owners()
        for var in self.module.globals.values():
            if var.dbg is None or var.init is None or var.linkage == "private":
                continue
            ref = self.info.node(var.dbg).get("var", "")
            if ref in owners and self.info.node(ref).get("name"):
                self.unit(owners[ref]).globals.append((ref, symbol(self.module, var.name)))
        for cu, expression in self._expressions():
            value = VALUE.search(self.info.node(expression).get("expr", ""))
            ref = self.info.node(expression).get("var", "")
            if value is not None and ref not in {known for known, _ in self.unit(cu).globals}:
                size = max(1, self.info.bits(self.info.node(ref).get("type", "")) // 8)
                number = int(value[2]) & (1 << 8 * size) - 1
                self.unit(cu).globals.append((ref, number.to_bytes(size, "little")))

    def _owners(self) -> dict[str, str]:
        """DIGlobalVariable -> its compile unit."""
        return {self.info.node(expression).get("var", ""): cu for cu, expression in self._expressions()}

    def _expressions(self) -> Iterator[tuple[str, str]]:
        """Compile units with their DIGlobalVariableExpressions."""
        for cu in REFERENCE.findall(self.module.named_metadata.get("llvm.dbg.cu", "")):
            for expression in self.info.items(self.info.node(cu).get("globals", "")):
                yield cu, expression

    def text(self) -> list[str]:
        """All lines of all debug sections."""
        self._collect_globals()
        self.out.append("\t.section .debug_info,info")
        trees = [(u, u.tree()) for u in self.units.values()]
        for unit, tree in trees:
            self._info(unit, tree)
        self.out += ["\t.section .debug_abbrev,info", ".Ldbg_abbrev:"]
        self._abbreviations()
        self.out.append("\t.section .debug_loc,info")
        for unit, _ in trees:
            self._locations(unit)
        self.out.append("\t.section .debug_ranges,info")
        for unit, _ in trees:
            for k, pieces in enumerate(unit.ranges):
                self.out.append(f".Ldbg_ranges{unit.number}_{k}:")
                self.out += [f"\t.4byte {start},{end}" for start, end in [*pieces, ("0", "0")]]
        self.out.append("\t.section .debug_line,info")
        for unit, _ in trees:
            self._lines(unit)
        return self.out + self.frames.text()

    # -- .debug_info --------------------------------------------------------------------------------------------------

    def _info(self, unit: Unit, tree: Die) -> None:
        n = unit.number
        self.out += [f".Ldbg_info{n}:", f"\t.4byte .Ldbg_info_end{n}-.Ldbg_info_start{n}", f".Ldbg_info_start{n}:",
                     "\t.2byte 2", "\t.4byte .Ldbg_abbrev", f"\t.byte {ADDRESS_BYTES}"]  # fmt: skip
        self._die(tree, f".Ldbg_info{n}")
        self.out.append(f".Ldbg_info_end{n}:")

    def _die(self, die: Die, base: str) -> None:
        key = (die.tag, bool(die.children), tuple((a, f) for a, f, _ in die.attributes))
        code = self.abbreviations.setdefault(key, len(self.abbreviations) + 1)
        if die.label:
            self.out.append(f"{die.label}:")
        self.out.append(f"\t.byte {','.join(uleb(code))}")
        for _, form, value in die.attributes:
            self._value(form, value, base)
        if die.children:
            for child in die.children:
                self._die(child, base)
            self.out.append("\t.byte 0")

    def _value(self, form: str, value: str | int | list[str], base: str) -> None:
        match form:
            case "string":
                self.out.append(_string(str(value)))
            case "data1" | "flag":
                self.out.append(f"\t.byte {value}")
            case "data2":
                self.out.append(f"\t.2byte {value}")
            case "data4" | "addr":
                self.out.append(f"\t.4byte {value}")
            case "ref4":
                self.out.append(f"\t.4byte {value}-{base}")
            case "sdata":
                assert isinstance(value, int)
                self.out.append(f"\t.byte {','.join(sleb(value))}")
            case "block1":
                assert isinstance(value, list)
                if value[0] == "addr":
                    self.out += [f"\t.byte {1 + ADDRESS_BYTES},{OP_ADDR}", f"\t.4byte {value[1]}"]
                else:
                    self.out.append(f"\t.byte {len(value)},{','.join(value)}")

    def _abbreviations(self) -> None:
        for (tag, children, attributes), code in self.abbreviations.items():
            data = [*uleb(code), *uleb(TAGS[str(tag)]), str(int(bool(children)))]
            assert isinstance(attributes, tuple)
            for name, form in attributes:
                data += [*uleb(ATTRIBUTES[name]), *uleb(FORMS[form])]
            self.out.append(f"\t.byte {','.join([*data, '0', '0'])}")
        self.out.append("\t.byte 0")

    # -- .debug_loc ---------------------------------------------------------------------------------------------------

    def _locations(self, unit: Unit) -> None:
        """Start, end, expression; the unit's base address is 0. A pair of zeros ends a list."""
        for k, ranges in enumerate(unit.lists):
            self.out.append(f".Ldbg_loc{unit.number}_{k}:")
            for start, end, data in ranges:
                self.out += [f"\t.4byte {start},{end}", f"\t.2byte {len(data)}", f"\t.byte {','.join(data)}"]
            self.out.append("\t.4byte 0,0")

    # -- .debug_line --------------------------------------------------------------------------------------------------

    def _lines(self, unit: Unit) -> None:
        n = unit.number
        for f in unit.functions:
            for _, node, _ in f.rows:
                unit.file_number(node)
        self.out += [f".Ldbg_line{n}:", f"\t.4byte .Ldbg_line_end{n}-.Ldbg_line_start{n}", f".Ldbg_line_start{n}:",
                     "\t.2byte 2", f"\t.4byte .Ldbg_program{n}-.Ldbg_prologue{n}", f".Ldbg_prologue{n}:",
                     f"\t.byte 1,1,{LINE_BASE & 0xFF},{LINE_RANGE},{OPCODE_BASE}",
                     f"\t.byte {','.join(map(str, STANDARD_LENGTHS))}"]  # fmt: skip
        directories = list(dict.fromkeys(d for d, _ in unit.files if d))
        self.out += [_string(d) for d in directories] + ["\t.byte 0"]
        for directory, name in unit.files:
            index = directories.index(directory) + 1 if directory else 0
            self.out += [_string(name), f"\t.byte {','.join(uleb(index))},0,0"]
        self.out += ["\t.byte 0", f".Ldbg_program{n}:"]
        for f in unit.functions:
            self._sequence(unit, f)
        self.out.append(f".Ldbg_line_end{n}:")

    def _sequence(self, unit: Unit, f: FunctionInfo) -> None:
        """Rows of one function: every row sets its address, so that no distance needs to be known here."""
        line = file = 1
        for label, node, row_line in f.rows:
            self.out += [f"\t.byte 0,{1 + ADDRESS_BYTES},2", f"\t.4byte {label}"]
            number = unit.file_number(node)
            data = []
            if number != file:
                data += ["4", *uleb(number)]
                file = number
            if row_line != line:
                data += ["3", *sleb(row_line - line)]
                line = row_line
            self.out.append(f"\t.byte {','.join([*data, '1'])}")
        self.out += [f"\t.byte 0,{1 + ADDRESS_BYTES},2", f"\t.4byte {f.end_label}", "\t.byte 0,1,1"]
