"""Abstract execution: a function is run once on all its inputs, loop by loop and call by call.

Paths that meet are joined, with the greater time, so that the time of the state at a function's end is its worst case;
loops are followed round by round, so counts that follow from constants are found, and rounds, branches and calls whose
conditions cannot hold are not walked (Gustafsson et al., "Automatic derivation of loop bounds and infeasible paths for
WCET analysis using abstract execution", 2006).  A loop whose state repeats goes on for as long as an annotation says.
"""

from __future__ import annotations

from collections import Counter
from typing import Final

from emu.dspic30f.isa.flow import Branch, Call, Flow, Goto, Reset, Return, Skip
from toolchain.abi.target import SFR_END
from toolchain.bounds.abstract.conditions import Result, refined, tested
from toolchain.bounds.abstract.state import INHERITED, NOWHERE, State, widened
from toolchain.bounds.abstract.values import LINK, WORD, Value, ends, is_ram, span
from toolchain.bounds.annotations.rules import LAST, LONG, LOOP, MERGED, WAYS_IN, Rules
from toolchain.bounds.builder import Abstract, World, exact
from toolchain.bounds.calls import Calls
from toolchain.bounds.graph import Block, Builder, Code, Loop, Order, Step, joined
from toolchain.bounds.result import Outcome, Scope
from toolchain.stack.effects import CALL_BYTES

MAX_TURNS: Final = 5_000
HOPELESS_TURNS: Final = 6
"""Rounds granted to a loop that has shown no end before."""
MAX_STEPS: Final = 60_000
VARIANTS: Final = 8
"""Calls of one function that are told apart."""
EXPOSED: Final = 40
"""The same while the called function may reach into its caller's frame, whose contents are given up then."""
MARGIN: Final = 64
"""Bytes that a function may look at below the beginning of its own stack."""
SMALL: Final = SFR_END
"""What is less is no address of RAM: a number."""
EPILOGUE: Final = 12
"""Most instructions of a block that returns and is run for every way there."""


class TooMuch(Exception):
    """The budget of steps is used up."""


