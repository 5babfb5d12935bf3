"""From a region to one LLVM function: the sequencer's rules (isa.md §7, §13) as control flow.

A block first asks whether all of it fits before the next deadline; if not it leaves, and the rest is stepped exactly.
So inside a block no event is due, nothing asynchronous happens, and every cycle is a constant or a choice of two.
Whatever is not native here (see `LlvmBuilder`) leaves with nothing of the instruction done.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.flow import Branch, Call, Flow, Goto, Repeat, Return, Skip
from emu.dspic30f.jit.builder import (
    DEADLINE,
    INTERPRET,
    MISS,
    NEXT,
    SERVICE,
    LlvmBuilder,
    NeedsInterpreter,
    Pending,
    Surroundings,
)
from emu.dspic30f.jit.region import Region, Step
from emu.dspic30f.jit.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.variables import MemoryVariables, Variables, pointer
from emu.dspic30f.state import IPL3, PC_MASK, RA
from emu.events import NEVER

DIVIDE_COUNT: Final = 17
"""RCOUNT of a divide: 18 iterations (isa.md §6.7)."""

PROLOGUE: Final = """declare i16 @llvm.fshl.i16(i16, i16, i16)
declare i16 @llvm.ctlz.i16(i16, i1)
declare i16 @llvm.cttz.i16(i16, i1)
declare i64 @llvm.umin.i64(i64, i64)
define i64 @entry(ptr noalias %rec, ptr noalias %env) {
"""
EPILOGUE: Final = "\n}\n!0 = !{!\"branch_weights\", i32 2000, i32 1}\n"


class Translator:
    """Translates one region under fixed circumstances.

    With `exact` every instruction can be entered and looks at the deadline before it runs; the registers stay in the
    record. Such code is compiled quickly and runs the few instructions up to the next event, or cold code.
    """

    def __init__(self, region: Region, around: Surroundings, context: Context, exact: bool) -> None:
        self._region: Final = region
        self._around: Final = around
        self._exact: Final = exact
        self._e: Final = Emitter()
        self._v: Final = (MemoryVariables if exact else Variables)(self._e, around.offset)
        self._b: Final = LlvmBuilder(self._e, self._v, around, context)
        self._b.dsp_region = any("OA" in step.insn.row.flags for step in region.steps.values())
        self._psv: Final = bool(context.psv)
        self._labels: dict[int, str] = {}
        self._todo: list[int] = []
        self._exits: dict[tuple[int, int], str] = {}

    def text(self) -> str:
        """The module."""
        e = self._e
        self._v.touch("pc", "stall", "cycle")
        steps = set(self._region.steps)
        for pc in sorted(steps if self._exact else self._region.leaders | ({self._around.do_end} & steps)):
            self._label(pc)
        while self._todo:
            self._block(self._todo.pop(0))
        entries = " ".join(f"i64 {pc}, label %{label}" for pc, label in self._labels.items())
        head = Emitter(e.last_name)
        head.start("first")
        here = head.load(pointer(head, self._around.offset["cpu.pc"]), 32)
        self._v.prologue(head)
        if not self._exact:
            head.line("%x.reason = alloca i64")
            head.line(f"store i64 {MISS}, ptr %x.reason")
        self._deadline(head)
        head.end(f"switch i64 {here.text}, label %exit [ {entries} ]")
        tail = Emitter(head.last_name)
        tail.start("exit")
        self._v.write_back(tail)
        reason = str(MISS) if self._exact else tail.let("load i64, ptr %x.reason").text
        tail.end(f"ret i64 {reason}")
        body = "\n".join(part.text() for part in (head, e, tail))
        return PROLOGUE + body + EPILOGUE

    def _deadline(self, head: Emitter) -> None:
        """%stop: no instruction may start in that cycle or later before somebody has looked (sequencer.py)."""
        due = head.load(pointer(head, self._around.offset["events.deadline"]), 64)
        limit = head.let("load i64, ptr %env, align 8")
        head.line(f"%before = call i64 @llvm.umin.i64(i64 {due.text}, i64 {NEVER - 2})")
        head.line("%behind = add i64 %before, 1")
        head.line(f"%stop = call i64 @llvm.umin.i64(i64 %behind, i64 {limit.text})")

    @property
    def entries(self) -> list[int]:
        """Program addresses at which the function can be entered."""
        return sorted(self._labels)

    # -- labels and exits -------------------------------------------------------------------------------------------
    def _label(self, pc: int) -> str:
        """Label of the block at `pc`; outside the region, of an exit that goes on there."""
        if pc not in self._region.steps:
            return self._exit(pc, NEXT)
        if pc not in self._labels:
            self._labels[pc] = f"b{pc:x}"
            self._todo.append(pc)
        return self._labels[pc]

    def _exit(self, pc: int, reason: int) -> str:
        """Label of a block that leaves for `reason` with PC = `pc`."""
        if (pc, reason) not in self._exits:
            label = f"out{reason}.{pc:x}"
            self._exits[pc, reason] = label
            current = self._e.block
            self._e.start(label)
            self._v.leave(pc, reason)
            self._e.block = current
        return self._exits[pc, reason]

    def _jump(self, pc: int) -> None:
        """Go on at `pc`; exact code hands over where better code may exist."""
        hand_over = self._exact and pc in self._region.leaders
        self._e.end(f"br label %{self._exit(pc, NEXT) if hand_over else self._label(pc)}")

    # -- blocks -----------------------------------------------------------------------------------------------------
    def _cost(self, pc: int) -> int:
        """Upper bound of the cycles of the block at `pc`, without REPEATs (they make their own check)."""
        total = 0
        first = True
        while (step := self._region.steps.get(pc)) is not None and (first or pc not in self._labels):
            first = False
            total += step.insn.row.cycles + (step.facts.source_pointers != 0)
            if self._psv and step.facts.loads:
                total += 2
            if step.facts.flow is not None:
                return total + 2
            pc = step.next_pc
        return total

    def _block(self, start: int) -> None:
        e, v = self._e, self._v
        e.start(self._labels[start])
        v.new_block()
        if self._exact:
            fits = e.let(f"icmp ult i64 {wide(v.get('cycle'))}, %stop", bit=True)
        else:
            fits = self._fits(self._cost(start))
        go = e.fresh("go")
        late = self._exit(start, SERVICE if self._exact else DEADLINE)
        e.end(f"br i1 {fits.text}, label %{go}, label %{late}, !prof !0")
        e.start(go)
        if start == self._around.do_end:
            again = e.fresh("again")
            left = e.load(pointer(e, self._around.offset["DCOUNT"]), 16)
            e.end(f"br i1 {truth(left)}, label %{again}, label %{self._exit(start, INTERPRET)}")
            e.start(again)
        written: Number = v.get("stall")
        pc = start
        while True:
            step = self._region.steps.get(pc)
            if step is None or (pc != start and pc in self._labels):
                self._jump(pc)
                return
            try:
                ended, written = self._instruction(step, written)
            except NeedsInterpreter:
                e.end(f"br label %{self._exit(pc, INTERPRET)}")
                self._label(step.next_pc)
                return
            if ended:
                return
            pc = step.next_pc

    def _fits(self, cost: Number) -> Value:
        """Whether `cost` cycles from now on end before the cycle of the deadline."""
        return self._e.let(f"icmp ult i64 {wide(self._v.get('cycle') + cost)}, %stop", bit=True)

    def _instruction(self, step: Step, written: Number) -> tuple[bool, Number]:
        """One instruction; returns whether the block ends and the W registers written on the destination side."""
        b, row = self._b, step.insn.row
        stall: Number = 0
        if step.facts.source_pointers:
            hit = written & step.facts.source_pointers
            stall = (1 if hit else 0) if isinstance(hit, int) else hit != 0
        psv_cycles = 1 if row.psv_class == "mov" else 2
        b.begin(step.pc, psv_cycles)
        flow = row.does(b, step.insn.x)  # type: ignore[arg-type]
        if isinstance(flow, Repeat):
            self._repeat(step, flow, stall)
            return True, 0
        if not isinstance(flow, (type(None), Goto, Branch, Call, Return, Skip)):
            raise NeedsInterpreter
        if isinstance(flow, Return) and flow.kind == "retfie":
            self._check_retfie(flow)
        if isinstance(flow, Skip) and step.target is None:
            raise NeedsInterpreter
        if self._exact and (b.pending.touches_sfr or isinstance(flow, Return)):  # an event within it would matter
            b.guard(self._fits(row.cycles + 1))
        b.commit()
        cycles: Number = row.cycles + stall
        if b.pending.psv:
            any_window = b.pending.psv[0]
            for other in b.pending.psv[1:]:
                any_window = any_window | other
            cycles = cycles + b.select(any_window, psv_cycles, 0)
        mask = step.facts.writes | b.pending.mapped
        if flow is None:
            self._advance(cycles, mask)
            if step.pc == self._around.do_end:
                self._loop_again()
                return True, mask
            if b.pending.stop:
                self._look(step.next_pc)
                return True, mask
            return False, mask
        self._flow(step, flow, cycles, mask)
        return True, mask

    def _loop_again(self) -> None:
        """The last instruction of a DO loop whose count is not used up (isa.md §7.6)."""
        e = self._e
        place = pointer(e, self._around.offset["DCOUNT"])
        e.store(place, e.load(place, 16) - 1, 16)
        self._jump(self._around.do_start)

    def _advance(self, cycles: Number, mask: int) -> None:
        self._v.set("cycle", self._v.get("cycle") + cycles)
        self._v.set("stall", mask)

    def _flow(self, step: Step, flow: Flow, cycles: Number, mask: int) -> None:
        e = self._e
        if isinstance(flow, (Branch, Skip)):
            taken, other = e.fresh("taken"), e.fresh("fall")
            self._advance(cycles, mask)
            e.end(f"br i1 {truth(flow.cond)}, label %{taken}, label %{other}")
            assert step.target is not None
            e.start(taken)
            self._v.new_block()
            extra = 1 if isinstance(flow, Branch) else (step.target - step.next_pc) // 2
            self._v.set("cycle", self._v.get("cycle") + extra)
            self._jump(step.target)
            e.start(other)
            self._jump(step.next_pc)
            return
        assert isinstance(flow, (Goto, Call, Return))
        self._advance(cycles, mask)
        if isinstance(flow.target, int):
            self._jump(flow.target)
            return
        self._v.leave(flow.target & PC_MASK, NEXT)

    # -- interrupts -------------------------------------------------------------------------------------------------
    def _requests(self) -> Value:
        """Truth of "some enabled interrupt is requested"."""
        e = self._e
        total: Number = 0
        for flags, enables in self._around.flag_words:
            total = total | (e.load(pointer(e, flags), 16) & e.load(pointer(e, enables), 16))
        assert isinstance(total, Value)
        return total != 0

    def _look(self, next_pc: int) -> None:
        """The instruction before may have made an interrupt acceptable: look if any is requested at all."""
        e = self._e
        e.end(f"br i1 {self._requests().text}, label %{self._exit(next_pc, SERVICE)}, label %{self._label(next_pc)}")

    def _check_retfie(self, flow: Return) -> None:
        """Native RETFIE: no trap level involved, no REPEAT to resume, nothing else requested (isa.md §14.3)."""
        b, e = self._b, self._e
        corcon = e.load(pointer(e, self._around.offset["CORCON"]), 16)
        traps = e.load(pointer(e, self._around.offset["INTCON1"]), 16) & self._around.trap_flags
        plain = ((flow.srl & RA) == 0) & (flow.ipl3 == 0) & (((corcon & IPL3) | traps) == 0)
        b.guard(plain & (self._requests() ^ 1))
        sr = b._sr_word()
        b.pending.sr = (sr & 0xFF00) | (flow.srl & 0xFF)

    # -- REPEAT -----------------------------------------------------------------------------------------------------
    def _repeat(self, step: Step, flow: Repeat, stall: Number) -> None:
        """REPEAT and its target as one unit, which must fit before the deadline as a whole (isa.md §7.5)."""
        e = self._e
        target = self._region.steps.get(step.next_pc)
        if target is None or not self._native_target(target):
            raise NeedsInterpreter
        count = flow.count
        if isinstance(count, Value):
            some, none = e.fresh("some"), e.fresh("none")
            e.end(f"br i1 {truth(count)}, label %{some}, label %{none}")
            e.start(none)
            self._repeat_none(step, stall)
            e.start(some)
            self._v.new_block()
        elif count == 0:
            self._repeat_none(step, stall)
            return
        again = int(target.facts.writes & target.facts.source_pointers != 0)
        cycles = target.insn.row.cycles
        total = stall + 1 + cycles * (count + 1) + again * count
        go, late = e.fresh("go"), self._exit(step.pc, INTERPRET if self._exact else DEADLINE)
        e.end(f"br i1 {self._fits(total).text}, label %{go}, label %{late}, !prof !0")
        e.start(go)
        self._advance(stall + 1, step.facts.writes)
        if count == DIVIDE_COUNT and target.insn.row.mnemonic.startswith("DIV"):
            self._divide(target)
        else:
            self._repeat_loop(target, count, cycles, again)
        e.store(pointer(e, self._around.offset["RCOUNT"]), 0, 16)
        self._jump(target.next_pc)

    def _native_target(self, target: Step) -> bool:
        """Whether an instruction can be repeated natively, found by translating it for nothing."""
        if target.facts.flow is not None or not target.insn.row.repeat_ok:
            return False
        scratch = Emitter()
        scratch.start("scratch")
        trial = LlvmBuilder(scratch, Variables(scratch, self._around.offset), self._around, self._b.context)
        trial.begin(target.pc, None)
        trial.repeating = (DIVIDE_COUNT, Value(scratch, "%left", False))
        try:
            target.insn.row.does(trial, target.insn.x)  # type: ignore[arg-type]
        except NeedsInterpreter:
            return False
        return not trial.pending.stop

    def _repeat_none(self, step: Step, stall: Number) -> None:
        """REPEAT #0 is a NOP that clears RCOUNT."""
        self._e.store(pointer(self._e, self._around.offset["RCOUNT"]), 0, 16)
        self._advance(stall + 1, step.facts.writes)
        self._jump(step.next_pc)

    def _divide(self, target: Step) -> None:
        """The 18 iterations of a divide: only the first (zero check) and last (result) do anything (isa.md §6.7)."""
        b = self._b
        b.begin(target.pc, None)
        b.repeating = (DIVIDE_COUNT, DIVIDE_COUNT)
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.pending = Pending()
        b.repeating = (DIVIDE_COUNT, 0)
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        b.repeating = None
        self._advance(DIVIDE_COUNT + 1, target.facts.writes)

    def _repeat_loop(self, target: Step, count: Number, cycles: int, again: int) -> None:
        """A counted loop around the target; an iteration that cannot be native leaves with RA and RCOUNT set."""
        e, v, b = self._e, self._v, self._b
        before, loop, done = e.fresh("before"), e.fresh("loop"), e.fresh("done")
        e.end(f"br label %{before}")
        e.start(before)
        e.end(f"br label %{loop}")
        e.start(loop)
        v.new_block()
        left = Value(e, e.name(), False)
        phi = len(e.block.lines)
        e.line("")
        block = e.block
        b.begin(target.pc, None)
        b.repeating = (count, left)
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        extra = b.select(left == count, 0, again) if again else 0
        b.repeating = None
        self._advance(cycles + extra, target.facts.writes | b.pending.mapped)
        fewer = left - 1
        more = left != 0
        edges = f"[ {wide_constant(count)}, %{before} ], [ {fewer.text}, %{e.block.label} ]"
        block.lines[phi] = f"{left.text} = phi i64 {edges}"
        e.end(f"br i1 {more.text}, label %{loop}, label %{done}")
        e.start(done)
        v.new_block()


def wide_constant(count: Number) -> str:
    """Operand text of a value that needs no conversion."""
    return str(count) if isinstance(count, int) else count.text
