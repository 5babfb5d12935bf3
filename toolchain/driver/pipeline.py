"""The pass pipeline: optimised LLVM IR text to pic30-as assembly text.

FUNCTION_PASSES lists the passes in order, with the optimisation levels at which each runs and the properties that it
requires and establishes. `check_order` verifies the requirements at import.
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
from toolchain.debuginfo.metadata import DebugMetadata
from toolchain.debuginfo.scopes import FunctionInfo
from toolchain.debuginfo.variables import LocationLists
from toolchain.emit import annotations as attributes
from toolchain.emit import atomic_sections, constructors, data, used
from toolchain.emit import function as emit
from toolchain.ir import cfg
from toolchain.ir.model import BlockAddress, ConstAgg, ConstExpr, Function, Module, UnsupportedError, Value
from toolchain.ir.read import read_module
from toolchain.legalize import legalize
from toolchain.mir.function import MFunction
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
    """Command line options that the back end uses."""

    level: str  # "0" "1" "2" "s"
    debug: bool
    stack_check: bool
    large_code: bool
    large_data: bool
    verify: bool  # verify the machine form after every pass

    @property
    def frame_pointer(self) -> bool:
        """Whether every function has LNK and ULNK, as XC16's do without optimisation."""


@dataclass(frozen=True)
class BackendOptions:
    """CompileOptions for callers without a command line."""

    level: str = "s"
    debug: bool = False
    stack_check: bool = False
    large_code: bool = False
    large_data: bool = False
    frame_pointer: bool = False
    verify: bool = True


@dataclass
class FunctionContext:
    """One function in the pipeline: its IR, its machine form and the facts that passes need."""

    module: Module
    info: DebugMetadata
    function: Function
    options: CompileOptions
    interrupt: str
    taken: set[str]  # blocks whose address is taken in the module
    probe: bool  # whether the function checks the stack limit at entry
    notes: set[str]  # annotations of the function
    machine: MFunction | None = None

    @property
    def m(self) -> MFunction:
        """The machine form, which exists after selection."""
        assert self.machine is not None
        return self.machine

    @property
    def for_size(self) -> bool:
        """Whether small code is preferred: at -Os and -O0."""
        return self.options.level in ("0", "s")

    @property
    def for_speed(self) -> bool:
        """Whether fast code is preferred even if it is larger: at -O2."""
        return self.options.level == "2"


ALL_LEVELS = frozenset("012s")
UNOPTIMISED = frozenset("0")
OPTIMISED = frozenset("12s")
SIZE = frozenset("s")


@dataclass(frozen=True)
class Pass:
    """One pass: the levels at which it runs, and the properties of the function that it requires and establishes."""

    name: str
    run: Callable[[FunctionContext], None]
    levels: frozenset[str] = ALL_LEVELS
    needs: tuple[str, ...] = ()
    gives: tuple[str, ...] = ()


def _legalize(c: FunctionContext) -> None:
    legalize.legalize(c.module, c.function, lambda line: source_position(c.info, c.function, line))


def _select(c: FunctionContext) -> None:
    c.machine = select.FunctionSelector(c.module, c.function, c.for_size, c.taken).run()
    c.machine.interrupt = c.interrupt
    c.machine.naked = "naked" in c.function.attrs or attributes.NAKED in c.notes
    c.machine.preserved, c.machine.preprologue = attributes.preserved(c.notes), attributes.preprologue(c.notes)
    if c.interrupt:
        c.machine.preserved += attributes.accumulators(c.function)
    c.machine.uses_fp = frame.wants_frame_pointer(c.machine, c.options.frame_pointer)


def _allocate(c: FunctionContext) -> None:
    c.machine = colouring.allocate(c.m, c.for_size, c.options.verify)


def _single_bits(c: FunctionContext) -> None:
    single_bits.run(c.function, lambda name: sections.is_near(c.module, name))


def _unoptimised_single_bits(c: FunctionContext) -> None:
    single_bits.one_operation(c.function)
    single_bits.branches_for_choices(c.function, lambda name: sections.is_near(c.module, name))


