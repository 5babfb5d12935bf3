"""Translation of a region to one LLVM function: the rules of the sequencer (isa.md §7, §13) as control flow.

At its start, block code checks that the whole block ends before the next deadline. If it does not, the function returns
and exact code runs instead. So no event is due inside a block, and every cycle count in it is a constant or one of two.
For an instruction that is not native (see `LlvmBuilder`), native code leaves the function before any effect of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.builder import Context
from emu.dspic30f.isa.flow import PC_MASK, Branch, Call, ClearWatchdog, Disi, Flow, Goto, Repeat, Return, Skip, Sleep
from emu.dspic30f.jit.counters.cycle_counters import CycleCounter
from emu.dspic30f.jit.environment import ARRIVED, NOWHERE, RESUME
from emu.dspic30f.jit.exit_reasons import (
    ARRIVE,
    BOUNDARY_WORK,
    DEADLINE,
    HOOK,
    INTERPRET,
    MISS,
    MODES,
    NEXT,
    RETFIE,
)
from emu.dspic30f.jit.ir.builder import NeedsInterpreter
from emu.dspic30f.jit.ir.indirect_sfr import interrupt_requested
from emu.dspic30f.jit.ir.rule_emitter import AccessEmitter, LlvmRulePaths
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, truth, wide
from emu.dspic30f.jit.ir.variables import pointer
from emu.dspic30f.jit.machine_layout import MachineLayout
from emu.dspic30f.jit.translate.arrivals import ArrivalRecorder
from emu.dspic30f.jit.translate.frame import FunctionFrame
from emu.dspic30f.jit.translate.hook_filters import some_filter_holds
from emu.dspic30f.jit.translate.polling import empty_loops
from emu.dspic30f.jit.translate.region import Region, Step
from emu.dspic30f.jit.translate.repeat import RepeatTranslator
from emu.dspic30f.jit.translate.trace_block import TraceItem, taken_cost, trace_block
from emu.dspic30f.state.data_space import W_END
from emu.dspic30f.state.state import IDLE, IPL3, NOT_REPEATING
from emu.system.events import NEVER
from emu.system.rules import Rule

PROLOGUE: Final = """declare i16 @llvm.fshl.i16(i16, i16, i16)
declare i16 @llvm.ctlz.i16(i16, i1)
declare i16 @llvm.cttz.i16(i16, i1)
declare i64 @llvm.umin.i64(i64, i64)
define i64 @entry(ptr noalias %rec, ptr noalias %env) {
"""
EPILOGUE: Final = '\n}\n!0 = !{!"branch_weights", i32 2000, i32 1}\n!1 = !{}\n'
NATIVE_FLOWS: Final = (type(None), Goto, Branch, Call, Return, Skip, Disi, ClearWatchdog)
"""Flows that native code implements, in addition to Repeat and Sleep to Idle."""


class Translator(FunctionFrame):
    """Translates one region for one machine layout and one set of processor modes."""

    def __init__(
        self, region: Region, layout: MachineLayout, context: Context, exact: bool, counter: CycleCounter | None = None
    ) -> None:
        super().__init__(region, layout, context, exact, counter)
        self.b.dsp_region = any("OA" in step.insn.row.flags for step in region.steps.values())
        self._psv: Final = bool(context.psv)
        self._repeats: Final = RepeatTranslator(self)
        self._arrivals: Final = ArrivalRecorder(self)
        self._early_exception: Value | None = None
        """Whether an interrupt may be accepted before the third cycle of the return being translated."""
        self._polling: Final = {} if exact else empty_loops(region, layout, context)
        self._heads: Final = {loop.head for loop in self._polling.values()}
        self._polled: Final = {pc for loop in self._polling.values() for pc, _ in loop.costs}
        self._barriers: Final = set(region.steps) if exact else self._heads | set(layout.hooks)
        """Addresses at which a block must begin, because a deadline, polling loop or hook is checked there."""
        self._skipped: tuple[Step, ...] = ()
        """Instructions of the current block that the branch being translated skips."""
        self._jumps = False
        """Whether the block continues at the target of the jump being translated."""

    def text(self) -> str:
        """Return the LLVM IR of the region as a module."""
        self.v.touch("pc", "stall", "cycle")
        for pc in sorted(self.region.steps if self.exact else self.region.leaders):
            self.label(pc)
        while self.unwritten:
            self._block(self.unwritten.pop(0))
        head = self._entry_block()
        tail = Emitter(head.last_name)
        tail.start("exit")
        self.v.write_back(tail)
        reason = str(MISS) if self.exact else tail.let("load i64, ptr %x.reason").text
        tail.end(f"ret i64 {reason}")
        body = "\n".join(part.text() for part in (head, self.e, tail))
        return self.counter.definitions() + PROLOGUE + body + EPILOGUE

    def _entry_block(self) -> Emitter:
        """Return the first block, which loads the variables and dispatches on PC. It is generated last."""
        entries = " ".join(f"i64 {pc}, label %{label}" for pc, label in self.labels.items())
        head = Emitter(self.e.last_name)
        head.start("first")
        here = head.load(pointer(head, self.layout.offset["cpu.pc"]), 32)
        if self.exact:  # an odd address means: inside a REPEAT
            entries += "".join(f" i64 {pc + 1}, label %{label}" for pc, label in self._repeats.resumes.items())
            here = here + (head.load(pointer(head, self.layout.offset["cpu.repeat"]), 16) != NOT_REPEATING)
        self.v.prologue(head)
        if not self.exact:
            head.line("%x.reason = alloca i64")
            head.line(f"store i64 {MISS}, ptr %x.reason")
        for pc in sorted(self._heads):
            head.line(f"%passed.{pc:x} = alloca i1")
            head.line(f"store i1 false, ptr %passed.{pc:x}")
        self._deadline(head)
        self.counter.prologue(head)
        head.end(f"switch i64 {here.text}, label %exit [ {entries} ]")
        return head

    def _deadline(self, head: Emitter) -> None:
        """Define %stop: the first cycle in which no instruction may start before the boundary is handled."""
        due = head.load(pointer(head, self.layout.offset["events.deadline"]), 64)
        limit = head.let("load i64, ptr %env, align 8")
        head.line(f"%before = call i64 @llvm.umin.i64(i64 {due.text}, i64 {NEVER - 2})")
        head.line("%behind = add i64 %before, 1")
        head.line(f"%stop = call i64 @llvm.umin.i64(i64 %behind, i64 {limit.text})")

    @property
    def entries(self) -> list[int]:
        """Program addresses at which the function can be entered."""
        return sorted(self.labels)

    def _jump_back(self, back: int, pc: int) -> None:
        """End the block with a jump to `pc`.

        At the end of an empty loop that has run once, first skip all iterations except the last one that ends before
        the deadline.
        """
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
            for address, cycles in loop.costs:
                self.counter.add_cycles(address, skipped * cycles)
                self.counter.count_execution(address, skipped)
            self.counter.count_taken(back, skipped)
        self.jump(pc)

    # -- blocks -----------------------------------------------------------------------------------------------------
    def _cost(self, items: Sequence[TraceItem]) -> int:
        """Return an upper bound of a block's cycles, without REPEATs, which check the deadline themselves."""
        total = 0
        for item in items:
            total += self._most(item.step)
            if item.skipped:
                total += max(sum(map(self._most, item.skipped)), taken_cost(item.step))
            elif item.step.facts.flow is not None:
                total += 2
        return total

    def _most(self, step: Step) -> int:
        """Return an upper bound of the cycles of an instruction that has no flow or a branch that is not taken."""
        window = step.facts.window_cycles if self._psv and step.facts.loads else 0
        return step.insn.row.cycles + (step.facts.source_pointers != 0) + window

    def _block(self, start: int) -> None:
        e, v = self.e, self.v
        items = trace_block(self.region, start, self.labels, self._barriers, self.layout.do_end)
        e.start(self.labels[start])
        v.new_block()
        fits = self._block_fits(items)
        go = e.fresh("go")
        late = self.exit(start, BOUNDARY_WORK if self.exact else DEADLINE)
        e.end(f"br i1 {fits.text}, label %{go}, label %{late}, !prof !0")
        e.start(go)
        is_recorded = self._arrivals.prepare(items[0].step)
        if start in self.layout.hooks and not is_recorded:
            self._stop_for_hook(start)
        if self.exact:
            self.counter.begin_instruction(start)
        if start in self._heads:
            e.line(f"store i1 true, ptr %passed.{start:x}")
        written: Number = v.get("stall")
        for item in items:
            self._skipped, self._jumps = item.skipped, item.jumps
            try:
                ended, written = self._instruction(item.step, written)
            except NeedsInterpreter:
                self.counter.flush()
                e.end(f"br label %{self.exit(item.step.pc, INTERPRET)}")
                self.label(item.step.next_pc)
                return
            if ended:
                return
        self.jump(items[-1].next_pc)

    def _block_fits(self, items: Sequence[TraceItem]) -> Value:
        """Return whether the block, or in exact code its first instruction, may run before the deadline."""
        if not self.exact:
            return self.fits(self._cost(items))
        fits = self.e.let(f"icmp ult i64 {wide(self.v.get('cycle'))}, %stop", bit=True)
        arrived = self._arrived(items[0].step)
        return fits | arrived if isinstance(arrived, Value) else fits

    def _arrived(self, step: Step) -> Number:
        """Return whether the events due before this instruction's data access have fired.

        The check exists for one-cycle instructions that read an SFR by its address: a loop that waits for a flag often
        accesses it in the cycle of the event.
        """
        if step.insn.row.cycles != 1 or step.facts.flow not in (None, Skip) or step.pc in self.layout.hooks:
            return 0
        if not any(W_END <= address < self.layout.ram[0] for address in step.facts.reads):
            return 0
        return self.e.load(self._arrival(), 64) == self.v.get("cycle")

    def _arrival(self) -> str:
        word = self.e.name()
        self.e.line(f"{word} = getelementptr i64, ptr %env, i64 {ARRIVED}")
        return word

    def _arrive(self, step: Step, in_time: Value) -> None:
        """Leave native code unless `in_time` holds, so that the events due before the data access fire."""
        e, b = self.e, self.b
        ready, late = e.fresh("ready"), e.fresh("late")
        e.end(f"br i1 {in_time.text}, label %{ready}, label %{late}, !prof !0")
        e.start(late)
        b.before_slow()
        e.store(self._arrival(), b.now, 64)
        self.v.leave(step.pc, ARRIVE)
        e.start(ready)

    def _stop_for_hook(self, pc: int) -> None:
        """Leave native code before the hooked address `pc`, unless its hook was just called or no filter holds."""
        e, filters = self.e, self.layout.filters.get(pc)
        word, passes = e.name(), e.fresh("passes")
        e.line(f"{word} = getelementptr i64, ptr %env, i64 {RESUME}")
        hooked = e.load(word, 64)
        is_called = hooked == pc
        # also if no filter holds now: the next arrival in this run has not been seen
        e.line(f"store i64 {wide(e.select(is_called, NOWHERE, hooked))}, ptr {word}, align 1")
        if filters is not None:
            calls = e.fresh("calls")
            e.end(f"br i1 {truth(some_filter_holds(self, filters, calls))}, label %{calls}, label %{passes}")
            e.start(calls)
        e.end(f"br i1 {truth(is_called)}, label %{passes}, label %{self.exit(pc, HOOK)}")
        e.start(passes)

    # -- instructions -----------------------------------------------------------------------------------------------
    def _instruction(self, step: Step, written: Number) -> tuple[bool, Number]:
        """Translate one instruction. `written` is the set of W registers that the previous instruction wrote.

        Return whether the block has ended, and the W registers that this instruction writes on its destination side.
        """
        stall = flow_rules.stall(written, step.facts.source_pointers)
        start = self.v.get("cycle")
        self._prepare_builder(step, stall, start)
        flow: Flow = step.insn.row.does(self.b, step.insn.x)  # type: ignore[arg-type]
        if flow is not None and step.pc == self.layout.do_end:
            raise NeedsInterpreter  # undefined on silicon; the sequencer defines what happens here
        if isinstance(flow, Repeat):
            self._repeats.translate(step, flow, stall)
            return True, 0
        self._prepare_flow(step, flow)
        self._check_events(step, stall)
        self.b.commit()
        self._arrivals.record()
        cycles: Number = step.insn.row.cycles + stall + self.b.waited()
        if self.exact and isinstance(flow, Return):  # an event up to the second cycle may end the return there
            due = self.e.let(f"icmp uge i64 {wide(start + cycles - 2)}, %before", bit=True)
            self._early_exception = due if self._early_exception is None else due | self._early_exception
        mask = step.facts.writes | self.b.deferred.mapped_w
        if flow is None:
            return self._end_instruction(step, cycles, mask), mask
        if self._skipped:
            assert isinstance(flow, (Branch, Skip))
            return False, self._convert_branch(step, flow, cycles, mask)
        if self._jumps:
            self.advance(step.pc, cycles, mask)
            return False, mask
        self._flow(step, flow, cycles, mask)
        return True, mask

    def _prepare_builder(self, step: Step, stall: Number, start: Value) -> None:
        """Begin the instruction `step`, which starts in cycle `start`."""
        b, row = self.b, step.insn.row
        b.begin(step.pc, step.facts.window_cycles)
        b.now = start + stall + step.facts.access
        b.several_stores = step.facts.stores > 1
        b.loads_ahead = max(step.facts.loads - 1, 0)
        if step.pc not in self._polled:  # skipped iterations may not read state that changes with time
            b.reach = lambda waited: self.fits(row.cycles + stall + waited, start) if self.exact else 1

    def _prepare_flow(self, step: Step, flow: Flow) -> None:
        """Emit the checks and device rules of a flow before the instruction is committed.

        Raises NeedsInterpreter for a flow that is not native.
        """
        self._early_exception = None
        if isinstance(flow, Sleep) and flow.mode == "idle":
            self._apply_rule(self.layout.idle_rule)
            if self.exact:
                self.b.guard(self.fits(2))
        elif isinstance(flow, ClearWatchdog):
            self._apply_rule(self.layout.clrwdt_rule)
            self.b.deferred.touches_sfr = True
        elif not isinstance(flow, NATIVE_FLOWS) or (isinstance(flow, Skip) and step.target is None):
            raise NeedsInterpreter
        elif isinstance(flow, Return) and flow.kind == "retfie":
            self._check_retfie(flow)

    def _check_events(self, step: Step, stall: Number) -> None:
        """In exact code, leave before an SFR access if events are due by its cycle."""
        if not (self.exact and self.b.deferred.touches_sfr):
            return
        fits, arrived = self.fits(step.insn.row.cycles + stall), self._arrived(step)
        if isinstance(arrived, Value):
            self._arrive(step, fits | arrived)
        else:
            self.b.guard(fits)

    def _end_instruction(self, step: Step, cycles: Number, mask: int) -> bool:
        """End an instruction without flow. Return whether the block ends here too."""
        deferred = self.b.deferred
        self.advance(step.pc, cycles, mask)
        if deferred.sr is not None:
            self.counter.select_level()
        if step.pc == self.layout.do_end:
            self._end_of_loop(step)
            return True
        self.check_changes(step.pc, step.next_pc, self.counter.needs_check_after(deferred))
        if deferred.deadline_moved or deferred.check_interrupts:
            self._continue_after_effects(step.next_pc)
        else:
            self._leave_after_sfr_write(step.next_pc)
            return False
        return True

    def _continue_after_effects(self, pc: int) -> None:
        """Continue at `pc` after an instruction that may have moved the deadline or made an interrupt acceptable."""
        if self.b.deferred.deadline_moved:
            self.counter.flush()
            self.e.end(f"br label %{self.exit(pc, NEXT)}")
        elif self.b.deferred.check_interrupts:
            self._check_interrupts(pc)
        else:
            self._leave_after_sfr_write(pc)
            self.jump(pc)

    def _leave_after_sfr_write(self, pc: int) -> None:
        """Leave native code if the indirect store of the instruction has written an SFR."""
        written = self.b.deferred.sfr_written
        if written is not None:
            on = self.e.fresh("on")
            self.e.end(f"br i1 {written.text}, label %{self.exit(pc, NEXT)}, label %{on}")
            self.e.start(on)

    def _end_of_loop(self, step: Step) -> None:
        """End the instruction at DOEND.

        The sequencer handles EDT. At the end of the loop, native code leaves the function.
        """
        flow, check = self.layout.flow, self.counter.needs_check_after(self.b.deferred)
        self.counter.flush()

        def end(again: bool) -> None:
            self.check_changes(step.pc, self.layout.do_start if again else step.next_pc, check)
            if again:
                self._continue_after_effects(self.layout.do_start)
                return
            if self.b.deferred.check_interrupts:
                self.e.store(pointer(self.e, self.layout.offset["events.deadline"]), 0, 64)
            self.v.leave(step.next_pc, MODES)

        paths = LlvmRulePaths(self.e, {flow.edt: 0}, self.v.new_block)
        paths.each(lambda m: flow_rules.end_loop_iteration(m, flow), end)

    # -- flow -------------------------------------------------------------------------------------------------------
    def _convert_branch(self, step: Step, flow: Branch | Skip, cycles: Number, mask: int) -> Value:
        """Translate a branch over a few instructions so that both paths join in the block (if-conversion).

        Return the W registers written last on either path.
        """
        e, v, skipped = self.e, self.v, self._skipped
        taken, through, join = e.fresh("taken"), e.fresh("through"), e.fresh("join")
        self.advance(step.pc, cycles, mask)
        self.counter.flush()
        e.end(f"br i1 {truth(flow.cond)}, label %{taken}, label %{through}, !unpredictable !1")
        self._take(step, taken)
        self.counter.flush()
        e.end(f"br label %{join}")
        e.start(through)
        v.new_block()
        self._skipped, self._jumps = (), False
        written: Number = mask
        try:
            for one in skipped:
                ended, written = self._instruction(one, written)
                if ended:  # the instruction may have made an interrupt acceptable
                    break
            else:
                self.counter.flush()
                e.end(f"br label %{join}")
        except NeedsInterpreter:
            self.counter.flush()
            e.end(f"br label %{self.exit(one.pc, INTERPRET)}")
        e.start(join)
        v.new_block()
        return v.get("stall")

    def _take(self, step: Step, label: str) -> None:
        """Start the block of a taken branch or skip, and account for its additional cycles."""
        self.e.start(label)
        self.v.new_block()
        self.v.set("cycle", self.v.get("cycle") + taken_cost(step))
        self.counter.add_cycles(step.pc, taken_cost(step))
        if step.target != step.next_pc:  # whether a branch to the next instruction is taken makes no difference
            self.counter.count_taken(step.pc)

    def _flow(self, step: Step, flow: Flow, cycles: Number, mask: int) -> None:
        """Translate a flow that ends the block."""
        self.advance(step.pc, cycles, mask)
        if isinstance(flow, (Branch, Skip)):
            self._branch(step, flow)
            return
        self.counter.flush()
        match flow:
            case ClearWatchdog():
                self.jump(step.next_pc)
            case Disi(count):
                after = self.v.get("cycle")
                LlvmRulePaths(self.e).all(lambda m: flow_rules.execute_disi(m, self.layout.flow, count, after))
                self._check_interrupts(step.next_pc)
            case Sleep():
                self._idle(step)
            case Goto(target):
                self._go_to(step, target)
            case Call(target):
                self.counter.log_call(step.pc, target, self.v.get("W15") - 4, self.v.get("cycle"))
                self.check_changes(step.pc, target & PC_MASK, self.counter.needs_check_after(self.b.deferred))
                self._go_to(step, target)
            case Return():
                self._return(step, flow)
            case _:
                raise AssertionError(f"{flow} is not native")

    def _branch(self, step: Step, flow: Branch | Skip) -> None:
        """Translate a conditional branch or skip that ends the block."""
        e = self.e
        taken, other = e.fresh("taken"), e.fresh("fall")
        self.counter.flush()
        e.end(f"br i1 {truth(flow.cond)}, label %{taken}, label %{other}")
        assert step.target is not None
        self._take(step, taken)
        self._jump_back(step.pc, step.target)
        e.start(other)
        self.jump(step.next_pc)

    def _go_to(self, step: Step, target: Number) -> None:
        """Jump to a static target, or leave the function for a computed one."""
        if isinstance(target, int):
            self._jump_back(step.pc, target)
        else:
            self.v.leave(target & PC_MASK, NEXT)

    def _return(self, step: Step, flow: Return) -> None:
        """Leave the function for the return address.

        If an exception may be accepted after two cycles of the return, leave before the third: the boundary decides
        whether it happens.
        """
        e = self.e
        if self._early_exception is not None:
            some, none = e.fresh("some"), e.fresh("none")
            e.end(f"br i1 {self._early_exception.text}, label %{some}, label %{none}")
            e.start(some)
            if flow.kind == "retfie":
                e.store(pointer(e, self.layout.offset["events.deadline"]), 0, 64)
            cycle = self.v.get("cycle")
            self.v.set("cycle", cycle - 1)
            self.counter.subtract_third_cycle(step.pc)
            self.counter.log_return(step.pc, flow.target & PC_MASK, self.v.get("W15"), cycle - 1)
            self.v.leave(flow.target & PC_MASK, RETFIE)
            e.start(none)
            self.v.new_block()
        self.counter.log_return(step.pc, flow.target & PC_MASK, self.v.get("W15"), self.v.get("cycle"))
        self.v.leave(flow.target & PC_MASK, NEXT)

    # -- watchdog and Idle ------------------------------------------------------------------------------------------
    def _apply_rule(self, rule: Rule) -> None:
        """Emit the instruction's effect on devices by `rule`."""
        if rule.fires is None:
            raise NeedsInterpreter
        rule.fires(AccessEmitter(self.b), rule.operands)

    def _idle(self, step: Step) -> None:
        """Stop the CPU in Idle; the next boundary lets time pass."""
        e, offset = self.e, self.layout.offset
        e.store(pointer(e, offset["cpu.mode"]), IDLE, 16)
        e.store(pointer(e, offset["cpu.slept"]), self.v.get("cycle") - 1, 64)
        e.store(pointer(e, offset["events.deadline"]), 0, 64)
        check = self.counter.needs_check_after(self.b.deferred) | int(self.counter.checks_asleep)
        self.check_changes(step.pc, step.next_pc, check)
        e.end(f"br label %{self.exit(step.next_pc, BOUNDARY_WORK)}")

    # -- interrupts -------------------------------------------------------------------------------------------------
    def _check_interrupts(self, next_pc: int) -> None:
        """Leave native code for the boundary if an enabled interrupt is requested, else continue at `next_pc`."""
        e = self.e
        self.counter.flush()
        some = e.fresh("some")
        e.end(f"br i1 {interrupt_requested(e, self.layout).text}, label %{some}, label %{self.label(next_pc)}")
        e.start(some)
        e.store(pointer(e, self.layout.offset["events.deadline"]), 0, 64)
        e.end(f"br label %{self.exit(next_pc, BOUNDARY_WORK)}")

    def _check_retfie(self, flow: Return) -> None:
        """Leave RETFIE to the interpreter if a trap is active or requested (isa.md §14.3), else emit its rule."""
        b, e = self.b, self.e
        corcon = e.load(pointer(e, self.layout.offset["CORCON"]), 16)
        traps = e.load(pointer(e, self.layout.offset["INTCON1"]), 16) & self.layout.trap_flags
        plain = (flow.ipl3 == 0) & (((corcon & IPL3) | traps) == 0)
        b.guard(plain)
        self._early_exception = interrupt_requested(self.e, self.layout)
        flow_rules.execute_retfie(AccessEmitter(b), self.layout.flow, flow.srl & 0xFF, 0)
