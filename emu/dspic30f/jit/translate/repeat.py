"""REPEAT and its target, natively (isa.md §7.5).

In block code the two are one unit that must fit before the deadline: a bare counted loop. In exact code every
iteration is a boundary of its own, all loop state is in the record as the sequencer keeps it, and the loop can be
entered in the middle, after an interrupt.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emu.dspic30f.interpreter import flow_rules
from emu.dspic30f.isa.flow import Repeat
from emu.dspic30f.jit.exit_reasons import DEADLINE, SERVICE
from emu.dspic30f.jit.translate.builder import LlvmBuilder, NeedsInterpreter
from emu.dspic30f.jit.translate.deferred import Pending
from emu.dspic30f.jit.translate.region import Step
from emu.dspic30f.jit.translate.rule_emitter import LlvmWays
from emu.dspic30f.jit.translate.values import Emitter, Number, Value, wide
from emu.dspic30f.jit.translate.variables import MemoryVariables
from emu.dspic30f.state.state import RA

if TYPE_CHECKING:
    from emu.dspic30f.jit.translate.function import Translator

DIVIDE_COUNT: Final = 17
"""RCOUNT of a divide: 18 iterations (isa.md §6.7)."""


class Repeats:
    """Translates the REPEATs of one function."""

    def __init__(self, translator: Translator) -> None:
        self._t: Final = translator
        self.resumes: Final[dict[int, str]] = {}
        """Labels at which exact code goes on with a REPEAT target, by address of the target."""

    def translate(self, step: Step, flow: Repeat, stall: Number) -> None:
        """The REPEAT at `step`. Raises NeedsInterpreter before anything is emitted if its target is not native."""
        t, e = self._t, self._t.e
        target = t.region.steps.get(step.next_pc)
        if target is None or not self._is_native(target):
            raise NeedsInterpreter
        count, ways = flow.count, LlvmWays(e, begun=t.v.new_block)
        t.count.settle()
        if t.exact:
            ways.each(lambda m: flow_rules.repeat(m, t.around.flow, count),
                      lambda again: self._begin(step, target, stall, again))  # fmt: skip
            return
        for some in ways.branches(count) if isinstance(count, Value) else [count != 0]:
            if some:
                self._whole(step, target, count, stall)
            else:
                ways.all(lambda m: flow_rules.repeat(m, t.around.flow, 0))
                t.advance(stall + 1, step.facts.writes)
                t.jump(step.next_pc)

    def _is_native(self, target: Step) -> bool:
        """Whether an instruction can be repeated natively, found by translating it for nothing."""
        last_of_loop = target.pc == self._t.around.do_end
        if target.facts.flow is not None or not target.insn.row.repeat_ok or last_of_loop:
            return False
        if target.pc in self._t.around.hooks:  # an iteration is an arrival
            return False
        scratch = Emitter()
        scratch.start("scratch")
        t = self._t
        trial = LlvmBuilder(scratch, MemoryVariables(scratch, t.around.offset), t.around, t.b.context)
        trial.dsp_region = t.b.dsp_region
        trial.begin(target.pc, None)
        trial.repeating = Value(scratch, "%left", False)
        try:
            target.insn.row.does(trial, target.insn.x)  # type: ignore[arg-type]
        except NeedsInterpreter:
            return False
        return not trial.pending.stop

    # -- block code ---------------------------------------------------------------------------------------------------
    def _whole(self, step: Step, target: Step, count: Number, stall: Number) -> None:
        """All iterations at once, if they fit before the deadline."""
        t, e = self._t, self._t.e
        again = int(flow_rules.stall(target.facts.writes, target.facts.source_pointers))
        cycles = target.insn.row.cycles
        total = stall + 1 + cycles * (count + 1) + again * count
        go = e.fresh("go")
        e.end(f"br i1 {t.fits(total).text}, label %{go}, label %{t.exit(step.pc, DEADLINE)}, !prof !0")
        e.start(go)
        t.advance(stall + 1, step.facts.writes)
        t.at = target.pc
        if isinstance(count, int) and count == DIVIDE_COUNT and target.insn.row.mnemonic.startswith("DIV"):
            self._divide(target)
        else:
            self._loop(target, count, cycles, again)
        LlvmWays(e).store(t.around.flow.rcount, 0)
        t.jump(target.next_pc)

    def _divide(self, target: Step) -> None:
        """The 18 iterations of a divide: only the first (zero check) and last (result) do anything (isa.md §6.7)."""
        t, b = self._t, self._t.b
        b.begin(target.pc, None)
        b.left_count = b.repeating = DIVIDE_COUNT
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.pending = Pending()
        b.repeating = 0
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        b.repeating = b.left_count = None
        t.advance(DIVIDE_COUNT + 1, target.facts.writes)

    def _loop(self, target: Step, count: Number, cycles: int, again: int) -> None:
        """A counted loop; an iteration that cannot be native leaves with the REPEAT state as it is then."""
        t, e, b = self._t, self._t.e, self._t.b
        t.count.settle()
        before, loop, done = e.fresh("before"), e.fresh("loop"), e.fresh("done")
        e.end(f"br label %{before}")
        e.start(before)
        e.end(f"br label %{loop}")
        e.start(loop)
        t.v.new_block()
        left = Value(e, e.name(), False)
        phi, block = len(e.block.lines), e.block
        e.line("")
        b.begin(target.pc, None)
        b.repeating, b.left_count = left, count
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        extra = b.select(left == count, 0, again) if again else 0
        b.repeating = b.left_count = None
        t.advance(cycles + extra, target.facts.writes | b.pending.mapped)
        t.count.settle()
        fewer, more = left - 1, left != 0
        first = str(count) if isinstance(count, int) else count.text
        block.lines[phi] = f"{left.text} = phi i64 [ {first}, %{before} ], [ {fewer.text}, %{e.block.label} ]"
        e.end(f"br i1 {more.text}, label %{loop}, label %{done}")
        e.start(done)
        t.v.new_block()

    # -- exact code ---------------------------------------------------------------------------------------------------
    def _begin(self, step: Step, target: Step, stall: Number, again: bool) -> None:
        """The REPEAT instruction alone has run; then comes the loop of its target."""
        t, e = self._t, self._t.e
        t.advance(stall + 1, step.facts.writes)
        t.count.settle()
        if not again:
            t.jump(step.next_pc)
            return
        known = target.pc in self.resumes
        label = self.resumes.setdefault(target.pc, f"r{target.pc:x}")
        e.end(f"br label %{label}")
        if not known:
            self._iterations(target, label)

    def _iterations(self, target: Step, label: str) -> None:
        """One iteration after another, each a boundary; entered from REPEAT or from outside."""
        t, e, b, flow = self._t, self._t.e, self._t.b, self._t.around.flow
        e.start(label)
        t.v.new_block()
        early = e.let(f"icmp ult i64 {wide(t.v.get('cycle'))}, %stop", bit=True)
        go = e.fresh("go")
        e.end(f"br i1 {early.text}, label %{go}, label %{t.exit(target.pc, SERVICE)}")
        e.start(go)
        t.at = target.pc
        stall = flow_rules.stall(t.v.get("stall"), target.facts.source_pointers)
        ways = LlvmWays(e, begun=t.v.new_block)
        b.begin(target.pc, None)
        b.repeating = ways.get(flow.rcount)  # the target leaves it alone: it is not native else
        target.insn.row.does(b, target.insn.x)  # type: ignore[arg-type]
        b.commit()
        b.repeating = None
        t.advance(target.insn.row.cycles + stall, target.facts.writes | b.pending.mapped)
        t.count.settle()
        counting = ways.get(flow.sr) & RA

        def end(again: bool) -> None:
            if again:
                e.end(f"br label %{label}")
            else:
                t.jump(target.next_pc)

        ways.each(lambda m: flow_rules.repeated(m, flow, counting), end)