FUNCTION_PASSES = [
    # LLVM IR -> legal IR
    Pass("unreachable", lambda c: cfg.remove_unreachable(c.function), ALL_LEVELS, ("ssa",), ("reachable",)),
    Pass("legalize", _legalize, ALL_LEVELS, ("ssa", "reachable"), ("legal",)),
    Pass("unreachable-again", lambda c: cfg.remove_unreachable(c.function), ALL_LEVELS, ("legal",)),
    Pass("dead-code", lambda c: cfg.dead_code(c.function), ALL_LEVELS, ("legal",)),
    Pass("by-value", lambda c: by_value.run(c.function), OPTIMISED, ("legal",)),
    Pass("combine", lambda c: combine.combine(c.function, c.for_size, c.for_speed), OPTIMISED, ("legal",)),
    Pass("dead-code-again", lambda c: cfg.dead_code(c.function), ALL_LEVELS, ("legal",)),
    Pass("split-logical", lambda c: cfg.split_logical_branches(c.function), ALL_LEVELS, ("legal",)),
    Pass("sink-compares", lambda c: cfg.sink_compares(c.function), ALL_LEVELS, ("legal",)),
    Pass("switch", lambda c: switch.lower_switches(c.function, c.for_size), ALL_LEVELS, ("legal",), ("no-switch",)),
    Pass("critical-edges", lambda c: cfg.split_critical_edges(c.function), ALL_LEVELS, ("no-switch",),
         ("no-critical-edges",)),
    Pass("single-bits", _single_bits, OPTIMISED, ("legal", "no-critical-edges")),
    Pass("single-bit-instructions", _unoptimised_single_bits, UNOPTIMISED, ("legal", "no-critical-edges")),
    # legal IR -> machine form over virtual registers
    Pass("select", _select, ALL_LEVELS, ("legal", "reachable", "no-switch", "no-critical-edges"), ("machine",)),
    Pass("local-cse", lambda c: local_cse.run(c.m), OPTIMISED, ("machine",)),
    Pass("constants", lambda c: constants.run(c.m), OPTIMISED, ("machine",)),
    # machine form over W0-W15
    Pass("allocate", _allocate, ALL_LEVELS, ("machine",), ("real-registers",)),
    Pass("frame", lambda c: frame.build_frame(c.m, c.probe), ALL_LEVELS, ("real-registers",), ("framed",)),
    Pass("peephole", lambda c: peephole.run(c.m), ALL_LEVELS, ("framed",)),
    Pass("schedule", lambda c: schedule.run(c.m), OPTIMISED, ("framed",)),
    Pass("tail-calls", lambda c: branches.tail_calls(c.m), ALL_LEVELS, ("framed",)),
    Pass("tail-merging", lambda c: tail_merging.run(c.m), SIZE, ("framed",)),
    Pass("thread-jumps", lambda c: branches.thread_jumps(c.m), ALL_LEVELS, ("framed",)),
    Pass("block-layout", lambda c: branches.reorder(c.m), OPTIMISED, ("framed",)),
    Pass("branches", lambda c: branches.run(c.m), ALL_LEVELS, ("framed",), ("laid-out",)),
    Pass("returns", lambda c: returns.run(c.m), OPTIMISED, ("laid-out",)),
    Pass("atomic-sections", lambda c: atomic_sections.run(c.m), ALL_LEVELS, ("laid-out",)),
]  # fmt: skip


def check_order(passes: list[Pass]) -> None:
    """Raise AssertionError if a pass requires a property that no earlier pass establishes at every level."""
    have = {"ssa"}
    for p in passes:
        missing = set(p.needs) - have
        assert not missing, f"pass {p.name} needs {missing}"
        if p.levels == ALL_LEVELS:
            have |= set(p.gives)


check_order(FUNCTION_PASSES)


def source_position(info: DebugMetadata, f: Function, line: str | None) -> str:
    """ "file:line" of a !dbg reference or else of the function; without debug information, the function's name."""
    found = info.position(line) or info.position(f.dbg)
    return f"{found[0]}:{found[1]}" if found is not None else f"in function '{f.name}'"


def address_taken_blocks(module: Module) -> dict[str, set[str]]:
    """By function: the blocks whose address is taken in code or data of the module."""
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


