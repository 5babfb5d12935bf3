"""Abstract execution of functions on all their inputs at once (Gustafsson et al., "Automatic derivation of loop bounds
and infeasible paths for WCET analysis using abstract execution", 2006).

States are joined where paths meet. The join has the greater time, so the time at a return is the worst case.
Loops are executed iteration by iteration.  This derives iteration counts from constants and excludes infeasible
branches and calls.  A loop whose state repeats runs for as many iterations as its annotation allows.
"""

from __future__ import annotations

from typing import Final

from emu.dspic30f.isa.flow import Branch, Call, Flow, Goto, Reset, Return, Skip
from toolchain.abi.target import RETURN_ADDRESS_BYTES
from toolchain.bounds.abstract.conditions import FlagResult, refine
from toolchain.bounds.abstract.state import AbstractState, widen
from toolchain.bounds.abstract.values import extremes, interval, key_of
from toolchain.bounds.annotations.flow_facts import (
    DO_LOOP_ENDS_WITH_JUMP,
    IRREGULAR_DO_LOOP,
    LONG_LOOP,
    MERGED_LOOPS,
    STACK_GROWS,
    UNBOUNDED_LOOP,
)
from toolchain.bounds.calling_contexts import CallContexts
from toolchain.bounds.calls import CallExecution
from toolchain.bounds.graph import BasicBlock, FunctionGraph, Instruction, Loop, OrderElement
from toolchain.bounds.result import FunctionResult, Scope
from toolchain.bounds.transfer import is_constant

MAX_ITERATIONS: Final = 5_000
NONTERMINATING_ITERATIONS: Final = 6
"""Maximum number of iterations executed of a loop that did not terminate in an earlier execution."""
TEST_ITERATION: Final = 32
"""Number of iterations after which a loop without annotation counts as endless, unless a value that changes decides
one of its branches."""
MAX_PUSHES: Final = 64
"""Maximum number of iterations of a loop that changes W15."""
MAX_STEPS: Final = 500_000
MAX_RETURN_BLOCK: Final = 12
"""Greatest number of instructions of a returning block that is executed once per incoming path."""


class BudgetExceededError(Exception):
    """The budget of abstract instructions (MAX_STEPS) is exhausted."""


class Explorer(CallContexts):
    """Abstract execution of the functions of one image."""

    def execute(self, code: FunctionGraph, state: AbstractState) -> FunctionResult:
        return _FunctionExecution(self, code).run(state)


