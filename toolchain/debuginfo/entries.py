"""Debugging information entries of a compile unit: functions, variables, types, scopes (DWARF 2 §3-5).

Locations of frame variables are relative to W15 at entry; DW_AT_frame_base computes that address from W15 or W14.
Variables in registers have location lists. Debuggers report a variable without a location as optimised out.
"""

from __future__ import annotations

from toolchain.debuginfo.leb128 import sleb, uleb
from toolchain.debuginfo.metadata import DebugMetadata
from toolchain.debuginfo.scopes import DebugEntry, FunctionInfo, LexicalScope, ScopeTree, split_name
from toolchain.ir.model import Module
from toolchain.mir.function import CONSTANT_WORD, OPTIMISED_OUT

PRODUCER = "toolchain for dsPIC30F, clang front end"
ENCODINGS = {"address": 1, "boolean": 2, "float": 4, "signed": 5, "signed_char": 6, "unsigned": 7, "unsigned_char": 8}
LANGUAGE_C89 = 1
INLINED = 1  # DW_INL_inlined
OP_PLUS_UCONST, OP_REG0, OP_BREG0, OP_FBREG, OP_PIECE = 0x23, 0x50, 0x70, 0x91, 0x93  # DWARF 2 §7.7.1
OP_IMPLICIT_VALUE = 0x9E  # DW_OP_implicit_value of DWARF 4
SPECIFIERS = {"DW_TAG_const_type": "const_type", "DW_TAG_volatile_type": "volatile_type",
              "DW_TAG_pointer_type": "pointer_type", "DW_TAG_typedef": "typedef"}  # fmt: skip
COMPOSITES = {"DW_TAG_structure_type": "structure_type", "DW_TAG_union_type": "union_type",
              "DW_TAG_enumeration_type": "enumeration_type", "DW_TAG_array_type": "array_type"}  # fmt: skip


def _expression(f: FunctionInfo, name: str, where: tuple[int, ...]) -> list[str]:
    """DWARF expression of a `mir.VariableLocation`: in the frame, in registers, at an address, or an implicit value."""
    if name in f.returned:
        return [str(OP_BREG0 + where[0]), "0"]
    if where[0] < 0:
        return [str(OP_FBREG), *sleb(f.objects[-1 - where[0]])]
    if all(w >= CONSTANT_WORD for w in where):
        content = [str(b) for w in where for b in _octets(w - CONSTANT_WORD)]
        return [str(OP_IMPLICIT_VALUE), str(len(content)), *content]
    data: list[str] = []
    for w in where:
        if w != OPTIMISED_OUT:
            data.append(str(OP_REG0 + w))
        if len(where) > 1:
            data += [str(OP_PIECE), "2"]
    return data


def _octets(word: int) -> bytes:
    """Bytes of a word, low byte first."""
    return word.to_bytes(2, "little")


def _constant(value: bytes) -> tuple[str, str, str | int | list[str]]:
    """Attribute DW_AT_const_value with the bytes of a constant."""
    if len(value) in (1, 2, 4):
        return ("const_value", f"data{len(value)}", int.from_bytes(value, "little"))
    return ("const_value", "block1", [str(b) for b in value])


