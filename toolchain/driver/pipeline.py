"""Optimised LLVM IR text -> pic30-as assembly text: the ordered list of passes.

Each pass sits in its own file and states what it needs and ensures. FUNCTION_PASSES is the order; `check_order`
verifies the constraints at import, so a pass cannot be moved to where its needs do not hold.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from toolchain.abi import sections
from toolchain.abi.names import block_label, symbol
from toolchain.debuginfo import bindings, call_frames
from toolchain.debuginfo.dwarf import DwarfWriter
from toolchain.debuginfo.metadata import DebugInfo
from toolchain.debuginfo.scopes import FunctionInfo
from toolchain.debuginfo.variables import Ranges
from toolchain.emit import atomic_sections, constructors, data, isr, used
from toolchain.emit import function as emit
from toolchain.ir import cfg
from toolchain.ir.model import BlockAddress, ConstAgg, ConstExpr, Function, Module, UnsupportedError, Value
from toolchain.ir.read import read_module
from toolchain.legalize import legalize
from toolchain.mir.mir import MFunction
from toolchain.optimise import (
    branches,
    by_value,
    combine,
    constants,
    local_cse,
    peephole,
    returns,
    schedule,
    single_bits,
    tail_merging,
)
from toolchain.regalloc import colouring, frame
from toolchain.select import select, switch
from toolchain.verify import Verifier

METADATA = re.compile(r"^!(\d+) = (.*)$", re.MULTILINE)


class CompileOptions(Protocol):
    """What the back end needs to know of the command line."""

    level: str  # "0" "1" "2" "s"
    debug: bool
    stack_check: bool
    large_code: bool
    large_data: bool
    verify: bool  # the machine form, after every pass


@dataclass(frozen=True)
class Options:
    """Stand-alone CompileOptions."""

    level: str = "s"
    debug: bool = False
    stack_check: bool = False
    large_code: bool = False
    large_data: bool = False
    verify: bool = True


@dataclass
class Context:
    """One function on its way through the passes."""

    module: Module
    info: DebugInfo
    function: Function
    options: CompileOptions
    interrupt: str
    taken: set[str]  # blocks whose address somebody in the module takes
    probe: bool  # check the stack limit at entry
    notes: set[str]  # its annotations
    machine: MFunction | None = None

    @property
    def m(self) -> MFunction:
        """The machine form; exists after selection."""
        assert self.machine is not None
        return self.machine

    @property
    def for_size(self) -> bool:
        """-Os, and -O0 where nobody measures speed."""
        return self.options.level in ("0", "s")


@dataclass(frozen=True)
class Pass:
    """One step. `needs` and `gives` name properties of the function; order constraints follow from them."""

    name: str
    run: Callable[[Context], None]
    needs: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()


def _legalize(c: Context) -> None:
    legalize.legalize(c.module, c.function, lambda line: where(c.info, c.function, line))


def _select(c: Context) -> None:
    c.machine = select.Selector(c.module, c.function, c.for_size, c.taken).run()
    c.machine.interrupt = c.interrupt
    c.machine.preserved, c.machine.preprologue = isr.preserved(c.notes), isr.preprologue(c.notes)
    if c.interrupt:
        c.machine.preserved += isr.accumulators(c.function)
    c.machine.uses_fp = frame.wants_frame_pointer(c.machine)


def _constants(c: Context) -> None:
    if c.options.level != "0":
        constants.run(c.m)


def _repeats(c: Context) -> None:
    if c.options.level != "0":
        local_cse.run(c.m)


def _schedule(c: Context) -> None:
    if c.options.level != "0":
        schedule.run(c.m)


def _by_value(c: Context) -> None:
    if c.options.level != "0":
        by_value.run(c.function)


def _combine(c: Context) -> None:
    if c.options.level != "0":
        combine.combine(c.function, c.for_size, c.options.level == "2")


def _single_bits(c: Context) -> None:
    if c.options.level != "0":
        single_bits.run(c.function, lambda name: sections.is_near(c.module, name))
    else:
        single_bits.one_operation(c.function)


def _returns(c: Context) -> None:
    if c.options.level != "0":
        returns.run(c.m)


def _tails(c: Context) -> None:
    if c.options.level == "s":
        tail_merging.run(c.m)


def _allocate(c: Context) -> None:
    c.machine = colouring.allocate(c.m, c.for_size, c.options.verify)


FUNCTION_PASSES = [
    Pass("unreachable", lambda c: cfg.remove_unreachable(c.function), ("ssa",), ("reachable",)),
    Pass("legalize", _legalize, ("ssa", "reachable"), ("legal",)),
    Pass("unreachable-again", lambda c: cfg.remove_unreachable(c.function), ("legal",)),
    Pass("dead-code", lambda c: cfg.dead_code(c.function), ("legal",)),
    Pass("by-value", _by_value, ("legal",)),
    Pass("combine", _combine, ("legal",)),
    Pass("dead-code-again", lambda c: cfg.dead_code(c.function), ("legal",)),
    Pass("split-logical", lambda c: cfg.split_logical_branches(c.function), ("legal",), ("no-logical-branches",)),
    Pass("sink-compares", lambda c: cfg.sink_compares(c.function), ("legal",)),
    Pass("switch", lambda c: switch.lower_switches(c.function, c.for_size), ("legal",), ("no-switch",)),
    Pass("critical-edges", lambda c: cfg.split_critical_edges(c.function), ("no-switch",), ("no-critical-edges",)),
    Pass("single-bits", _single_bits, ("legal", "no-critical-edges")),
    Pass("select", _select, ("legal", "reachable", "no-switch", "no-critical-edges"), ("machine",)),
    Pass("repeats", _repeats, ("machine",)),
    Pass("constants", _constants, ("machine",)),
    Pass("allocate", _allocate, ("machine",), ("real-registers",)),
    Pass("frame", lambda c: frame.build_frame(c.m, c.probe), ("real-registers",), ("framed",)),
    Pass("peephole", lambda c: peephole.run(c.m), ("framed",)),
    Pass("schedule", _schedule, ("framed",)),
    Pass("tail-calls", lambda c: branches.tail_calls(c.m), ("framed",)),
    Pass("tails", _tails, ("framed",)),
    Pass("branches", lambda c: branches.run(c.m, c.options.level != "0"), ("framed",), ("laid-out",)),
    Pass("returns", _returns, ("laid-out",)),
    Pass("holds", lambda c: atomic_sections.run(c.m), ("laid-out",)),
]


def check_order(passes: list[Pass]) -> None:
    """Every need is given by an earlier pass. Raises AssertionError naming the pass otherwise."""
    have = {"ssa"}
    for p in passes:
        missing = set(p.needs) - have
        assert not missing, f"pass {p.name} needs {missing}"
        have |= set(p.gives)


check_order(FUNCTION_PASSES)


def where(info: DebugInfo, f: Function, line: str | None) -> str:
    """ "file:line" of a !dbg reference, or the function's name."""
    found = info.position(line) or info.position(f.dbg)
    return f"{found[0]}:{found[1]}" if found is not None else f"in function '{f.name}'"


