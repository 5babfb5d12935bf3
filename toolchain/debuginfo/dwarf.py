"""DWARF 2 sections as assembler directives (abi-elf.md §6.7): entries, line table, location lists and call frames.

Addresses have 4 bytes: program counter values for code, data addresses for variables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from toolchain.abi.names import symbol
from toolchain.debuginfo.call_frames import CallFrames, FrameSection
from toolchain.debuginfo.entries import CompileUnit
from toolchain.debuginfo.leb128 import sleb, uleb
from toolchain.debuginfo.metadata import DebugMetadata
from toolchain.debuginfo.scopes import DebugEntry, FunctionInfo
from toolchain.ir.model import Module

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
OP_ADDR = 0x03  # DWARF 2 §7.7.1
LINE_BASE, LINE_RANGE, OPCODE_BASE = -10, 245, 10  # header of line programs of C (abi-elf.md §6.7)
STANDARD_LENGTHS = (0, 1, 1, 1, 1, 0, 0, 0, 1)


def _string(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'\t.asciz "{escaped}"'


class DwarfWriter:
    """Writes all debug sections of one module."""

    def __init__(self, module: Module) -> None:
        self.module = module
        self.info = DebugMetadata(module)
        self.units: dict[str, CompileUnit] = {}
        self.abbreviations: dict[tuple[object, ...], int] = {}
        self.frames = FrameSection()
        self.out: list[str] = []

    def unit(self, ref: str) -> CompileUnit:
        """The compile unit of a DICompileUnit node."""
        if ref not in self.units:
            self.units[ref] = CompileUnit(self.info, self.module, ref, len(self.units))
        return self.units[ref]

    def add_function(self, f: FunctionInfo) -> None:
        """Add a compiled function to its unit."""
        unit = self.info.node(f.subprogram).get("unit", "")
        if unit.startswith("!"):
            self.unit(unit).functions.append(f)

    def add_frames(self, name: str, end: str, frames: CallFrames) -> None:
        """Add the call frames of a compiled function, which may have no DISubprogram."""
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
        """Compile unit of each DIGlobalVariable."""
        return {self.info.node(expression).get("var", ""): cu for cu, expression in self._expressions()}

    def _expressions(self) -> Iterator[tuple[str, str]]:
        """Pairs of compile unit and DIGlobalVariableExpression."""
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

    def _info(self, unit: CompileUnit, tree: DebugEntry) -> None:
        n = unit.number
        self.out += [f".Ldbg_info{n}:", f"\t.4byte .Ldbg_info_end{n}-.Ldbg_info_start{n}", f".Ldbg_info_start{n}:",
                     "\t.2byte 2", "\t.4byte .Ldbg_abbrev", f"\t.byte {ADDRESS_BYTES}"]  # fmt: skip
        self._die(tree, f".Ldbg_info{n}")
        self.out.append(f".Ldbg_info_end{n}:")

    def _die(self, die: DebugEntry, base: str) -> None:
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

    def _locations(self, unit: CompileUnit) -> None:
        """Append location lists: start, end, expression. The base address is 0; a pair of zeros ends a list."""
        for k, ranges in enumerate(unit.lists):
            self.out.append(f".Ldbg_loc{unit.number}_{k}:")
            for start, end, data in ranges:
                self.out += [f"\t.4byte {start},{end}", f"\t.2byte {len(data)}", f"\t.byte {','.join(data)}"]
            self.out.append("\t.4byte 0,0")

    # -- .debug_line --------------------------------------------------------------------------------------------------

    def _lines(self, unit: CompileUnit) -> None:
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

    def _sequence(self, unit: CompileUnit, f: FunctionInfo) -> None:
        """Append the rows of one function. Every row sets its address, because code sizes are unknown."""
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