class LineTableRows:
    """Line table rows of one function, collected while its text is written."""

    def __init__(self, info: DebugMetadata, f: Function, name: str) -> None:
        self.info = info
        self.name = name
        self.last: tuple[str, int, str, str] | None = None
        self.rows: list[tuple[str, str, int]] = []
        assert f.dbg is not None
        line = info.number(f.dbg, "scopeLine") or info.number(f.dbg, "line")
        self.rows.append((name, f.dbg, line))

    def mark(self, ref: str | None) -> str:
        """Label line for an instruction that starts a new row of the line table; "" for other instructions."""
        position = self.info.position(ref)
        if position is None or ref is None:
            return ""
        node = self.info.node(ref)
        location = (*position, node.get("scope", ""), node.get("inlinedAt", ""))
        if location == self.last:
            return ""
        self.last = location
        label = f".Lrow{self.name}_{len(self.rows)}"
        self.rows.append((label, ref, position[1]))
        return f"{label}:"


def no_rows(ref: str | None) -> str:
    """`LineTableRows.mark` of a function without debug information: no label."""
    return ""


def frame_variables(f: Function, m: MFunction) -> list[tuple[str, int]]:
    """(DILocalVariable, offset from W15 at entry) of the variables that debug records declare in the frame."""
    out = []
    for record in f.dbg_records:
        slot = m.slot_of.get(id(record.value))
        if record.kind in ("dbg_declare", "parameter") and slot is not None:
            out.append((record.variable, offset_of(m, slot)))
    return out


def frame_offsets(f: Function, m: MFunction) -> dict[str, int]:
    """Offset from W15 at entry of every variable and struct parameter in the frame, by IR name."""
    slots = [(i.extra["source"], i) for i in f.blocks[0].instrs if i.op == "slot" and "source" in i.extra]
    named = [*slots, *((a.name, a) for a in f.args)]
    return {name: offset_of(m, m.slot_of[id(value)]) for name, value in named if id(value) in m.slot_of}


def offset_of(m: MFunction, index: int) -> int:
    """Offset in bytes of a frame object from W15 at entry."""
    o = m.frame[index]
    return o.fixed if o.fixed is not None else o.offset + m.locals_base