class _FunctionExecution(CallExecution):
    """One abstract execution of a function: its loops and blocks in weak topological order."""

    def __init__(self, explorer: CallContexts, code: FunctionGraph) -> None:
        super().__init__(explorer, code)
        self.pending: dict[int, AbstractState] = {}
        self.merged: Final[set[int]] = set()
        """Heads of loops whose annotations do not apply (MERGED_LOOPS)."""
        self.source = code.entry
        """Address of the last instruction of the block that is executed."""
        self.edges: set[tuple[int, int]] = set()
        """Edges of the control-flow graph, as pairs of `source` and target, that the present loop iteration took."""

    def run(self, state: AbstractState) -> FunctionResult:
        self._record_stack_depth(state)
        self.floor = max(0, state.w[15] - RETURN_ADDRESS_BYTES) if is_constant(state.w[15]) else 0
        for lost in self.code.missing_instructions:
            self.result.unbounded[lost] = "no instruction is here"
        if self.code.entry in self.code.blocks:
            self.pending[self.code.entry] = state.copy()
            self._visit(self.code.order)
            self._add_shared_iterations()
        return self.result

    def _add_shared_iterations(self) -> None:
        """Add the iterations that loops share within this call, each at the cost of the longest."""
        result = self.result
        more = result.excluded_cycles(self.code.entry)
        result.shared_iterations = {
            scope: most for scope, most in result.shared_iterations.items() if scope[0] != self.code.entry
        }
        for end in result.return_states.values():
            end.shift(more)
        if result.switch_time is not None:
            result.switch_time += more

    def _visit(self, order: list[OrderElement]) -> None:
        for part in order:
            if isinstance(part, Loop):
                self._loop(part)
            else:
                state = self.pending.pop(part, None)
                if state is not None:
                    self._block(self.code.blocks[part], state)

    def _arrive(self, target: int, state: AbstractState) -> None:
        self.edges.add((self.source, target))
        block = self.code.blocks.get(target)
        if block is None:  # no instruction: `run` reports it
            return
        if block.steps[-1].flow is Return and len(block.steps) <= MAX_RETURN_BLOCK and target not in self.code.heads:
            self._block(block, state)  # states are not joined, so that return states stay separate by result
            return
        waiting = self.pending.get(target)
        if waiting is not None and self._enters_other_do_loop(target, waiting, state):
            self.result.unbounded[target] = IRREGULAR_DO_LOOP
        self.pending[target] = state if waiting is None else self.area.join(waiting, state)

    @staticmethod
    def _enters_other_do_loop(target: int, *paths: AbstractState) -> bool:
        """Whether paths that meet inside a DO loop are inside different DO loops."""
        one, other = ([(start, end) for start, end, _ in path.do_loops] for path in paths)
        return one != other and any(start <= target <= end for start, end in (*one, *other))

    # -- loops ---------------------------------------------------------------------------------------------------

    def _loop(self, loop: Loop) -> None:
        """Execute a loop iteration by iteration, until no path leads back or the annotated bound is reached."""
        explorer, pending = self.explorer, self.pending
        if loop.members.isdisjoint(pending):
            return
        bound, shared = self._annotated_bound(loop)
        hopeless = loop.head in explorer.nonterminating or (bound or 0) > MAX_ITERATIONS
        limit = NONTERMINATING_ITERATIONS if hopeless else MAX_ITERATIONS
        before: dict[int, AbstractState] = {}
        iterations = 0
        edges: set[tuple[int, int]] = set()
        while not loop.members.isdisjoint(pending):
            now = {head: pending[head] for head in loop.heads if head in pending}
            if now and before:
                if bound is not None and iterations > bound:
                    break
                if iterations > min(limit, MAX_PUSHES) and self._stack_grows(loop, before, now):
                    explorer.nonterminating.add(loop.head)
                    self._widen(before, now)
                elif iterations > limit:
                    if limit == MAX_ITERATIONS:
                        explorer.truncated.add(loop.head)
                    explorer.nonterminating.add(loop.head)
                    self._widen(before, now)
                elif iterations == TEST_ITERATION and bound is None and self._count_is_open(loop, before, now, edges):
                    explorer.nonterminating.add(loop.head)
                    self._widen(before, now)
                if shared is not None:
                    cycles = now[loop.head].time - before[loop.head].time
                    self.result.exclude_iteration(*shared, cycles)
                    now[loop.head].shift(-cycles)
                if {h: s.key() for h, s in now.items()} == {h: s.key() for h, s in before.items()}:
                    if bound is None:
                        explorer.nonterminating.add(loop.head)
                        self._record_endless_loop(loop, before, now)
                        break
                    if len(loop.heads) == 1:
                        self._add_iterations(before[loop.head], now[loop.head], bound - iterations)
                        iterations = bound
            before = {head: state.copy() for head, state in now.items()}
            edges = self._iterate(loop)
            iterations += 1
        for head in loop.heads:
            pending.pop(head, None)

    def _iterate(self, loop: Loop) -> set[tuple[int, int]]:
        """Execute one iteration of a loop from the pending states; return the edges that it took."""
        outer, self.edges = self.edges, set()
        if loop.head in self.pending:
            self._block(self.code.blocks[loop.head], self.pending.pop(loop.head))
        self._visit(loop.body)
        taken, self.edges = self.edges, outer | self.edges
        return taken

    def _count_is_open(
        self,
        loop: Loop,
        before: dict[int, AbstractState],
        now: dict[int, AbstractState],
        edges: set[tuple[int, int]],
    ) -> bool:
        """Whether no value that changes from iteration to iteration decides a branch of a loop.

        before, now  states at the head before and after the last iteration, which took `edges`

        If iterations from a state in which these values are unknown lead to the same state by the same edges, the
        values decide none of the branches, and executing more iterations would not find the loop's end.
        """
        if len(loop.heads) > 1 or loop.head not in before or loop.head not in now:
            return False
        trial = _FunctionExecution(self.explorer, self.code)
        trial.floor = self.floor
        state, after = before[loop.head], now[loop.head]
        for _ in range(NONTERMINATING_ITERATIONS):
            state = widen(state, after)
            trial.pending = {loop.head: state.copy()}
            taken = trial._iterate(loop)
            if loop.head not in trial.pending or taken != edges:
                return False
            after = trial.pending[loop.head]
            if after.key() == state.key():
                return True
        return False

    def _annotated_bound(self, loop: Loop) -> tuple[int | None, tuple[Scope, int] | None]:
        """Return the annotated bound of a loop, and the scope in which it shares iterations.

        Both are None if the loop may be two loops of the source.
        """
        explorer = self.explorer
        bound, total = (
            explorer.flow_facts.loop_bound(self.code, loop),
            explorer.flow_facts.total_iterations(self.code, loop),
        )
        shared = explorer.sharing_scope(self.code, loop, total)
        bounds = [most for most in (bound, total) if most is not None]
        if (bounds or shared is not None) and not explorer.flow_facts.is_single_loop(self.code, loop):
            self.merged.add(loop.head)
            return None, None
        return min(bounds, default=None), shared

    def _stack_grows(self, loop: Loop, before: dict[int, AbstractState], now: dict[int, AbstractState]) -> bool:
        """Record whether the last iteration has changed W15."""
        for head in before.keys() & now.keys():
            if key_of(before[head].w[15]) != key_of(now[head].w[15]):
                self.result.unbounded[loop.head] = STACK_GROWS
                return True
        return False

    def _widen(self, before: dict[int, AbstractState], now: dict[int, AbstractState]) -> None:
        """Widen the states at the loop heads against those of the previous iteration."""
        for head in before.keys() & now.keys():
            now[head] = self.pending[head] = widen(before[head], now[head])

    @staticmethod
    def _add_iterations(before: AbstractState, state: AbstractState, count: int) -> None:
        """Add `count` iterations like the one from `before` to `state`, which changed only the time."""
        cycles = (state.time - before.time) * count
        state.time += cycles
        if state.disi_end:
            state.disi_end += cycles
        for level, (was, now) in enumerate(zip(before.masked_since, state.masked_since, strict=True)):
            if was is not None and now is not None and was != now:
                state.masked_since[level] = now + cycles

    def _record_endless_loop(self, loop: Loop, before: dict[int, AbstractState], now: dict[int, AbstractState]) -> None:
        exits = any(t not in loop.members for m in loop.members for t in self.code.blocks[m].following)
        reiterations = any(self.code.blocks[m].steps[-1].flow is Return for m in loop.members)
        if exits or reiterations:
            truncated, merged = loop.head in self.explorer.truncated, loop.head in self.merged
            self.result.unbounded[loop.head] = MERGED_LOOPS if merged else LONG_LOOP if truncated else UNBOUNDED_LOOP
        else:
            self.result.endless_loops.add(loop.head)
            for head in before.keys() & now.keys():
                if not self.explorer.transfer.disabled(now[head]):
                    self._record_endless_masking(head, before[head], now[head])

    def _record_endless_masking(self, head: int, before: AbstractState, now: AbstractState) -> None:
        """Record levels that an endless loop keeps masked: their masked time grows with each iteration."""
        for level, (was, since) in enumerate(zip(before.masked_since, now.masked_since, strict=True)):
            if was is not None and since is not None and now.time - since > before.time - was:
                self.result.masked_for_ever[level] = head

    # -- instructions --------------------------------------------------------------------------------------------

    def _block(self, block: BasicBlock, state: AbstractState) -> None:
        """Execute a block and pass the resulting states to its successors."""
        explorer, outer = self.explorer, self.source
        self.source = block.steps[-1].pc
        explorer.steps += len(block.steps)
        if explorer.steps > MAX_STEPS:
            raise BudgetExceededError
        flow: Flow = None
        result: FlagResult | None = None
        rewritten = False
        for index, step in enumerate(block.steps):
            if index == block.flag_setter:
                before = state.w.copy()
                flow = self._step(step, state)
                result = FlagResult.of(step, before, state.w)
            else:
                flow = self._step(step, state)
            rewritten = explorer.transfer.overwrote_registers or (rewritten and not step.insn.row.flags)
        last = block.steps[-1]
        if last.pc in self.code.do_ends:
            if last.flow is not None:
                self.result.unbounded[last.pc] = DO_LOOP_ENDS_WITH_JUMP
            elif not state.do_loops or state.do_loops[-1][1] != last.pc:
                self.result.unbounded[last.pc] = IRREGULAR_DO_LOOP
        if state.do_loops and last.pc == state.do_loops[-1][1] and not isinstance(flow, Branch | Goto | Return):
            self._loop_end(state, last)
        else:
            self._follow(block, flow, state, None if rewritten else (result,))
        self.source = outer

    def _loop_end(self, state: AbstractState, last: Instruction) -> None:
        """Continue after the last instruction of a DO loop: repeat or leave it (isa.md §7.6)."""
        start, end, remaining = state.do_loops[-1]
        least, most = extremes(remaining)
        if most > 0:
            again = state.copy()
            again.do_loops = (*state.do_loops[:-1], (start, end, interval(max(least, 1) - 1, most - 1)))
            self._arrive(start, again)
        if least == 0:
            state.do_loops = state.do_loops[:-1]
            self._arrive(last.after, state)

    def _follow(
        self, block: BasicBlock, flow: Flow, state: AbstractState, compared: tuple[FlagResult | None] | None
    ) -> None:
        """Pass the state after a block to its successors.

        compared  the result that set the flags, for refinement by the branch condition; None if a store has changed
                  flags or registers since
        """
        last = block.steps[-1]
        match flow:
            case Branch(cond, target):
                if is_constant(cond):
                    state.time += int(cond)
                    self._arrive(target if cond else last.after, state)
                    return
                taken = state.copy()
                taken.time += 1
                if compared is None or refine(block.steps, taken, True, *compared):
                    self._arrive(target, taken)
                if compared is None or refine(block.steps, state, False, *compared):
                    self._arrive(last.after, state)
            case Skip(cond):
                if not is_constant(cond) or cond:
                    item = self.explorer.graph.items.get(last.after)
                    words = len(item.words) if item else 1
                    skipped = state.copy() if not is_constant(cond) else state
                    skipped.time += words
                    self._arrive(last.after + 2 * words, skipped)
                if not is_constant(cond) or not cond:
                    self._arrive(last.after, state)
            case Goto(target):
                self._goto(last, target, state)
            case Call(target):
                self._call(last, target, state)
            case Return(kind, target, srl, ipl3):
                if kind == "retfie":
                    self._restore_priority(state, srl, ipl3)
                self._return(target, state)
            case Reset():
                return
            case _:
                self._arrive(last.after, state)
