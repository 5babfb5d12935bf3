"""Global variables as data sections (abi-elf.md §1.4, §4.3): near and far RAM, constants in the PSV window."""

from __future__ import annotations

import re

from toolchain.abi.names import block_label, symbol
from toolchain.abi.sections import SECTION_ATTRIBUTES, attribute_section, is_near
from toolchain.abi.target import NEAR_END
from toolchain.debuginfo.metadata import DebugMetadata
from toolchain.emit.annotations import address_and_reverse, section_modifiers
from toolchain.emit.used import KEEP
from toolchain.ir.model import (
    BlockAddress,
    ConstAgg,
    ConstBytes,
    ConstExpr,
    ConstInt,
    ConstZero,
    GlobalRef,
    GlobalVar,
    Module,
    Type,
    Undef,
    UnsupportedError,
    Value,
    size_of,
    struct_offsets,
)

WORDS_PER_LINE = 8
SKIPPED_SECTIONS = ("llvm.metadata",)
NOTES = ".note.bounds"
"""Section of the annotations of bounds.h."""
WEAK = ("weak", "weak_odr", "linkonce", "linkonce_odr", "extern_weak", "common")
SECTION_TYPES = {".const": "psv,page", ".nbss": "bss,near", ".ndata": "data,near", ".bss": "bss", ".data": "data",
                 ".xbss": "bss,xmemory,near", ".xdata": "data,xmemory,near", ".ybss": "bss,ymemory",
                 ".ydata": "data,ymemory", ".note": "info",
                 ".pbss": "persist", ".eedata": "eedata", ".prog": "code", ".psv": "psv,page"}  # fmt: skip
CONFIG_SECTION = re.compile(r"__\w+\.sec")  # sections of configuration words, which are program words (abi-elf.md §6.6)


def far_objects(notes: dict[str, set[str]]) -> frozenset[str]:
    """Objects whose `address(N)` is beyond near memory."""
    return frozenset(
        name
        for name, texts in notes.items()
        if any(what == "address" and number >= NEAR_END for what, number in address_and_reverse(texts))
    )


class DataEmitter:
    """Writer of the definitions of all variables of a module."""

    def __init__(self, module: Module, notes: dict[str, set[str]], used: frozenset[str], info: DebugMetadata) -> None:
        self.module = module
        self.info = info
        self.notes = notes
        self.used = used
        self.lines: list[str] = []

    def run(self) -> list[str]:
        """Lines of every definition, each in its own section so that the linker can drop unused ones."""
        for var in self.module.globals.values():
            if var.init is None:
                if var.linkage == "extern_weak":
                    self.lines.append(f"\t.weak {symbol(self.module, var.name)}")
                continue
            if var.section in SKIPPED_SECTIONS or var.name.startswith("llvm.") or var.linkage == "available_externally":
                continue
            self.variable(var)
        return self.lines

    def variable(self, var: GlobalVar) -> None:
        """Append the lines of one definition."""
        name, size = symbol(self.module, var.name), size_of(var.type)
        zero = isinstance(var.init, ConstZero | Undef) or (isinstance(var.init, ConstInt) and var.init.value == 0)
        modifiers = section_modifiers(self.notes.get(var.name, set()))
        keep = KEEP if var.name in self.used else ""
        self.lines += self.info.marker(var.dbg)
        self.lines.append(f"\t.section {self._section(var, name, zero, modifiers)}{modifiers}{keep}")
        align = max(var.align, 2 if size > 1 else 1)
        if align > 1:
            self.lines.append(f"\t.align {align}")
        if var.linkage in WEAK:
            self.lines.append(f"\t.weak {name}")
        elif var.linkage not in ("internal", "private"):
            self.lines.append(f"\t.global {name}")
        if var.linkage != "private":
            self.lines.append(f"\t.type {name},@object")
            self.lines.append(f"\t.size {name},{size}")
        self.lines.append(f"{name}:")
        if zero and not var.constant:
            self.lines.append(f"\t.space {max(size, 1)}")
            return
        self.lines += self._content(var, size)
        if var.section == NOTES and "._" in var.name:  # static in a function: record its name
            self.lines.append(f'\t.ascii "in {var.name.partition(".")[0]}\\n"')

    def _content(self, var: GlobalVar, size: int) -> list[str]:
        """Directives of the initialiser."""
        assert var.init is not None
        data = InitialiserImage(self.module)
        try:
            data.value(var.init, var.type)
            data.pad_to(max(size, 1))
            return data.text()
        except UnsupportedError as e:
            position = self.info.declared(var.dbg)
            where = f"{position[0]}:{position[1]}" if position is not None else f"in variable '{var.name}'"
            raise UnsupportedError(e.what, where) from e

    def _section(self, var: GlobalVar, name: str, zero: bool, modifiers: str) -> str:
        """Name and attributes of the section of a variable."""
        suffix = name.removeprefix(".L")
        kind = "bss" if zero else "data"
        stem = attribute_section(var.section)
        if stem:
            return f"{stem}.{suffix},{kind}{SECTION_ATTRIBUTES[stem]}"
        if "," in var.section:  # the source gives name and attributes in the syntax of assembly
            return var.section
        if CONFIG_SECTION.fullmatch(var.section):
            return f"{var.section},code"
        if var.section:
            base = next((k for k in SECTION_TYPES if var.section == k or var.section.startswith(k + ".")), "")
            if base:
                return f"{var.section},{SECTION_TYPES[base]}"
            return f"{var.section}," + ("psv,page" if var.constant else "bss" if zero else "data")
        if var.constant:
            return ".const,psv,page"  # one section for all, as Microchip's linker requires (abi-elf.md §1.4)
        near = is_near(self.module, var.name) and "address" not in modifiers
        return f".n{kind}.{suffix},{kind},near" if near else f".{kind}.{suffix},{kind}"