def taken_blocks(module: Module) -> dict[str, set[str]]:
    """Function name -> blocks whose address code or data takes."""
    out: dict[str, set[str]] = {}
    work: list[Value] = [v.init for v in module.globals.values() if v.init is not None]
    work += [a for f in module.functions.values() for b in f.blocks for i in b.instrs for a in i.args]
    while work:
        v = work.pop()
        if isinstance(v, BlockAddress):
            out.setdefault(v.function, set()).add(v.block)
        elif isinstance(v, ConstAgg):
            work += v.elems
        elif isinstance(v, ConstExpr):
            work += v.args
    return out


class LineRows:
    """Line-table rows of one function, collected while its text is written."""

    def __init__(self, info: DebugInfo, f: Function, name: str) -> None:
        self.info = info
        self.name = name
        self.last: tuple[str, int, str, str] | None = None
        self.rows: list[tuple[str, str, int]] = []
        assert f.dbg is not None
        line = info.number(f.dbg, "scopeLine") or info.number(f.dbg, "line")
        self.rows.append((name, f.dbg, line))

    def mark(self, ref: str | None) -> str:
        """Label line to put before an instruction that starts a new row, or ""."""
        position = self.info.position(ref)
        if position is None or ref is None:
            return ""
        node = self.info.node(ref)
        place = (*position, node.get("scope", ""), node.get("inlinedAt", ""))
        if place == self.last:
            return ""
        self.last = place
        label = f".Lrow{self.name}_{len(self.rows)}"
        self.rows.append((label, ref, position[1]))
        return f"{label}:"