class CompileUnit:
    """Builds the entries of one compile unit."""

    def __init__(self, info: DebugMetadata, module: Module, ref: str, number: int) -> None:
        self.info = info
        self.module = module
        self.ref = ref
        self.number = number
        self.types: dict[str, DebugEntry] = {}
        self.files: list[tuple[str, str]] = []
        self.functions: list[FunctionInfo] = []
        self.globals: list[tuple[str, str | bytes]] = []  # (DIGlobalVariable, assembler symbol or constant value)
        self.lists: list[list[tuple[str, str, list[str]]]] = []  # location lists, for .debug_loc
        self.ranges: list[list[tuple[str, str]]] = []  # address ranges of units and scopes, for .debug_ranges
        self.abstract: dict[str, DebugEntry] = {}  # abstract instances of inlined functions, by DISubprogram

    def file_number(self, ref: str) -> int:
        """Number of the file of a node in the unit's file table, from 1."""
        name = self.info.file(ref)
        if name not in self.files:
            self.files.append(name)
        return self.files.index(name) + 1

    def tree(self) -> DebugEntry:
        """The entry of the unit with all its children."""
        directory, name = self.info.file(self.ref)
        top = DebugEntry("compile_unit", [
            ("producer", "string", PRODUCER), ("language", "data1", LANGUAGE_C89), ("name", "string", name),
            ("comp_dir", "string", directory), ("low_pc", "addr", 0), ("stmt_list", "data4",
            f".Ldbg_line{self.number}"),
        ])  # fmt: skip
        if self.functions:
            top.attributes.append(self._addresses([(f.name, f.end_label) for f in self.functions]))
        body = [self._variable(ref, value) for ref, value in self.globals] + [self._function(f) for f in self.functions]
        top.children = [*self.types.values(), *self.abstract.values(), *body]
        return top

    def _addresses(self, pieces: list[tuple[str, str]]) -> tuple[str, str, str]:
        """Attribute DW_AT_ranges for pairs of labels."""
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

    def _variable(self, ref: str, value: str | bytes) -> DebugEntry:
        node = self.info.node(ref)
        attributes = self._declared(ref) + self._type_attribute(node.get("type"))
        attributes.append(("external", "flag", int(node.get("isLocal") != "true")))
        attributes.append(_constant(value) if isinstance(value, bytes) else ("location", "block1", ["addr", value]))
        return DebugEntry("variable", attributes)

    def _function(self, f: FunctionInfo) -> DebugEntry:
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
        die = DebugEntry("subprogram", attributes)
        scopes = ScopeTree(self.info, f)
        located = dict(f.variables)
        for name in dict.fromkeys([*self._parameters(node), *f.known]):
            ref, call = split_name(name)
            scopes.add_variable(ref, call, self._local(f, name, located.get(name)))
        self._fill(die, scopes.top)
        return die

    def _fill(self, die: DebugEntry, scope: LexicalScope) -> None:
        """Add the variables of a scope and the inner scopes with code to the scope's entry."""
        die.children += scope.variables
        for inner in scope.inside.values():
            if not inner.pieces:
                continue
            child = DebugEntry("lexical_block", [self._addresses(inner.pieces)])
            if inner.call:
                child.tag = "inlined_subroutine"
                child.attributes += [
                    ("abstract_origin", "ref4", self._abstract(inner.ref).label),
                    ("call_file", "data1", min(self.file_number(inner.call), 255)),
                    ("call_line", "data2", self.info.number(inner.call, "line")),
                ]
            self._fill(child, inner)
            die.children.append(child)

    def _abstract(self, subprogram: str) -> DebugEntry:
        """The abstract instance of an inlined function, to which its inlined copies refer."""
        if subprogram not in self.abstract:
            attributes = [*self._declared(subprogram), ("prototyped", "flag", 1), ("inline", "data1", INLINED)]
            label = f".Ldbg_a{self.number}_{len(self.abstract)}"
            self.abstract[subprogram] = DebugEntry("subprogram", attributes, [], label)
        return self.abstract[subprogram]

    def _parameters(self, subprogram: dict[str, str]) -> list[str]:
        retained = self.info.items(subprogram.get("retainedNodes", ""))
        return [r for r in retained if self.info.number(r, "arg")]

    def _local(self, f: FunctionInfo, name: str, offset: int | None) -> DebugEntry:
        ref, ranges = split_name(name)[0], f.ranges.get(name)
        attributes = self._declared(ref) + self._type_attribute(self.info.node(ref).get("type"))
        if offset is not None:
            attributes.append(("location", "block1", [str(OP_FBREG), *sleb(offset)]))
        elif name in f.constants:
            attributes.append(_constant(f.constants[name]))
        elif ranges:
            attributes.append(("location", "data4", f".Ldbg_loc{self.number}_{len(self.lists)}"))
            self.lists.append([(start, end, _expression(f, name, where)) for start, end, where in ranges])
        return DebugEntry("formal_parameter" if self.info.number(ref, "arg") else "variable", attributes)

    # -- types --------------------------------------------------------------------------------------------------------

    def type(self, ref: str | None) -> DebugEntry | None:
        """The entry of a type node; None for void."""
        if ref is None or not ref.startswith("!"):
            return None
        found = self.types.get(ref)
        if found is not None:
            return found
        node = self.info.node(ref)
        die = DebugEntry("base_type", [], [], f".Ldbg_t{self.number}_{len(self.types)}")
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

    def _base(self, die: DebugEntry, ref: str, node: dict[str, str]) -> None:
        encoding = ENCODINGS.get(node.get("encoding", "").removeprefix("DW_ATE_"), ENCODINGS["unsigned"])
        die.attributes = [("name", "string", node.get("name", "?")), ("byte_size", "data2", self._bytes(ref)),
                          ("encoding", "data1", encoding)]  # fmt: skip

    def _specifier(self, die: DebugEntry, ref: str, node: dict[str, str], tag: str) -> None:
        die.tag = tag
        if tag == "typedef":
            die.attributes = self._declared(ref)
        elif tag == "pointer_type":
            die.attributes = [("byte_size", "data2", self._bytes(ref))]
        die.attributes = die.attributes + self._type_attribute(node.get("baseType"))

    def _composite(self, die: DebugEntry, ref: str, node: dict[str, str], tag: str) -> None:
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
                DebugEntry("enumerator", [("name", "string", self.info.node(e).get("name", "?")),
                                   ("const_value", "sdata", self.info.number(e, "value"))])
                for e in elements
            ]  # fmt: skip
        else:
            die.children = [self._member(e, tag) for e in elements]

    def _subrange(self, ref: str) -> DebugEntry:
        count = self.info.number(ref, "count", -1)
        return DebugEntry("subrange_type", [("upper_bound", "data2", count - 1)] if count > 0 else [])

    def _member(self, ref: str, parent: str) -> DebugEntry:
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
        return DebugEntry("member", attributes)

    def _storage(self, ref: str | None) -> int:
        """Size in bytes of the declared type of a bit-field."""
        for _ in range(16):
            if ref is None or not ref.startswith("!"):
                return 2
            if size := self._bytes(ref):
                return size
            ref = self.info.node(ref).get("baseType")
        return 2

    def _subroutine(self, die: DebugEntry, node: dict[str, str]) -> None:
        die.tag = "subroutine_type"
        types = self.info.items(node.get("types", ""))
        die.attributes = [("prototyped", "flag", 1)]
        if types and types[0] != "null":
            die.attributes += self._type_attribute(types[0])
        for t in types[1:]:
            if t == "null":
                die.children.append(DebugEntry("unspecified_parameters", []))
            else:
                die.children.append(DebugEntry("formal_parameter", self._type_attribute(t)))