class InitialiserImage:
    """Bytes and relocatable words of one initialiser, in order of their addresses."""

    def __init__(self, module: Module) -> None:
        self.module = module
        self.items: list[int | str] = []  # bytes, and expressions of two bytes
        self.size = 0

    def pad_to(self, size: int) -> None:
        """Append zero bytes up to an offset."""
        self.items += [0] * (size - self.size)
        self.size = max(size, self.size)

    def value(self, v: Value, t: Type) -> None:
        """Append a constant of type `t` at the current offset."""
        start = self.size
        match v:
            case ConstInt():
                n = (t.bits + 7) // 8
                self.items += v.value.to_bytes(n, "little")
                self.size += n
            case ConstBytes():
                self.items += v.data
                self.size += len(v.data)
            case ConstZero() | Undef():
                pass
            case ConstAgg():
                offsets = struct_offsets(t) if t.kind == "struct" else None
                for k, e in enumerate(v.elems):
                    self.pad_to(start + (offsets[k] if offsets is not None else k * size_of(t.elems[0])))
                    self.value(e, e.type)
            case GlobalRef() | BlockAddress() | ConstExpr():
                self.items.append(self.expression(v))
                self.size += 2
                if t.bits > 16:
                    self.pad_to(start + t.bits // 8)
            case _:
                raise UnsupportedError(f"initialiser of type {t}")
        self.pad_to(start + size_of(t))

    def expression(self, v: Value) -> str:
        """Assembler expression of a relocatable 16-bit constant."""
        match v:
            case BlockAddress():
                return f"handle({block_label(v.function, v.block)})"
            case GlobalRef() if v.name in self.module.functions:
                return f"handle({symbol(self.module, v.name)})"
            case GlobalRef():
                target = self.module.aliases.get(v.name)
                if isinstance(target, GlobalRef) and target.name in self.module.functions:
                    return f"handle({symbol(self.module, v.name)})"
                offset = v.offset - 0x10000 if v.offset >= 0x8000 else v.offset
                return symbol(self.module, v.name) + (f"{offset:+d}" if offset else "")
            case ConstInt():
                return str(v.value)
            case ConstExpr(op="sub", args=args) if any(_is_label(a) for a in args):
                # a handle may be the address of a jump to the label, so differences of handles are undefined
                raise UnsupportedError("a difference of labels in an initialiser: keep the labels themselves (&&label)")
            case ConstExpr(op="add" | "sub", args=[a, b]):
                return f"({self.expression(a)}{'+' if v.op == 'add' else '-'}{self.expression(b)})"
            case ConstExpr(op="ptrtoint" | "inttoptr" | "bitcast" | "zext" | "trunc", args=[a]):
                return self.expression(a)
        raise UnsupportedError(f"initialiser expression {getattr(v, 'op', v)}")

    def text(self) -> list[str]:
        """Data directives: words at even offsets where possible, bytes otherwise."""
        lines: list[str] = []
        run: list[str] = []
        kind = ".word"
        at = k = 0

        def flush(new: str) -> None:
            nonlocal kind
            if run and (new != kind or len(run) == WORDS_PER_LINE):
                lines.append(f"\t{kind} {','.join(run)}")
                run.clear()
            kind = new

        while k < len(self.items):
            item = self.items[k]
            if isinstance(item, str):
                if at % 2:
                    raise UnsupportedError("address in an initialiser at an odd offset (packed struct)")
                flush(".word")
                run.append(item)
                k, at = k + 1, at + 2
                continue
            after = self.items[k + 1] if k + 1 < len(self.items) else None
            if at % 2 == 0 and isinstance(after, int):
                zeros = self._zero_run(k)
                if zeros >= 8:
                    flush(".space")
                    run.append(str(zeros))
                    lines.append(f"\t.space {zeros}")
                    run.clear()
                    k, at = k + zeros, at + zeros
                    continue
                flush(".word")
                run.append(f"0x{item | after << 8:04X}")
                k, at = k + 2, at + 2
            else:
                flush(".byte")
                run.append(f"0x{item:02X}")
                k, at = k + 1, at + 1
        flush("")
        return lines

    def _zero_run(self, k: int) -> int:
        """Number of zero bytes from item `k` on, rounded down to an even number."""
        n = 0
        while k + n < len(self.items) and self.items[k + n] == 0:
            n += 1
        return n & ~1


def _is_label(v: Value) -> bool:
    """Whether a constant is a block address, possibly cast."""
    while isinstance(v, ConstExpr) and v.op in ("ptrtoint", "inttoptr", "bitcast", "zext", "trunc"):
        v = v.args[0]
    return isinstance(v, BlockAddress)


def emit_data(module: Module, notes: dict[str, set[str]], used: frozenset[str], info: DebugMetadata) -> list[str]:
    """Assembly lines of all variables; `notes` are their annotations, `used` those that the linker must keep."""
    return DataEmitter(module, notes, used, info).run()
