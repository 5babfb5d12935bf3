"""Instructions on sets of values: what each does to a state, its time, the stack's peak and the levels held back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emu.dspic30f.isa.flow import Branch, Disi, Do, Flow, Repeat, Return, Skip, Sleep
from toolchain.bounds.abstract.state import INHERITED, LEVELS, State, widened
from toolchain.bounds.abstract.values import ends
from toolchain.bounds.annotations.rules import MOVED, NESTED
from toolchain.bounds.builder import exact
from toolchain.bounds.graph import Code, Step
from toolchain.bounds.result import Outcome

if TYPE_CHECKING:
    from toolchain.bounds.explore import Explorer

TAKEN: Final[dict[type, int]] = {Branch: 1, Skip: 2, Return: -1}
"""What a branch or a skip adds at most to the cycles of its row, and what a return is shorter by if an interrupt waits
(isa.md §14.3)."""
DO_LEVELS: Final = 2
"""Open DO loops that the core keeps (isa.md §7.6)."""
REPEATED_WINDOW: Final = 4
"""Cycles that a read of the PSV window adds to all iterations of a REPEAT (isa.md §13.3)."""
REPEATS: Final = 600
"""Iterations of REPEAT run one by one; behind that only their number counts."""


class Steps:
    """One function, once: its instructions one by one."""

    def __init__(self, explorer: Explorer, code: Code) -> None:
        self.explorer, self.code = explorer, code
        self.area: Final = explorer.world.area
        self.outcome: Final = Outcome(visited={code.entry})
        self.floor = 0
        """Where its own part of the stack begins."""

    def _step(self, step: Step, state: State) -> Flow:
        if state.repeat is not None:
            return self._repeated(step, state)
        abstract = self.explorer.abstract
        level, top, start, blocked = state.ipl, state.w[15], state.time, state.disi
        state.time += step.cycles + (state.stall & step.pointers != 0)
        abstract.begin(step.pc, state)
        flow: Flow = step.insn.row.does(abstract, step.insn.x)
        abstract.commit()
        state.stall = step.writes
        if abstract.window:
            state.time += step.window
        if abstract.wild:
            self.outcome.wild, abstract.wild = True, False
        self._notice(step)
        if self.code.framed and exact(top) and not exact(state.w[15]):
            self.outcome.open[step.pc] = MOVED  # what changes stacks has no frame
        self._peak(state)
        match flow:
            case Repeat(count):
                state.repeat = count
            case Do(count, end):
                if len(state.loops) >= DO_LEVELS:
                    self.outcome.open[step.pc] = NESTED
                state.loops = (*state.loops, (step.after, end, count))
            case Sleep(mode):
                state.waits |= {step.pc}
                if mode == "sleep":
                    self.outcome.asleep.add(step.pc)
            case Disi(count):
                state.disi = max(state.disi, state.time + count + 1)
        taken = TAKEN.get(step.flow, 0) if step.flow is not None else 0
        self.outcome.slowest = max(self.outcome.slowest, state.time - start + taken)
        if level != state.ipl or blocked or state.disi:
            self._levels(state, step.pc)
        return flow

    def _repeated(self, step: Step, state: State) -> Flow:
        """The target of REPEAT (isa.md §7.5, §13.3): an access to the window costs in its first and last iteration."""
        abstract, count = self.explorer.abstract, state.repeat
        state.repeat = None
        least, most = ends(count)
        again = int(step.writes & step.pointers != 0)
        state.time += step.cycles + (state.stall & step.pointers != 0) + most * (step.cycles + again)
        window = False
        result: State | None = None
        current, level = state, state.ipl
        for turn in range(min(most, REPEATS) + 1):
            abstract.begin(step.pc, current)
            step.insn.row.does(abstract, step.insn.x)
            abstract.commit()
            window |= abstract.window
            self.outcome.wild |= abstract.wild
            self._notice(step)
            self._peak(current)
            if turn >= least and turn < most:
                result = current.copy() if result is None else self.area.join(result, current)
        if most > REPEATS:
            current = self._many(step, current, most)
        final = current if result is None else self.area.join(result, current)
        state.w, state.flags, state.mem = final.w, final.flags, final.mem
        state.regs, state.leaked, state.ipl, state.loops = final.regs, final.leaked, final.ipl, final.loops
        state.stall = step.writes
        self.outcome.slowest = max(self.outcome.slowest, step.cycles + 1 + (REPEATED_WINDOW if window else 0))
        if window:
            state.time += step.window if not most else max(step.window if not least else 0, REPEATED_WINDOW)
        if level != state.ipl or state.disi:
            self._levels(state, step.pc)
        return None

    def _many(self, step: Step, state: State, most: int) -> State:
        """Registers a long REPEAT has changed, and what it may have stored."""
        before = state.copy()
        abstract = self.explorer.abstract
        for _ in range(2):
            abstract.begin(step.pc, state)
            step.insn.row.does(abstract, step.insn.x)
            abstract.commit()
        wide = widened(before, state)
        if not exact(wide.w[15]):
            self.outcome.open[step.pc] = "pushes an unknown number of times"
        wide.mem = {a: v for a, v in wide.mem.items() if (a if a >= 0 else ~a) & ~1 in self.explorer.world.private}
        wide.leaked = 0
        return wide

    def _notice(self, step: Step) -> None:
        """What the instruction did that concerns the whole function."""
        abstract = self.explorer.abstract
        if abstract.refused is not None:
            self.outcome.open[step.pc] = abstract.refused
        self.outcome.arguments |= abstract.lowest < self.floor
        if abstract.unnested:
            self.outcome.unnested.add(step.pc)
            abstract.unnested = False
        if abstract.level is not None:
            self.outcome.levels[step.pc] = abstract.level
            abstract.level = None

    # -- what is measured ----------------------------------------------------------------------------------------

    def _peak(self, state: State) -> None:
        top = state.w[15]
        if exact(top):
            for number, (lo, hi) in enumerate(self.area.ranges):
                key = number, state.ipl[0]
                if lo <= top <= hi and top > self.outcome.peak.get(key, (-1,))[0]:
                    self.outcome.peak[key] = top, (self.code.entry,)
        elif self.code.framed and self.area.inside(top):
            self.outcome.open.setdefault(self.code.entry, MOVED)

    def _levels(self, state: State, pc: int) -> None:
        """Begin and end the stretches in which levels are held back."""
        blocked = state.disi > state.time
        if not blocked:
            state.disi = 0
        for level in range(1, LEVELS):
            since = state.since[level]
            if state.ipl[1] >= level or (blocked and level < LEVELS - 1):
                if since is None:
                    state.since[level] = state.time
            elif since is not None:
                if since == INHERITED:
                    Outcome.longer(self.outcome.prefix, level, state.time, pc)
                else:
                    Outcome.longer(self.outcome.masked, level, state.time - since, pc)
                state.since[level] = None
