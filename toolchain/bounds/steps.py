"""Abstract execution of single instructions: state, cycles, stack depth and masked levels."""

from __future__ import annotations

from typing import Final

from emu.dspic30f.isa.flow import Branch, Disi, Do, Flow, Repeat, Return, Skip, Sleep
from toolchain.bounds.abstract.state import INHERITED, LEVELS, AbstractState, widen
from toolchain.bounds.abstract.values import extremes
from toolchain.bounds.annotations.flow_facts import DO_LOOPS_TOO_DEEP, VARIABLE_FRAME
from toolchain.bounds.calling_contexts import CallContexts
from toolchain.bounds.graph import FunctionGraph, Instruction
from toolchain.bounds.result import FunctionResult
from toolchain.bounds.transfer import is_constant

BRANCH_CYCLES: Final[dict[type, int]] = {Branch: 1, Skip: 2, Return: -1}
"""Greatest additional cycles of a branch or skip; a return is one cycle shorter if an interrupt is pending
(isa.md §14.3)."""
DO_LEVELS: Final = 2
"""Nesting depth of DO loops that the core supports (isa.md §7.6)."""
REPEATED_WINDOW: Final = 4
"""Additional cycles of PSV window reads over all iterations of a REPEAT (isa.md §13.3)."""
REPEATS: Final = 600
"""Maximum number of iterations of REPEAT that are executed one by one; with more, only the cycles are counted."""


