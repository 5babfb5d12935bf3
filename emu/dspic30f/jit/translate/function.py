"""From a region to one LLVM function: the sequencer's rules (isa.md §7, §13) as control flow.

A block first asks whether all of it fits before the next deadline; if not it leaves, and the rest is stepped exactly.
So inside a block no event is due, nothing asynchronous happens, and every cycle is a constant or a choice of two.
Whatever is not native here (see `LlvmBuilder`) leaves with nothing of the instruction done.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.flow import Branch, Call, ClearWatchdog, Disi, Flow, Goto, Repeat, Return, Skip, Sleep
from emu.dspic30f.jit.exit_reasons import (
    ARRIVE,
    DEADLINE,
    HOOK,
    INTERPRET,
    MISS,
    MODES,
    NEXT,
    RETFIE,
    SERVICE,
    Surroundings,
)
from emu.dspic30f.jit.translate.builder import LlvmBuilder, NeedsInterpreter
from emu.dspic30f.jit.translate.cycle_counters import Count
from emu.dspic30f.jit.translate.indirect_sfr import requested
from emu.dspic30f.jit.translate.polling import empty_loops
from emu.dspic30f.jit.translate.region import Region, Step
from emu.dspic30f.jit.translate.repeat import Repeats
from emu.dspic30f.jit.translate.rule_emitter import LlvmWays, NativeReader
from emu.dspic30f.jit.translate.trace_block import Part, course, extra
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.translate.variables import MemoryVariables, Variables, pointer
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.state import IDLE, IPL3, NOT_REPEATING, PC_MASK
from emu.system.events import NEVER
from emu.system.rules import Rule

RESUME: Final = 5
"""Word of the environment: the hooked address Python has just seen, or"""
NOWHERE: Final = -1
ARRIVED: Final = 10
"""Word of the environment: cycle in which an instruction begins before whose access all events have happened; on the
way there (`ARRIVE`) the cycle of the access."""
PROLOGUE: Final = """declare i16 @llvm.fshl.i16(i16, i16, i16)
declare i16 @llvm.ctlz.i16(i16, i1)
declare i16 @llvm.cttz.i16(i16, i1)
declare i64 @llvm.umin.i64(i64, i64)
define i64 @entry(ptr noalias %rec, ptr noalias %env) {
"""
EPILOGUE: Final = '\n}\n!0 = !{!"branch_weights", i32 2000, i32 1}\n!1 = !{}\n'


class Translator:
    """Translates one region under fixed circumstances.

    With `exact` every instruction can be entered and looks at the deadline before it runs; the registers stay in the
    record. Such code is compiled quickly and runs the few instructions up to the next event, or cold code.
    """

    def __init__(
        self, region: Region, around: Surroundings, context: Context, exact: bool, count: Count | None = None
    ) -> None:
        self.region: Final = region
        self.around: Final = around
        self.exact: Final = exact
        self.e: Final = Emitter()
        self.v: Final = (MemoryVariables if exact else Variables)(self.e, around.offset)
        self.b: Final = LlvmBuilder(self.e, self.v, around, context)
        self.count: Final[Count] = count if count is not None else Count()
        self.count.begin(self.e, around.offset)
        self.b.before_slow = self.count.carry
        self.at = 0
        """The instruction whose cycles pass."""
        self.b.dsp_region = any("OA" in step.insn.row.flags for step in region.steps.values())
        self._psv: Final = bool(context.psv)
        self._repeats: Final = Repeats(self)
        self._labels: dict[int, str] = {}
        self._todo: list[int] = []
        self._exits: dict[tuple[object, ...], str] = {}
        self._unsure: Value | None = None
        """Whether an interrupt may be accepted in front of the third cycle of the return being translated."""
        self._polling: Final = {} if exact else empty_loops(region, around, context)
        self._heads: Final = {loop.head for loop in self._polling.values()}
        self._polled: Final = {pc for loop in self._polling.values() for pc, _ in loop.costs}
        self._apart: Final = set(region.steps) if exact else self._heads | set(around.hooks)
        """Instructions before which something is looked at: the deadline, that an empty loop begins, a hook."""
        self._arm: tuple[Step, ...] = ()
        """What the branch being translated goes round within its block."""

    def text(self) -> str:
        """The module."""
        e = self.e
        self.v.touch("pc", "stall", "cycle")
        steps = set(self.region.steps)
        for pc in sorted(steps if self.exact else self.region.leaders):
            self._label(pc)
        while self._todo:
            self._block(self._todo.pop(0))
        entries = " ".join(f"i64 {pc}, label %{label}" for pc, label in self._labels.items())
        head = Emitter(e.last_name)
        head.start("first")
        here = head.load(pointer(head, self.around.offset["cpu.pc"]), 32)
        if self.exact:  # odd: in the middle of a REPEAT
            entries += "".join(f" i64 {pc + 1}, label %{label}" for pc, label in self._repeats.resumes.items())
            here = here + (head.load(pointer(head, self.around.offset["cpu.repeat"]), 16) != NOT_REPEATING)
        self.v.prologue(head)
        if not self.exact:
            head.line("%x.reason = alloca i64")
            head.line(f"store i64 {MISS}, ptr %x.reason")
        for pc in sorted(self._heads):
            head.line(f"%passed.{pc:x} = alloca i1")
            head.line(f"store i1 false, ptr %passed.{pc:x}")
        self._deadline(head)
        self.count.head(head)
        head.end(f"switch i64 {here.text}, label %exit [ {entries} ]")
        tail = Emitter(head.last_name)
        tail.start("exit")
        self.v.write_back(tail)
        reason = str(MISS) if self.exact else tail.let("load i64, ptr %x.reason").text
        tail.end(f"ret i64 {reason}")
        body = "\n".join(part.text() for part in (head, e, tail))
        return PROLOGUE + body + EPILOGUE

    def _deadline(self, head: Emitter) -> None:
        """%stop: no instruction may start in that cycle or later before somebody has looked (sequencer.py)."""
        due = head.load(pointer(head, self.around.offset["events.deadline"]), 64)
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
        if pc not in self.region.steps:
            return self.exit(pc, NEXT)
        if pc not in self._labels:
            self._labels[pc] = f"b{pc:x}"
            self._todo.append(pc)
        return self._labels[pc]

    def exit(self, pc: int, reason: int) -> str:
        """Label of a block that leaves for `reason` with PC = `pc`."""
        key = (pc, reason, *self.count.unsettled)
        if key not in self._exits:
            label = f"out{reason}.{pc:x}" + (f".{len(self._exits)}" if len(key) > 2 else "")
            self._exits[key] = label
            current = self.e.block
            self.e.start(label)
            self.count.carry()
            self.v.leave(pc, reason)
            self.e.block = current
        return self._exits[key]

    def jump(self, pc: int) -> None:
        """Go on at `pc`; exact code hands over where better code may exist."""
        self.count.settle()
        hand_over = self.exact and pc in self.region.leaders
        self.e.end(f"br label %{self.exit(pc, NEXT) if hand_over else self._label(pc)}")

    def _jump_back(self, back: int, pc: int) -> None:
        """Go on at `pc`. From the end of an empty loop that has been run once, skip the iterations before the last one
        that ends before the deadline."""
        loop = self._polling.get(back)
        if loop is not None:
            e = self.e
            passed = e.let(f"load i1, ptr %passed.{loop.head:x}", bit=True)
            cycle = self.v.get("cycle")
            left = e.let(f"sub i64 %stop, {cycle.text}")
            whole = e.let(f"sdiv i64 {left.text}, {loop.cycles}") - 1
            some = passed & (whole > 0)
            skipped = self.b.select(some, whole, 0)
            self.v.set("cycle", cycle + skipped * loop.cycles)
            for place, cycles in loop.costs:
                self.count.spend(place, skipped * cycles)
        self.jump(pc)

    # -- blocks -----------------------------------------------------------------------------------------------------
    def _cost(self, parts: Sequence[Part]) -> int:
        """Upper bound of the cycles of a block, without REPEATs (they make their own check)."""
        total = 0
        for part in parts:
            total += self._most(part.step)
            if part.arm:
                total += max(sum(map(self._most, part.arm)), extra(part.step))
            elif part.step.facts.flow is not None:
                total += 2
        return total

    def _most(self, step: Step) -> int:
        """Upper bound of an instruction's cycles, if it is no flow or one that is not taken."""
        window = step.facts.window_cycles if self._psv and step.facts.loads else 0
        return step.insn.row.cycles + (step.facts.source_pointers != 0) + window

    def _block(self, start: int) -> None:
        e, v = self.e, self.v
        parts = course(self.region, start, self._labels, self._apart, self.around.do_end)
        e.start(self._labels[start])
        v.new_block()
        if self.exact:
            fits = e.let(f"icmp ult i64 {wide(v.get('cycle'))}, %stop", bit=True)
            arrived = self._arrived(parts[0].step)
            fits = fits | arrived if isinstance(arrived, Value) else fits
        else:
            fits = self.fits(self._cost(parts))
        go = e.fresh("go")
        late = self.exit(start, SERVICE if self.exact else DEADLINE)
        e.end(f"br i1 {fits.text}, label %{go}, label %{late}, !prof !0")
        e.start(go)
        if start in self.around.hooks:
            self._stop_for_hook(start)
        if start in self._heads:
            e.line(f"store i1 true, ptr %passed.{start:x}")
        written: Number = v.get("stall")
        for part in parts:
            self._arm = part.arm
            try:
                ended, written = self._instruction(part.step, written)
            except NeedsInterpreter:
                self.count.settle()
                e.end(f"br label %{self.exit(part.step.pc, INTERPRET)}")
                self._label(part.step.next_pc)
                return
            if ended:
                return
        self.jump(part.next_pc)

    def _arrived(self, step: Step) -> Number:
        """Truth of "what is due before the access of this instruction has happened". It is asked for those that read a
        register by address, in one cycle: waiting for a flag hits the cycle of its event often."""
        if step.insn.row.cycles != 1 or step.facts.flow not in (None, Skip) or step.pc in self.around.hooks:
            return 0
        if not any(W_END <= address < self.around.ram[0] for address in step.facts.reads):
            return 0
        return self.e.load(self._arrival(), 64) == self.v.get("cycle")

    def _arrival(self) -> str:
        place = self.e.name()
        self.e.line(f"{place} = getelementptr i64, ptr %env, i64 {ARRIVED}")
        return place

    def _arrive(self, step: Step, in_time: Value) -> None:
        """Leave unless `in_time`, to have happen what is due before the access."""
        e, b = self.e, self.b
        ready, late = e.fresh("ready"), e.fresh("late")
        e.end(f"br i1 {in_time.text}, label %{ready}, label %{late}, !prof !0")
        e.start(late)
        b.before_slow()
        e.store(self._arrival(), b.now, 64)
        self.v.leave(step.pc, ARRIVE)
        e.start(ready)

    def _stop_for_hook(self, pc: int) -> None:
        """Python is to see that `pc` is reached, unless it has just done so."""
        e = self.e
        place, seen = e.name(), e.fresh("seen")
        e.line(f"{place} = getelementptr i64, ptr %env, i64 {RESUME}")
        hooked = e.load(place, 64)
        e.end(f"br i1 {truth(hooked == pc)}, label %{seen}, label %{self.exit(pc, HOOK)}")
        e.start(seen)
        e.line(f"store i64 {NOWHERE}, ptr {place}, align 1")

    def fits(self, cost: Number, start: Number | None = None) -> Value:
        """Whether `cost` cycles from `start` (now) on end before the cycle of the deadline."""
        begun = self.v.get("cycle") if start is None else start
        return self.e.let(f"icmp ult i64 {wide(begun + cost)}, %stop", bit=True)

    def _instruction(self, step: Step, written: Number) -> tuple[bool, Number]:
        """One instruction; returns whether the block ends and the W registers written on the destination side."""
        b, row = self.b, step.insn.row
        stall = flow_rules.stall(written, step.facts.source_pointers)
        b.begin(step.pc, step.facts.window_cycles)
        self.at = step.pc
        start = self.v.get("cycle")
        b.now = start + stall + step.facts.access
        b.several_stores = step.facts.stores > 1
        b.loads_ahead = max(step.facts.loads - 1, 0)
        if step.pc not in self._polled:  # iterations that are skipped may not read what time changes
            b.reach = lambda waited: self.fits(row.cycles + stall + waited, start) if self.exact else 1
        flow = row.does(b, step.insn.x)  # type: ignore[arg-type]
        if flow is not None and step.pc == self.around.do_end:
            raise NeedsInterpreter  # undefined on silicon; the sequencer says what happens here
        if isinstance(flow, Repeat):
            self._repeats.translate(step, flow, stall)
            return True, 0
        if isinstance(flow, Sleep) and flow.mode == "idle":
            self._read(self.around.idling)
            if self.exact:
                b.guard(self.fits(2))
        elif isinstance(flow, ClearWatchdog):
            self._read(self.around.clearing)
            b.pending.touches_sfr = True
        elif not isinstance(flow, (type(None), Goto, Branch, Call, Return, Skip, Disi)):
            raise NeedsInterpreter
        self._unsure = None
        if isinstance(flow, Return) and flow.kind == "retfie":
            self._check_retfie(flow)
        if isinstance(flow, Skip) and step.target is None:
            raise NeedsInterpreter
        if self.exact and b.pending.touches_sfr:  # an event up to the access would matter
            fits, arrived = self.fits(row.cycles + stall), self._arrived(step)
            if isinstance(arrived, Value):
                self._arrive(step, fits | arrived)
            else:
                b.guard(fits)
        b.commit()
        cycles: Number = row.cycles + stall + b.waited()
        if self.exact and isinstance(flow, Return):  # an event up to the second cycle may end it there
            due = self.e.let(f"icmp uge i64 {wide(start + cycles - 2)}, %before", bit=True)
            self._unsure = due if self._unsure is None else due | self._unsure
        mask = step.facts.writes | b.pending.mapped
        if flow is None:
            self.advance(cycles, mask)
            if b.pending.sr is not None:
                self.count.level_changed()
            if step.pc == self.around.do_end:
                self._end_of_loop(step)
            elif b.pending.replanned or b.pending.stop:
                self._behind(step.next_pc)
            else:
                self._leave_behind_register(step.next_pc)
                return False, mask
            return True, mask
        if self._arm:
            assert isinstance(flow, (Branch, Skip))
            return False, self._round(step, flow, cycles, mask)
        self._flow(step, flow, cycles, mask)
        return True, mask

    def _behind(self, pc: int) -> None:
        """Go on at `pc` behind an instruction without flow, which may have asked for attention."""
        if self.b.pending.replanned:
            self.count.settle()
            self.e.end(f"br label %{self.exit(pc, NEXT)}")
        elif self.b.pending.stop:
            self._look(pc)
        else:
            self._leave_behind_register(pc)
            self.jump(pc)

    def _leave_behind_register(self, pc: int) -> None:
        """If an instruction without flow has written a register by pointer."""
        if self.b.pending.left is not None:
            on = self.e.fresh("on")
            self.e.end(f"br i1 {self.b.pending.left.text}, label %{self.exit(pc, NEXT)}, label %{on}")
            self.e.start(on)

    def _end_of_loop(self, step: Step) -> None:
        """The instruction at DOEND. EDT is the sequencer's; who leaves the loop leaves its translation."""
        flow = self.around.flow
        self.count.settle()

        def end(again: bool) -> None:
            if again:
                self._behind(self.around.do_start)
                return
            if self.b.pending.stop:
                self.e.store(pointer(self.e, self.around.offset["events.deadline"]), 0, 64)
            self.v.leave(step.next_pc, MODES)

        LlvmWays(self.e, {flow.edt: 0}, self.v.new_block).each(lambda m: flow_rules.loop_again(m, flow), end)

    def advance(self, cycles: Number, mask: int) -> None:
        self.v.set("cycle", self.v.get("cycle") + cycles)
        self.v.set("stall", mask)
        self.count.spend(self.at, cycles)

    def _round(self, step: Step, flow: Branch | Skip, cycles: Number, mask: int) -> Value:
        """A branch round `_arm`, both ways to its end; the W registers written last, on either."""
        e, v, arm = self.e, self.v, self._arm
        taken, through, join = e.fresh("taken"), e.fresh("through"), e.fresh("join")
        self.advance(cycles, mask)
        self.count.settle()
        e.end(f"br i1 {truth(flow.cond)}, label %{taken}, label %{through}, !unpredictable !1")
        e.start(taken)
        v.new_block()
        v.set("cycle", v.get("cycle") + extra(step))
        self.count.spend(step.pc, extra(step))
        self.count.settle()
        e.end(f"br label %{join}")
        e.start(through)
        v.new_block()
        self._arm = ()
        written: Number = mask
        try:
            for one in arm:
                ended, written = self._instruction(one, written)
                if ended:  # it may have made an interrupt acceptable
                    break
            else:
                self.count.settle()
                e.end(f"br label %{join}")
        except NeedsInterpreter:
            self.count.settle()
            e.end(f"br label %{self.exit(self.at, INTERPRET)}")
        e.start(join)
        v.new_block()
        return v.get("stall")

    def _flow(self, step: Step, flow: Flow, cycles: Number, mask: int) -> None:
        e = self.e
        if isinstance(flow, (Branch, Skip)):
            taken, other = e.fresh("taken"), e.fresh("fall")
            self.advance(cycles, mask)
            self.count.settle()
            e.end(f"br i1 {truth(flow.cond)}, label %{taken}, label %{other}")
            assert step.target is not None
            e.start(taken)
            self.v.new_block()
            self.v.set("cycle", self.v.get("cycle") + extra(step))
            self.count.spend(step.pc, extra(step))
            self._jump_back(step.pc, step.target)
            e.start(other)
            self.jump(step.next_pc)
            return
        self.advance(cycles, mask)
        self.count.settle()
        if isinstance(flow, ClearWatchdog):
            self.jump(step.next_pc)
            return
        if isinstance(flow, Disi):
            count, after = flow.count, self.v.get("cycle")
            LlvmWays(e).all(lambda m: flow_rules.disi(m, self.around.flow, count, after))
            self._look(step.next_pc)
            return
        assert isinstance(flow, (Goto, Call, Return, Sleep))
        if isinstance(flow, Sleep):
            self._idle(step.next_pc)
            return
        if isinstance(flow, Call):
            self.count.called(step.pc, flow.target, self.v.get("W15") - 4, self.v.get("cycle"))
        if isinstance(flow.target, int):
            self._jump_back(step.pc, flow.target)
            return
        if isinstance(flow, Return):
            self._leave_if_unsure(step, flow)
            self.count.returned(step.pc, flow.target & PC_MASK, self.v.get("W15"), self.v.get("cycle"))
        self.v.leave(flow.target & PC_MASK, NEXT)

    def _leave_if_unsure(self, step: Step, flow: Return) -> None:
        """A return ends after two cycles if an interrupt is accepted then: the boundary decides."""
        e = self.e
        if self._unsure is None:
            return
        some, none = e.fresh("some"), e.fresh("none")
        e.end(f"br i1 {self._unsure.text}, label %{some}, label %{none}")
        e.start(some)
        if flow.kind == "retfie":
            e.store(pointer(e, self.around.offset["events.deadline"]), 0, 64)
        cycle = self.v.get("cycle")
        self.v.set("cycle", cycle - 1)
        self.count.shortened(step.pc)
        self.count.returned(step.pc, flow.target & PC_MASK, self.v.get("W15"), cycle - 1)
        self.v.leave(flow.target & PC_MASK, RETFIE)
        e.start(none)
        self.v.new_block()

    # -- watchdog and Idle ------------------------------------------------------------------------------------------
    def _read(self, rule: Rule) -> None:
        """What the devices do with the instruction."""
        if rule.fires is None:
            raise NeedsInterpreter
        rule.fires(NativeReader(self.b), rule.places)

    def _idle(self, next_pc: int) -> None:
        """The CPU stops; the boundary behind lets time pass."""
        e, offset = self.e, self.around.offset
        e.store(pointer(e, offset["cpu.mode"]), IDLE, 16)
        e.store(pointer(e, offset["cpu.slept"]), self.v.get("cycle") - 1, 64)
        e.store(pointer(e, offset["events.deadline"]), 0, 64)
        e.end(f"br label %{self.exit(next_pc, SERVICE)}")

    # -- interrupts -------------------------------------------------------------------------------------------------
    def _look(self, next_pc: int) -> None:
        """The instruction before may have made an interrupt acceptable: look if any is requested at all."""
        e = self.e
        self.count.settle()
        some = e.fresh("some")
        e.end(f"br i1 {requested(e, self.around).text}, label %{some}, label %{self._label(next_pc)}")
        e.start(some)
        e.store(pointer(e, self.around.offset["events.deadline"]), 0, 64)
        e.end(f"br label %{self.exit(next_pc, SERVICE)}")

    def _check_retfie(self, flow: Return) -> None:
        """Native RETFIE: no trap level involved (isa.md §14.3)."""
        b, e = self.b, self.e
        corcon = e.load(pointer(e, self.around.offset["CORCON"]), 16)
        traps = e.load(pointer(e, self.around.offset["INTCON1"]), 16) & self.around.trap_flags
        plain = (flow.ipl3 == 0) & (((corcon & IPL3) | traps) == 0)
        b.guard(plain)
        self._unsure = requested(self.e, self.around)
        flow_rules.resume(NativeReader(b), self.around.flow, flow.srl & 0xFF, 0)