class ModuleCompiler:
    """Compiler of one module; holds the assembly text so far and the counter that makes local labels unique."""

    def __init__(self, module: Module, options: CompileOptions) -> None:
        self.module = module
        self.options = options
        self.notes = attributes.annotations_of(module)
        self.used = used.retained_names(module)
        module.large_data = options.large_data
        self.lines: list[str] = []
        self.serial = 0
        self.taken = address_taken_blocks(module)
        self.dwarf = DwarfWriter(module)
        module.far = data.far_objects(self.notes)
        self.frame_offsets: dict[str, dict[str, int]] = {}  # `frame_offsets` of each function

    def run(self) -> str:
        """Return the assembly text: functions, data, aliases, debug sections."""
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
        """ "file:line" of the declaration of a function or variable; without debug information, its name."""
        found = self.module.functions.get(name) or self.module.globals.get(name)
        position = self.dwarf.info.declared(found.dbg) if found is not None else None
        kind = "function" if name in self.module.functions else "variable"
        return f"{position[0]}:{position[1]}" if position is not None else f"in {kind} '{name}'"

    def function(self, f: Function) -> None:
        """Compile one function definition."""
        self.serial += 1
        c = self._context(f)
        self._run_passes(c)
        self.frame_offsets[f.name] = frame_offsets(f, c.m)
        self.lines += self.dwarf.info.marker(f.dbg)
        self.header(f, c.interrupt)
        self._emit(c)

    def _context(self, f: Function) -> FunctionContext:
        """Prepare a function for the passes. Raises UnsupportedError for an invalid interrupt or naked function."""
        notes = self.notes.get(f.name, set())
        interrupt = attributes.interrupt_kind(notes, self.declared(f.name))
        probe = attributes.wants_probe(notes, self.options.stack_check and not interrupt)
        if interrupt and (f.args or f.ret.kind != "void"):
            raise UnsupportedError("an interrupt function takes and returns nothing", self.declared(f.name))
        if attributes.NAKED in notes and attributes.hides_operands(f):
            what = f"a result or parameter of the naked function {f.name} that only assembly uses"
            raise UnsupportedError(f"{what}: remove its C statements", self.declared(f.name))
        if not self.options.debug:
            f.dbg_records = []
        bindings.bind(f, self.dwarf.info)
        taken = self.taken.get(f.name, set())
        return FunctionContext(self.module, self.dwarf.info, f, self.options, interrupt, taken, probe, notes)

    def _run_passes(self, c: FunctionContext) -> None:
        """Run the passes of the level; with `verify`, check the machine form after each."""
        verifier: Verifier | None = None
        try:
            for p in FUNCTION_PASSES:
                if self.options.level not in p.levels:
                    continue
                if "machine" in p.gives and self.options.verify:
                    verifier = Verifier(c.function)
                p.run(c)
                if verifier is not None:
                    verifier.check(p.name, c.m)
        except UnsupportedError as e:
            raise UnsupportedError(e.what, e.where or source_position(c.info, c.function, e.line)) from e

    def _emit(self, c: FunctionContext) -> None:
        """Append the instructions of a compiled function, and add its debug information to the module's."""
        f = c.function
        name = symbol(self.module, f.name)
        rows = LineTableRows(self.dwarf.info, f, name) if self.options.debug and f.dbg is not None else None
        ranges = LocationLists(str(self.serial))
        emitter = emit.FunctionEmitter(c.m, str(self.serial), self.options.large_code, self.dwarf.info.position)
        frames = call_frames.trace_frames(c.m, str(self.serial)) if self.options.debug else None
        self.lines += emitter.text(rows.mark if rows is not None else no_rows, ranges, frames)
        removed = c.taken - {b.name for b in c.m.blocks}  # no jump leads there, but code uses the addresses
        self.lines += [f"{block_label(f.name, block)}:" for block in sorted(removed)]
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
                objects, frozenset(record.variable for record in f.dbg_records if record.kind == "returned"),
            )  # fmt: skip
            self.dwarf.add_function(info)

    def header(self, f: Function, interrupt: str) -> None:
        """Append the directives of section, symbol and type. Each function has its own section for --gc-sections."""
        name = symbol(self.module, f.name)
        # sections `near` and `far` are ignored: -mlarge-code alone selects the form of calls
        own = "" if sections.attribute_section(f.section) else f.section
        section = own or (".isr.text." if interrupt else ".text.") + name
        modifiers = attributes.section_modifiers(self.notes.get(f.name, set()))
        keep = used.KEEP if f.name in self.used else ""
        self.lines.append(f"\t.section {section},code{modifiers}{keep}")
        self.lines.append("\t.align 2")
        if f.linkage in data.WEAK:
            self.lines.append(f"\t.weak {name}")
        elif f.linkage not in ("internal", "private"):
            self.lines.append(f"\t.global {name}")
        self.lines.append(f"\t.type {name},@function")
        self.lines.append(f"{name}:")
        for vector in attributes.vector_symbols(self.notes.get(f.name, set())):
            self.lines += [f"\t.global {vector}", f"{vector}:"]

    def aliases(self) -> None:
        """Append the definitions of aliases."""
        for name, target in self.module.aliases.items():
            s = symbol(self.module, name)
            image = data.InitialiserImage(self.module)
            text = image.expression(target)
            if text.startswith("handle("):
                text = text[len("handle(") : -1]
            self.lines.append(f"\t.global {s}")
            self.lines.append(f"\t.set {s},{text}")


def compile_module(ll_text: str, options: CompileOptions) -> str:
    """Translate the IR text of one module. Raise UnsupportedError with the construct and its source line."""
    try:
        module = read_module(ll_text)
    except UnsupportedError as e:
        raise UnsupportedError(e.what, position_in(ll_text, e.line) or e.where) from None
    return ModuleCompiler(module, options).run()


def position_in(ll_text: str, ref: str | None) -> str:
    """ "file:line" of a !dbg reference in IR text that has not been parsed, or ""."""
    found = DebugMetadata(Module(metadata=dict(METADATA.findall(ll_text)))).position(ref)
    return f"{found[0]}:{found[1]}" if found is not None else ""