class InstructionExecution:
    """Executes the instructions of a function on abstract states."""

    def __init__(self, explorer: CallContexts, code: FunctionGraph) -> None:
        self.explorer, self.code = explorer, code
        self.area: Final = explorer.model.stack_areas
        self.result: Final = FunctionResult(visited={code.entry})
        self.floor = 0
        """Lowest stack address of the function's own frame."""

    def _step(self, step: Instruction, state: AbstractState) -> Flow:
        if state.repeat is not None:
            return self._execute_repeated(step, state)
        transfer = self.explorer.transfer
        level, top, start, blocked = state.ipl, state.w[15], state.time, state.disi_end
        state.time += step.cycles + (state.stall & step.pointers != 0)
        transfer.begin(step.pc, state)
        flow: Flow = step.insn.row.does(transfer, step.insn.x)
        transfer.commit()
        state.stall = step.writes
        if transfer.reads_window:
            state.time += step.window
        if transfer.unknown_store:
            self.result.unknown_store, transfer.unknown_store = True, False
        self._record_effects(step)
        if self.code.has_frame and is_constant(top) and not is_constant(state.w[15]):
            self.result.unbounded[step.pc] = VARIABLE_FRAME  # only functions without frame switch stacks
        self._record_stack_depth(state)
        match flow:
            case Repeat(count):
                state.repeat = count
            case Do(count, end):
                if len(state.do_loops) >= DO_LEVELS:
                    self.result.unbounded[step.pc] = DO_LOOPS_TOO_DEEP
                state.do_loops = (*state.do_loops, (step.after, end, count))
            case Sleep(mode):
                state.waits |= {step.pc}
                if mode == "sleep":
                    self.result.clock_stops.add(step.pc)
            case Disi(count):
                state.disi_end = max(state.disi_end, state.time + count + 1)
        taken = BRANCH_CYCLES.get(step.flow, 0) if step.flow is not None else 0
        self.result.longest_instruction = max(self.result.longest_instruction, state.time - start + taken)
        if level != state.ipl or blocked or state.disi_end:
            self._update_masking(state, step.pc)
        return flow

    def _execute_repeated(self, step: Instruction, state: AbstractState) -> Flow:
        """Execute the target of REPEAT; PSV reads stall in its first and last iteration (isa.md §7.5, §13.3)."""
        transfer, count = self.explorer.transfer, state.repeat
        state.repeat = None
        least, most = extremes(count)
        again = int(step.writes & step.pointers != 0)
        state.time += step.cycles + (state.stall & step.pointers != 0) + most * (step.cycles + again)
        window = False
        result: AbstractState | None = None
        current, level = state, state.ipl
        for turn in range(min(most, REPEATS) + 1):
            transfer.begin(step.pc, current)
            step.insn.row.does(transfer, step.insn.x)
            transfer.commit()
            window |= transfer.reads_window
            self.result.unknown_store |= transfer.unknown_store
            self._record_effects(step)
            self._record_stack_depth(current)
            if turn >= least and turn < most:
                result = current.copy() if result is None else self.area.join(result, current)
        if most > REPEATS:
            current = self._long_repeat(step, current, most)
        final = current if result is None else self.area.join(result, current)
        state.w, state.flags, state.mem = final.w, final.flags, final.mem
        state.regs, state.lowest_leak, state.ipl, state.do_loops = (
            final.regs,
            final.lowest_leak,
            final.ipl,
            final.do_loops,
        )
        state.stall = step.writes
        self.result.longest_instruction = max(
            self.result.longest_instruction, step.cycles + 1 + (REPEATED_WINDOW if window else 0)
        )
        if window:
            state.time += step.window if not most else max(step.window if not least else 0, REPEATED_WINDOW)
        if level != state.ipl or state.disi_end:
            self._update_masking(state, step.pc)
        return None

    def _long_repeat(self, step: Instruction, state: AbstractState, most: int) -> AbstractState:
        """Return the state after a REPEAT of more than REPEATS iterations: changed values become unknown."""
        before = state.copy()
        transfer = self.explorer.transfer
        for _ in range(2):
            transfer.begin(step.pc, state)
            step.insn.row.does(transfer, step.insn.x)
            transfer.commit()
        wide = widen(before, state)
        if not is_constant(wide.w[15]):
            self.result.unbounded[step.pc] = "pushes an unknown number of times"
        wide.mem = {
            a: v for a, v in wide.mem.items() if (a if a >= 0 else ~a) & ~1 in self.explorer.model.tracked_words
        }
        wide.lowest_leak = 0
        return wide

    def _record_effects(self, step: Instruction) -> None:
        """Record effects of an instruction that concern the whole function."""
        transfer = self.explorer.transfer
        if transfer.unbounded_reason is not None:
            self.result.unbounded[step.pc] = transfer.unbounded_reason
        self.result.reads_caller_stack |= transfer.lowest_stack_read < self.floor
        if transfer.disabled_nesting:
            self.result.nesting_disabled.add(step.pc)
            transfer.disabled_nesting = False
        if transfer.priority_change is not None:
            self.result.priority_changes[step.pc] = transfer.priority_change
            transfer.priority_change = None

    # -- measurements ------------------------------------------------------------------------------------------

    def _record_stack_depth(self, state: AbstractState) -> None:
        top = state.w[15]
        if not is_constant(top):
            if not self.area.points_into(top):
                return
            if self.code.has_frame:
                self.result.unbounded.setdefault(self.code.entry, VARIABLE_FRAME)
            top = extremes(top)[1]
        for number, (lo, hi) in enumerate(self.area.ranges):
            key = number, state.ipl[0]
            if lo <= top <= hi and top > self.result.peak.get(key, (-1,))[0]:
                self.result.peak[key] = top, (self.code.entry,)

    def _update_masking(self, state: AbstractState, pc: int) -> None:
        """Begin or end, at `pc`, the time for which interrupts of each level are masked."""
        blocked = state.disi_end > state.time
        if not blocked:
            state.disi_end = 0
        for level in range(1, LEVELS):
            since = state.masked_since[level]
            if state.ipl[1] >= level or (blocked and level < LEVELS - 1):
                if since is None:
                    state.masked_since[level] = state.time
            elif since is not None:
                if since == INHERITED:
                    FunctionResult.keep_longest(self.result.masked_prefix, level, state.time, pc)
                else:
                    FunctionResult.keep_longest(self.result.masked, level, state.time - since, pc)
                state.masked_since[level] = None