class Explorer:
    """Runs functions of one image; results of equal calls are kept."""

    def __init__(self, world: World, graph: Builder, rules: Rules, sharing: bool = False) -> None:
        """`sharing`: rounds that a loop has a number of in all cost nothing in place; `Outcome.shared` has them."""
        self.world, self.graph, self.rules, self.sharing = world, graph, rules, sharing
        self.abstract: Final = Abstract(world)
        self.codes: Final[dict[int, Code]] = {}
        self.known: Final[dict[object, Outcome]] = {}
        self.hopeless: Final[set[int]] = set()
        self.long: Final[set[int]] = set()
        """Heads of loops that were followed no further (LONG)."""
        self.variants: Final[Counter[int]] = Counter()
        self.closed: Final[Counter[int]] = Counter()
        """How many of them left nothing open."""
        self.sees: Final = world.area.inside
        self.active: list[int] = []
        self.steps = 0

    def code(self, entry: int) -> Code:
        """The blocks of a function."""
        if entry not in self.codes:
            self.codes[entry] = code = self.graph.code(entry)
            code.order = joined(code.order, self.rules.same(code))
            code.framed = any(step.insn.row.mnemonic == "LNK" for b in code.blocks.values() for step in b.steps)
            for block in code.blocks.values():
                if block.steps[-1].flow is Branch:
                    block.tested = tested(block.steps)
        return self.codes[entry]

    def run(self, entry: int, state: State) -> Outcome:
        """Run from the first instruction of `entry`; the outcome's times count from there."""
        state.shift(-state.time)
        state.since = [None if s is None else INHERITED for s in state.since]
        state.waits = frozenset()
        key = self._key(entry, state)
        found = self.known.get(key)
        if found is None:
            self.variants[entry] += 1
            self.active.append(entry)
            found = _Run(self, self.code(entry)).run(state)
            self.active.pop()
            self.known[key] = found
            self.closed[entry] += not found.open
        return found

    def _key(self, entry: int, state: State) -> object:
        """Equal for runs that find the same: where rounds are shared, also within the same calls."""
        around = [one for one in self.active if one in self.rules.scopes] if self.sharing else []
        return entry, tuple(dict.fromkeys(around)), state.key()

    def shares(self, code: Code, loop: Loop, total: int | None) -> tuple[Scope, int] | None:
        """Among which rounds those of a loop count, of the outermost call under way or of all, and how many."""
        if not self.sharing or len(loop.heads) != 1:
            return None
        together = self.rules.together(code, loop)
        for entry in self.active:
            if entry in together:
                text, rounds = together[entry]
                return (entry, text), rounds
        return None if total is None else ((None, str(loop.head)), total)

    def rare(self, pc: int, target: int) -> tuple[Scope, int] | None:
        """In which of the calls under way the call of `target` at `pc` is made so often at most."""
        times = self.rules.times(pc, target) if self.sharing else {}
        for entry in self.active:
            if entry in times:
                text, most = times[entry]
                return (entry, text), most
        return None

    def call(self, entry: int, state: State, one_of_many: bool) -> tuple[Outcome, bool]:
        """Run a called function; True: from a state that stands for all its calls, because there are many, or because a
        pointer may lead to many functions.

        That is done only where it leaves nothing open, or all of them do.
        """
        key = self._key(entry, state)
        if entry in self.active:
            return self.run(entry, state), False  # recursion ends by its arguments
        exposed = state.leaked < NOWHERE or any(map(self.sees, state.w[:8]))
        if (
            not exact(state.w[15])
            or key in self.known
            or (not one_of_many and self.variants[entry] < (EXPOSED if exposed else VARIANTS))
        ):
            return self.run(entry, state), False
        stack = next((i for i, (lo, hi) in enumerate(self.world.area.ranges) if lo <= state.w[15] < hi), None)
        if stack is None:
            return self.run(entry, state), False
        every = State()
        every.w[:8] = map(magnitude, state.w[:8])
        every.w[15] = self.world.area.ranges[stack][0] + MARGIN
        every.ipl, every.stall = state.ipl, state.stall
        every.since, every.loops = state.since.copy(), state.loops
        every.disi, every.time = state.disi, state.time
        every.mem = {a: v for a, v in state.mem.items() if (a if a >= 0 else ~a) & ~1 in self.world.private}
        found = self.run(entry, every)
        if found.open and self.closed[entry]:
            return self.run(entry, state), False
        return found.moved(stack, state.w[15] - self.world.area.ranges[stack][0] - MARGIN), True


def magnitude(value: Value) -> Value:
    """Numbers below a power of two; a set that could be an address says at most that it leads to RAM."""
    high = ends(value)[1]
    return span(0, (1 << high.bit_length()) - 1) if high < SMALL else LINK if is_ram(value) else WORD


