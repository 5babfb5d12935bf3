"""Native code for REPEAT and its target (isa.md §7.5).

In block code, REPEAT and its target form a counted loop that must end before the deadline. In exact code, a boundary
follows every iteration, and the record holds the loop's state as the sequencer keeps it. Exact code can therefore enter
the loop in the middle, after an interrupt.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.flow import Repeat
from emu.dspic30f.isa.rows.multiply import DIVIDE_COUNT
from emu.dspic30f.jit.exit_reasons import BOUNDARY_WORK, DEADLINE
from emu.dspic30f.jit.ir.builder import LlvmBuilder, NeedsInterpreter
from emu.dspic30f.jit.ir.deferred import DeferredEffects
from emu.dspic30f.jit.ir.rule_emitter import LlvmRulePaths
from emu.dspic30f.jit.ir.values import Emitter, Number, Value, wide
from emu.dspic30f.jit.ir.variables import MemoryVariables
from emu.dspic30f.jit.translate.frame import FunctionFrame
from emu.dspic30f.jit.translate.region import Step
from emu.dspic30f.state.state import RA


class RepeatTranslator:
    """Translator of the REPEATs in one function."""

    def __init__(self, frame: FunctionFrame) -> None:
        self._f: Final = frame
        self.resumes: Final[dict[int, str]] = {}
        """Labels at which exact code continues a REPEAT, by the target's address."""

    def translate(self, step: Step, flow: Repeat, stall: Number) -> None:
        """Translate the REPEAT `step`.

        Raises NeedsInterpreter, before it emits anything, if the target is not native.
        """
        f, e = self._f, self._f.e
        target = f.region.steps.get(step.next_pc)
        if target is None or not self._is_native(target):
            raise NeedsInterpreter
        count, paths = flow.count, LlvmRulePaths(e, on_path=f.v.new_block)
        f.counter.flush()
        if f.exact:
            paths.each(lambda m: flow_rules.execute_repeat(m, f.layout.flow, count),
                       lambda again: self._begin(step, target, stall, again))  # fmt: skip
            return
        for some in paths.branches(count) if isinstance(count, Value) else [count != 0]:
            if some:
                self._whole_loop(step, target, count, stall)
            else:
                paths.all(lambda m: flow_rules.execute_repeat(m, f.layout.flow, 0))
                f.advance(step.pc, stall + 1, step.facts.writes)
                f.jump(step.next_pc)

    def _is_native(self, target: Step) -> bool:
        """Return whether an instruction can be repeated natively. To find out, translate it into a scratch block."""
        last_of_loop = target.pc == self._f.layout.do_end
        if target.facts.flow is not None or not target.insn.row.repeat_ok or last_of_loop:
            return False
        if target.pc in self._f.layout.hooks:  # Python must call the hook in every iteration
            return False
        scratch = Emitter()
        scratch.start("scratch")
        f = self._f
        trial = LlvmBuilder(scratch, MemoryVariables(scratch, f.layout.offset), f.layout, f.b.context)
        trial.dsp_region = f.b.dsp_region
        trial.begin(target.pc, None)
        trial.repeating = Value(scratch, "%left", False)
        try:
            target.insn.row.does(trial, target.insn.x)  # type: ignore[arg-type]
        except NeedsInterpreter:
            return False
        return not trial.deferred.check_interrupts

    # -- block code ---------------------------------------------------------------------------------------------------
    def _whole_loop(self, step: Step, target: Step, count: Number, stall: Number) -> None:
        """Emit code that runs all iterations at once if they end before the deadline."""
        f, e = self._f, self._f.e
        if f.counter.splits_repeats and target.facts.stores:
            e.end(f"br label %{f.exit(step.pc, DEADLINE)}")
            return
        again = int(flow_rules.stall(target.facts.writes, target.facts.source_pointers))
        cycles = target.insn.row.cycles
        total = stall + 1 + cycles * (count + 1) + again * count
        go = e.fresh("go")
        e.end(f"br i1 {f.fits(total).text}, label %{go}, label %{f.exit(step.pc, DEADLINE)}, !prof !0")
        e.start(go)
        f.advance(step.pc, stall + 1, step.facts.writes)
        if isinstance(count, int) and count == DIVIDE_COUNT and target.insn.row.mnemonic.startswith("DIV"):
            self._divide(target)
        else:
            self._counted_loop(target, count, cycles, again)
        LlvmRulePaths(e).store(f.layout.flow.rcount, 0)
        f.jump(target.next_pc)

    def _divide(self, target: Step) -> None:
        """Emit a divide. Of its 18 iterations, only the first (zero check) and the last (result) have an effect (isa.md
        §6.7)."""
        f, b = self._f, self._f.b
        b.begin(target.pc, None)
        b.left_count = b.repeating = DIVIDE_COUNT
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.deferred = DeferredEffects()
        b.repeating = 0
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        b.repeating = b.left_count = None
        f.advance(target.pc, DIVIDE_COUNT + 1, target.facts.writes, times=DIVIDE_COUNT + 1)

    def _counted_loop(self, target: Step, count: Number, cycles: int, again: int) -> None:
        """Emit a counted loop.

        For an iteration that cannot be native, it leaves with the REPEAT state of that iteration.
        """
        f, e, b = self._f, self._f.e, self._f.b
        f.counter.flush()
        before, loop, done = e.fresh("before"), e.fresh("loop"), e.fresh("done")
        e.end(f"br label %{before}")
        e.start(before)
        e.end(f"br label %{loop}")
        e.start(loop)
        f.v.new_block()
        left = Value(e, e.name(), False)
        phi, block = len(e.block.lines), e.block
        e.line("")
        b.begin(target.pc, None)
        b.repeating, b.left_count = left, count
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        stall = b.select(left == count, 0, again) if again else 0
        b.repeating = b.left_count = None
        f.advance(target.pc, cycles + stall, target.facts.writes | b.deferred.mapped_w)
        f.counter.flush()
        fewer, more = left - 1, left != 0
        first = str(count) if isinstance(count, int) else count.text
        block.lines[phi] = f"{left.text} = phi i64 [ {first}, %{before} ], [ {fewer.text}, %{e.block.label} ]"
        e.end(f"br i1 {more.text}, label %{loop}, label %{done}")
        e.start(done)
        f.v.new_block()

    # -- exact code ---------------------------------------------------------------------------------------------------
    def _begin(self, step: Step, target: Step, stall: Number, again: bool) -> None:
        """End the REPEAT instruction itself, then continue with the loop of its target."""
        f, e = self._f, self._f.e
        f.advance(step.pc, stall + 1, step.facts.writes)
        f.counter.flush()
        if not again:
            f.jump(step.next_pc)
            return
        known = target.pc in self.resumes
        label = self.resumes.setdefault(target.pc, f"r{target.pc:x}")
        e.end(f"br label %{label}")
        if not known:
            self._iterations(target, label)

    def _iterations(self, target: Step, label: str) -> None:
        """Emit a loop of single iterations, each followed by a boundary. REPEAT and callers enter it at `label`."""
        f, e, b, flow = self._f, self._f.e, self._f.b, self._f.layout.flow
        e.start(label)
        f.v.new_block()
        early = e.let(f"icmp ult i64 {wide(f.v.get('cycle'))}, %stop", bit=True)
        go = e.fresh("go")
        e.end(f"br i1 {early.text}, label %{go}, label %{f.exit(target.pc, BOUNDARY_WORK)}")
        e.start(go)
        f.counter.begin_instruction(target.pc)
        stall = flow_rules.stall(f.v.get("stall"), target.facts.source_pointers)
        paths = LlvmRulePaths(e, on_path=f.v.new_block)
        b.begin(target.pc, None)
        b.repeating = paths.get(flow.rcount)  # a native target does not change RCOUNT
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        b.repeating = None
        f.advance(target.pc, target.insn.row.cycles + stall, target.facts.writes | b.deferred.mapped_w)
        f.counter.flush()
        counting, check = paths.get(flow.sr) & RA, f.counter.needs_check_after(b.deferred)

        def end(again: bool) -> None:
            f.check_changes(target.pc, target.pc if again else target.next_pc, check)
            if again:
                e.end(f"br label %{label}")
            else:
                f.jump(target.next_pc)

        paths.each(lambda m: flow_rules.end_iteration(m, flow, counting), end)