def no_rows(ref: str | None) -> str:
    """Line marks without debug information."""
    return ""


def frame_variables(f: Function, m: MFunction) -> list[tuple[str, int]]:
    """(DILocalVariable, offset from W15 at entry) of variables declared to live in the frame."""
    out = []
    for record in f.dbg_records:
        slot = m.slot_of.get(id(record.value))
        if record.kind in ("dbg_declare", "parameter") and slot is not None:
            out.append((record.variable, offset_of(m, slot)))
    return out


def named_places(f: Function, m: MFunction) -> dict[str, int]:
    """Offsets from W15 at entry of the variables and struct parameters that lie in the frame, by their IR names."""
    slots = [(i.extra["source"], i) for i in f.blocks[0].instrs if i.op == "slot" and "source" in i.extra]
    named = [*slots, *((a.name, a) for a in f.args)]
    return {name: offset_of(m, m.slot_of[id(value)]) for name, value in named if id(value) in m.slot_of}


def offset_of(m: MFunction, index: int) -> int:
    """Bytes from W15 at entry to an object of the frame."""
    o = m.frame[index]
    return o.fixed if o.fixed is not None else o.offset + m.locals_base


class ModuleCompiler:
    """State of one module: text so far and label numbers."""

    def __init__(self, module: Module, options: CompileOptions) -> None:
        self.module = module
        self.options = options
        self.notes = isr.annotations_of(module)
        self.used = used.kept(module)
        module.large_data = options.large_data
        self.lines: list[str] = []
        self.serial = 0
        self.taken = taken_blocks(module)
        self.dwarf = DwarfWriter(module)
        module.far = data.beyond_near(self.notes, self.declared)
        self.placed: dict[str, dict[str, int]] = {}
        """By function: bytes from W15 at entry to its variables that have addresses, by their names in the IR."""

    def run(self) -> str:
        """All functions, then all data, then aliases."""
        for text in self.module.module_asm:
            self.lines.append(text)
        for f in self.module.functions.values():
            if f.blocks and f.linkage != "available_externally":
                self.function(f)
            elif f.linkage == "extern_weak":
                self.lines.append(f"\t.weak {symbol(self.module, f.name)}")
        self.lines += constructors.emit_constructors(self.module, self.options.large_code)
        self.lines += data.emit_data(self.module, self.notes, self.used, self.dwarf.info)
        self.aliases()
        if self.options.debug:
            self.lines += self.dwarf.text()
        return "\n".join(self.lines) + "\n"

    def declared(self, name: str) -> str:
        """ "file:line" of a function or variable, or its name."""
        found = self.module.functions.get(name) or self.module.globals.get(name)
        place = self.dwarf.info.declared(found.dbg) if found is not None else None
        kind = "function" if name in self.module.functions else "variable"
        return f"{place[0]}:{place[1]}" if place is not None else f"in {kind} '{name}'"

    def function(self, f: Function) -> None:
        """Compile one definition."""
        self.serial += 1
        notes = self.notes.get(f.name, set())
        interrupt = isr.interrupt_kind(notes, self.declared(f.name))
        probe = isr.wants_probe(notes, self.options.stack_check and not interrupt)
        if interrupt and (f.args or f.ret.kind != "void"):
            raise UnsupportedError("an interrupt function takes and returns nothing", self.declared(f.name))
        if not self.options.debug:
            f.dbg_records = []
        bindings.bind(f, self.dwarf.info)
        taken = self.taken.get(f.name, set())
        c = Context(self.module, self.dwarf.info, f, self.options, interrupt, taken, probe, notes)
        try:
            verifier: Verifier | None = None
            for p in FUNCTION_PASSES:
                if "machine" in p.gives and self.options.verify:
                    verifier = Verifier(f)
                p.run(c)
                if verifier is not None:
                    verifier.check(p.name, c.m)
        except UnsupportedError as e:
            raise UnsupportedError(e.what, e.where or where(self.dwarf.info, f, e.line)) from e
        self.placed[f.name] = named_places(f, c.m)
        self.lines += self.dwarf.info.marker(f.dbg)
        self.header(f, interrupt)
        name = symbol(self.module, f.name)
        rows = LineRows(self.dwarf.info, f, name) if self.options.debug and f.dbg is not None else None
        ranges = Ranges(str(self.serial))
        emitter = emit.Emitter(c.m, str(self.serial), self.options.large_code, self.dwarf.info.position)
        frames = call_frames.follow(c.m, str(self.serial)) if self.options.debug else None
        self.lines += emitter.text(rows.mark if rows is not None else no_rows, ranges, frames)
        gone = c.taken - {b.name for b in c.m.blocks}  # nothing jumps there, but their addresses are still values
        self.lines += [f"{block_label(f.name, block)}:" for block in sorted(gone)]
        self.lines.append(f"\t.size {name},.-{name}")
        end = f".Lend{self.serial}"
        if frames is not None:
            self.lines.append(f"{end}:")
            self.dwarf.add_frames(name, end, frames)
        if rows is not None and f.dbg is not None:
            ranges.close(end)
            frame_vars = frame_variables(f, c.m)
            known = [record.variable for record in f.dbg_records]
            objects = {k: offset_of(c.m, k) for k in range(len(c.m.frame))}
            info = FunctionInfo(
                name, f.dbg, end, c.m.frame_base, rows.rows, frame_vars, ranges.found, known, bindings.constants(f),
                objects,
            )  # fmt: skip
            self.dwarf.add_function(info)

    def header(self, f: Function, interrupt: str) -> None:
        """Section, symbol and type. Each function has a section of its own for --gc-sections."""
        name = symbol(self.module, f.name)
        own = "" if sections.place_of(f.section) else f.section  # near, far: how to call, which -mlarge-code decides
        section = own or (".isr.text." if interrupt else ".text.") + name
        modifiers = isr.section_modifiers(f.name, self.notes.get(f.name, set()))
        keep = used.KEEP if f.name in self.used else ""
        self.lines.append(f"\t.section {section},code{modifiers}{keep}")
        self.lines.append("\t.align 2")
        if f.linkage in data.WEAK:
            self.lines.append(f"\t.weak {name}")
        elif f.linkage not in ("internal", "private"):
            self.lines.append(f"\t.global {name}")
        self.lines.append(f"\t.type {name},@function")
        self.lines.append(f"{name}:")
        for vector in isr.vector_symbols(self.notes.get(f.name, set())):
            self.lines += [f"\t.global {vector}", f"{vector}:"]

    def aliases(self) -> None:
        """alias = target."""
        for name, target in self.module.aliases.items():
            s = symbol(self.module, name)
            image = data.Image(self.module)
            text = image.expression(target)
            if text.startswith("handle("):
                text = text[len("handle(") : -1]
            self.lines.append(f"\t.global {s}")
            self.lines.append(f"\t.set {s},{text}")


def compile_module(ll_text: str, options: CompileOptions) -> str:
    """Translate one module. Raises UnsupportedError naming the construct and its source line."""
    try:
        module = read_module(ll_text)
    except UnsupportedError as e:
        raise UnsupportedError(e.what, place_in(ll_text, e.line) or e.where) from None
    return ModuleCompiler(module, options).run()


def place_in(ll_text: str, ref: str | None) -> str:
    """ "file:line" of a !dbg reference of a module that is not read, or ""."""
    found = DebugInfo(Module(metadata=dict(METADATA.findall(ll_text)))).position(ref)
    return f"{found[0]}:{found[1]}" if found is not None else ""