class _Run(Calls):
    """One function, once: its loops and blocks in order."""

    def __init__(self, explorer: Explorer, code: Code) -> None:
        super().__init__(explorer, code)
        self.pending: dict[int, State] = {}
        self.merged: Final[set[int]] = set()
        """Heads of loops whose notes say nothing (MERGED)."""

    def run(self, state: State) -> Outcome:
        self._peak(state)
        self.floor = max(0, state.w[15] - CALL_BYTES) if exact(state.w[15]) else 0
        for lost in self.code.lost:
            self.outcome.open[lost] = "no instruction is here"
        if self.code.entry in self.code.blocks:
            self.pending[self.code.entry] = state.copy()
            self._visit(self.code.order)
            self._settle()
        return self.outcome

    def _settle(self) -> None:
        """Add the rounds that loops have together in this call: as many as there may be of the longest."""
        outcome = self.outcome
        more = outcome.rounds_of(self.code.entry)
        outcome.shared = {scope: most for scope, most in outcome.shared.items() if scope[0] != self.code.entry}
        for end in outcome.ends.values():
            end.shift(more)
        if outcome.left is not None:
            outcome.left += more

    def _visit(self, order: list[Order]) -> None:
        for part in order:
            if isinstance(part, Loop):
                self._loop(part)
            else:
                state = self.pending.pop(part, None)
                if state is not None:
                    self._block(self.code.blocks[part], state)

    def _arrive(self, target: int, state: State) -> None:
        block = self.code.blocks[target]
        if block.steps[-1].flow is Return and len(block.steps) <= EPILOGUE and target not in self.code.heads:
            self._block(block, state)  # not joined, so that results are told apart
            return
        waiting = self.pending.get(target)
        if waiting is not None and self._mixed(target, waiting, state):
            self.outcome.open[target] = WAYS_IN
        self.pending[target] = state if waiting is None else self.area.join(waiting, state)

    @staticmethod
    def _mixed(target: int, *ways: State) -> bool:
        """Whether ways into a DO loop meet that are within different ones."""
        one, other = ([(start, end) for start, end, _ in way.loops] for way in ways)
        return one != other and any(start <= target <= end for start, end in (*one, *other))

    # -- loops ---------------------------------------------------------------------------------------------------

    def _loop(self, loop: Loop) -> None:
        """Round by round, until no path leads back or the annotated number of rounds is over."""
        explorer, pending = self.explorer, self.pending
        if loop.members.isdisjoint(pending):
            return
        bound, shared = self._said(loop)
        limit = HOPELESS_TURNS if loop.head in explorer.hopeless else MAX_TURNS
        before: dict[int, State] = {}
        turns = 0
        while not loop.members.isdisjoint(pending):
            now = {head: pending[head] for head in loop.heads if head in pending}
            if now and before:
                if bound is not None and turns > bound:
                    break
                if turns > limit:
                    if limit == MAX_TURNS:
                        explorer.long.add(loop.head)
                    explorer.hopeless.add(loop.head)
                    self._widen(before, now)
                if shared is not None:
                    cycles = now[loop.head].time - before[loop.head].time
                    self.outcome.share(*shared, cycles)
                    now[loop.head].shift(-cycles)
                if {h: s.key() for h, s in now.items()} == {h: s.key() for h, s in before.items()}:
                    if bound is None:
                        explorer.hopeless.add(loop.head)
                        self._endless(loop, before, now)
                        break
                    if len(loop.heads) == 1:
                        self._rounds(before[loop.head], now[loop.head], bound - turns)
                        turns = bound
            before = {head: state.copy() for head, state in now.items()}
            if loop.head in now:
                self._block(self.code.blocks[loop.head], pending.pop(loop.head))
            self._visit(loop.body)
            turns += 1
        for head in loop.heads:
            pending.pop(head, None)

    def _said(self, loop: Loop) -> tuple[int | None, tuple[Scope, int] | None]:
        """Rounds of a loop by notes, and among which others they count; nothing where it may be two of the source."""
        explorer = self.explorer
        bound, total = explorer.rules.loop(self.code, loop), explorer.rules.total(self.code, loop)
        shared = explorer.shares(self.code, loop, total)
        said = [most for most in (bound, total) if most is not None]
        if (said or shared is not None) and not explorer.rules.one(self.code, loop):
            self.merged.add(loop.head)
            return None, None
        return min(said, default=None), shared

    def _widen(self, before: dict[int, State], now: dict[int, State]) -> None:
        """Give up what differs from the round before."""
        for head in before.keys() & now.keys():
            was, state = before[head], now[head]
            now[head] = self.pending[head] = widened(was, state)
            if exact(was.w[15]) and not exact(state.w[15]):
                self.outcome.open[self.code.blocks[head].steps[-1].pc] = "the stack grows in this loop"

    @staticmethod
    def _rounds(before: State, state: State, count: int) -> None:
        """As many rounds more as the one from `before` to `state`, which changed nothing but the time."""
        cycles = (state.time - before.time) * count
        state.time += cycles
        if state.disi:
            state.disi += cycles
        for level, (was, now) in enumerate(zip(before.since, state.since, strict=True)):
            if was is not None and now is not None and was != now:
                state.since[level] = now + cycles

    def _endless(self, loop: Loop, before: dict[int, State], now: dict[int, State]) -> None:
        exits = any(t not in loop.members for m in loop.members for t in self.code.blocks[m].following)
        returns = any(self.code.blocks[m].steps[-1].flow is Return for m in loop.members)
        if exits or returns:
            long, merged = loop.head in self.explorer.long, loop.head in self.merged
            self.outcome.open[loop.head] = MERGED if merged else LONG if long else LOOP
        else:
            self.outcome.forever.add(loop.head)
            for head in before.keys() & now.keys():
                if not self.explorer.abstract.disabled(now[head]):
                    self._hold(head, before[head], now[head])

    def _hold(self, head: int, before: State, now: State) -> None:
        """A stretch that has become longer by a round of an endless loop has no end."""
        for level, (was, since) in enumerate(zip(before.since, now.since, strict=True)):
            if was is not None and since is not None and now.time - since > before.time - was:
                self.outcome.held[level] = head

    # -- instructions --------------------------------------------------------------------------------------------

    def _block(self, block: Block, state: State) -> None:
        """Run a block and hand its state on."""
        explorer = self.explorer
        explorer.steps += len(block.steps)
        if explorer.steps > MAX_STEPS:
            raise TooMuch
        flow: Flow = None
        result: Result | None = None
        rewritten = False
        for index, step in enumerate(block.steps):
            if index == block.tested:
                before = state.w.copy()
                flow = self._step(step, state)
                result = Result.of(step, before, state.w)
            else:
                flow = self._step(step, state)
            rewritten = explorer.abstract.rewrote or (rewritten and not step.insn.row.flags)
        last = block.steps[-1]
        if last.pc in self.code.ends:
            if last.flow is not None:
                self.outcome.open[last.pc] = LAST
            elif not state.loops or state.loops[-1][1] != last.pc:
                self.outcome.open[last.pc] = WAYS_IN
        if state.loops and last.pc == state.loops[-1][1] and not isinstance(flow, Branch | Goto | Return):
            self._loop_end(state, last)
            return
        self._follow(block, flow, state, None if rewritten else (result,))

    def _loop_end(self, state: State, last: Step) -> None:
        """Behind the last instruction of a DO loop (isa.md §7.6)."""
        start, end, remaining = state.loops[-1]
        least, most = ends(remaining)
        if most > 0:
            again = state.copy()
            again.loops = (*state.loops[:-1], (start, end, span(max(least, 1) - 1, most - 1)))
            self._arrive(start, again)
        if least == 0:
            state.loops = state.loops[:-1]
            self._arrive(last.after, state)

    def _follow(self, block: Block, flow: Flow, state: State, compared: tuple[Result | None] | None) -> None:
        """Where control goes behind a block. `compared`: the result its flags tell of, if it still stands; None if
        a store has changed flags or registers since."""
        last = block.steps[-1]
        match flow:
            case Branch(cond, target):
                if exact(cond):
                    state.time += int(cond)
                    self._arrive(target if cond else last.after, state)
                    return
                taken = state.copy()
                taken.time += 1
                if compared is None or refined(block.steps, taken, True, *compared):
                    self._arrive(target, taken)
                if compared is None or refined(block.steps, state, False, *compared):
                    self._arrive(last.after, state)
            case Skip(cond):
                if not exact(cond) or cond:
                    item = self.explorer.graph.items.get(last.after)
                    words = len(item.words) if item else 1
                    skipped = state.copy() if not exact(cond) else state
                    skipped.time += words
                    self._arrive(last.after + 2 * words, skipped)
                if not exact(cond) or not cond:
                    self._arrive(last.after, state)
            case Goto(target):
                self._goto(last, target, state)
            case Call(target):
                self._call(last, target, state)
            case Return(kind, target, srl, ipl3):
                if kind == "retfie":
                    self._restored(state, srl, ipl3)
                self._return(target, state)
            case Reset():
                return
            case _:
                self._arrive(last.after, state)
