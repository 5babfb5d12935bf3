"""Abstract execution: a function is run once on all its inputs, loop by loop and call by call.

Paths that meet are joined, with the greater time, so that the time of the state at a function's end is its worst case;
loops are followed round by round, so counts that follow from constants are found, and rounds, branches and calls whose
conditions cannot hold are not walked (Gustafsson et al., "Automatic derivation of loop bounds and infeasible paths for
WCET analysis using abstract execution", 2006).  A loop whose state repeats goes on for as long as an annotation says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.dspic30f.isa.flow import Branch, Call, Disi, Do, Flow, Goto, Repeat, Reset, Return, Skip, Sleep
from toolchain.bounds.builder import Abstract, World, exact
from toolchain.bounds.compare import Result, refined, tested
from toolchain.bounds.graph import Block, Builder, Code, Loop, Order, Step, joined
from toolchain.bounds.outcome import Outcome, Scope
from toolchain.bounds.state import INHERITED, LEVELS, NOWHERE, State, widened
from toolchain.bounds.values import WORD, Value, ends, span

MAX_TURNS: Final = 5_000
HOPELESS_TURNS: Final = 6
"""Rounds granted to a loop that has shown no end before."""
MAX_DEPTH: Final = 60
MAX_STEPS: Final = 60_000
REPEATS: Final = 600
"""Iterations of REPEAT run one by one; behind that only their number counts."""


EXPOSED: Final = 40
"""The same while the called function may reach into its caller's frame, whose contents are given up then."""
MARGIN: Final = 64
"""Bytes that a function may look at below the beginning of its own stack."""
VARIANTS: Final = 8
"""Calls of one function that are told apart."""
SMALL: Final = 0x800
"""What is less is no address of RAM: a number."""
RESULTS: Final = frozenset((0, 1))
"""Results by which the ways through a function are told apart."""
CHOICE: Final = 6
"""Most instructions of a block that tells them apart."""
EPILOGUE: Final = 12
"""Most instructions of a block that returns and is run for every way there."""
MOVED: Final = "room of a length that is not known is taken from the stack (alloca, array of variable length)"
ELSEWHERE: Final = "returns where nobody called it from (longjmp, a change of stacks)"
LOOP: Final = "no bound of this loop is known"
"""The one reason that leaves the stack bounded: its rounds have been followed until nothing new came of them."""


class TooMuch(Exception):
    """The budget of steps is used up."""


@dataclass(slots=True)
class Rules:
    """What annotations answer."""

    loop: Callable[[Code, Loop], int | None] = lambda _code, _loop: None
    """Most rounds of a loop beyond its first, per entry."""
    total: Callable[[Code, Loop], int | None] = lambda _code, _loop: None
    """The same of all its entries together."""
    together: Callable[[Code, Loop], dict[int, tuple[str, int]]] = lambda _code, _loop: {}
    """By function: what all loops say that share rounds in one call of it, and how many rounds."""
    scopes: frozenset[int] = frozenset()
    """Functions of whose calls some loop says so."""
    same: Callable[[Code], set[int]] = lambda _code: set()
    """Heads of loops that are one with the loop around them."""
    calls: Callable[[int, State], list[int] | None] = lambda _pc, _state: None
    """Targets of a call through a pointer whose value is not known."""
    times: Callable[[int], dict[int, int]] = lambda _pc: {}
    """By function: how often the call at an address is made in one call of it."""
    never: Callable[[int], bool] = lambda _pc: False
    """Whether the call at an address is not made."""
    without: frozenset[int] = frozenset()
    """Functions that are not called: paths that lead into them are left out."""
    recursion: Callable[[int], int | None] = lambda _entry: None
    """Activations of a function that exist at once."""
    resumed: Callable[[], list[int]] = list
    """Where code goes on that has moved to a stack of somebody else."""
    switches: Callable[[int], bool] = lambda _entry: False
    """Whether a function that returns on a stack that is not known has changed stacks."""
    back: Callable[[int], int | None] = lambda _entry: None
    """Level at which a function that changes stacks comes back, None: it is none."""


class Explorer:
    """Runs functions of one image; results of equal calls are kept."""

    def __init__(self, world: World, graph: Builder, rules: Rules, sharing: bool = False) -> None:
        """`sharing`: rounds that a loop has a number of in all cost nothing in place; `Outcome.shared` has them."""
        self.world, self.graph, self.rules, self.sharing = world, graph, rules, sharing
        self.abstract: Final = Abstract(world)
        self.codes: Final[dict[int, Code]] = {}
        self.known: Final[dict[object, Outcome]] = {}
        self.hopeless: Final[set[int]] = set()
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

    def rare(self, pc: int) -> tuple[Scope, int] | None:
        """In which of the calls under way the call at `pc` is made so often at most."""
        times = self.rules.times(pc) if self.sharing else {}
        return next((((entry, str(pc)), times[entry]) for entry in self.active if entry in times), None)

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
    """Numbers below a power of two; a set that could be an address says nothing."""
    high = ends(value)[1]
    return span(0, (1 << high.bit_length()) - 1) if high < SMALL else WORD


class _Run:
    """One function, once."""

    def __init__(self, explorer: Explorer, code: Code) -> None:
        self.explorer, self.code = explorer, code
        self.area: Final = explorer.world.area
        self.outcome: Final = Outcome(visited={code.entry})
        self.pending: dict[int, State] = {}

    def run(self, state: State) -> Outcome:
        self._peak(state)
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
        self.pending[target] = state if waiting is None else self.area.join(waiting, state)

    # -- loops ---------------------------------------------------------------------------------------------------

    def _loop(self, loop: Loop) -> None:
        """Round by round, until no path leads back or the annotated number of rounds is over."""
        explorer, pending = self.explorer, self.pending
        if loop.members.isdisjoint(pending):
            return
        bound, total = explorer.rules.loop(self.code, loop), explorer.rules.total(self.code, loop)
        bound = min((most for most in (bound, total) if most is not None), default=None)
        shared = explorer.shares(self.code, loop, total)
        limit = HOPELESS_TURNS if loop.head in explorer.hopeless else MAX_TURNS
        before: dict[int, State] = {}
        turns = 0
        while not loop.members.isdisjoint(pending):
            now = {head: pending[head] for head in loop.heads if head in pending}
            if now and before:
                if bound is not None and turns > bound:
                    break
                if turns > limit:
                    explorer.hopeless.add(loop.head)
                    self._widen(before, now)
                if shared is not None:
                    cycles = now[loop.head].time - before[loop.head].time
                    self.outcome.share(*shared, cycles)
                    now[loop.head].shift(-cycles)
                if {h: s.key() for h, s in now.items()} == {h: s.key() for h, s in before.items()}:
                    if bound is None:
                        explorer.hopeless.add(loop.head)
                        self._endless(loop)
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
        state.disi += cycles
        for level, (was, now) in enumerate(zip(before.since, state.since, strict=True)):
            if was is not None and now is not None and was != now:
                state.since[level] = now + cycles

    def _endless(self, loop: Loop) -> None:
        exits = any(t not in loop.members for m in loop.members for t in self.code.blocks[m].following)
        returns = any(self.code.blocks[m].steps[-1].flow is Return for m in loop.members)
        if exits or returns:
            self.outcome.open[loop.head] = LOOP
        else:
            self.outcome.forever.add(loop.head)

    # -- instructions --------------------------------------------------------------------------------------------

    def _block(self, block: Block, state: State) -> None:
        """Run a block and hand its state on."""
        explorer = self.explorer
        explorer.steps += len(block.steps)
        if explorer.steps > MAX_STEPS:
            raise TooMuch
        flow: Flow = None
        result: Result | None = None
        for index, step in enumerate(block.steps):
            if index == block.tested:
                before = state.w.copy()
                flow = self._step(step, state)
                result = Result.of(step, before, state.w)
            else:
                flow = self._step(step, state)
        last = block.steps[-1]
        if state.loops and last.pc == state.loops[-1][1] and not isinstance(flow, Branch | Goto | Return):
            self._loop_end(state, last)
            return
        self._follow(block, flow, state, result)

    def _step(self, step: Step, state: State) -> Flow:
        if state.repeat is not None:
            return self._repeated(step, state)
        abstract = self.explorer.abstract
        level, top = state.ipl, state.w[15]
        state.time += step.cycles + (state.stall & step.pointers != 0)
        abstract.begin(step.pc, state)
        flow: Flow = step.insn.row.does(abstract, step.insn.x)
        abstract.commit()
        state.stall = step.writes
        if abstract.window:
            state.time += step.window
        if abstract.wild:
            self.outcome.wild, abstract.wild = True, False
        if self.code.framed and exact(top) and not exact(state.w[15]):
            self.outcome.open[step.pc] = MOVED  # what changes stacks has no frame
        self._peak(state)
        match flow:
            case Repeat(count):
                state.repeat = count
            case Do(count, end):
                state.loops = (*state.loops, (step.after, end, count))
            case Disi(count):
                state.disi = max(state.disi, state.time + count)
                level = (-1, -1)
        if level != state.ipl or state.disi:
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
        current = state
        for turn in range(min(most, REPEATS) + 1):
            abstract.begin(step.pc, current)
            step.insn.row.does(abstract, step.insn.x)
            abstract.commit()
            window |= abstract.window
            self.outcome.wild |= abstract.wild
            self._peak(current)
            if turn >= least and turn < most:
                result = current.copy() if result is None else self.area.join(result, current)
        if most > REPEATS:
            current = self._many(step, current, most)
        final = current if result is None else self.area.join(result, current)
        state.w, state.flags, state.mem = final.w, final.flags, final.mem
        state.regs, state.leaked = final.regs, final.leaked
        state.stall = step.writes
        if window:
            state.time += step.window if not most else max(step.window if not least else 0, 4)
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

    def _follow(self, block: Block, flow: Flow, state: State, result: Result | None) -> None:
        """Where control goes behind a block."""
        last = block.steps[-1]
        match flow:
            case Branch(cond, target):
                if exact(cond):
                    state.time += int(cond)
                    self._arrive(target if cond else last.after, state)
                    return
                taken = state.copy()
                taken.time += 1
                if refined(block.steps, taken, True, result):
                    self._arrive(target, taken)
                if refined(block.steps, state, False, result):
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
            case Return(_, target):
                self._return(target, state)
            case Reset():
                return
            case Sleep():
                self._arrive(last.after, state)
            case _:
                self._arrive(last.after, state)

    def _goto(self, last: Step, target: Value, state: State) -> None:
        inside = self.code.blocks
        if exact(target) and target in inside and last.pc not in self.code.tails:
            self._arrive(target, state)
            return
        if last.insn.row.mnemonic == "BRA" and not exact(target):
            for place in self.code.blocks[self._head(last)].following:
                self._arrive(place, state.copy())
            return
        targets = [target] if exact(target) else self._unknown(last.pc, state)
        for place in targets:
            self._enter(last, place, state.copy(), tail=True)

    def _head(self, last: Step) -> int:
        return next(head for head, block in self.code.blocks.items() if block.steps[-1] is last)

    def _call(self, last: Step, target: Value, state: State) -> None:
        targets = [target] if exact(target) else self._unknown(last.pc, state)
        if not targets:
            returned = state.copy()
            self._lose_registers(returned)
            returned.w[15] = state.w[15] - 4 & 0xFFFF
            self._arrive(last.after, returned)
        for place in targets:
            self._enter(last, place, state.copy(), tail=False, many=len(targets) > 1)

    def _unknown(self, pc: int, state: State) -> list[int]:
        if not exact(state.w[15]):
            self.outcome.left = max(self.outcome.left or 0, state.time)
            return [entry for entry in self.explorer.rules.resumed() if entry not in self.explorer.active]
        found = self.explorer.rules.calls(pc, state)
        if found is None:
            self.outcome.open[pc] = "the targets of this call through a pointer are not known"
            return []
        return found

    def _enter(self, last: Step, target: int, state: State, tail: bool, many: bool = False) -> None:
        """Call a function, or jump to it, and go on behind it."""
        explorer = self.explorer
        if target in explorer.rules.without or explorer.rules.never(last.pc):
            return
        if target == 0:  # a weak function that is not linked
            if not tail:
                state.w[15] = state.w[15] - 4 & 0xFFFF
                self._arrive(last.after, state)
            return
        depth = explorer.active.count(target)
        allowed = explorer.rules.recursion(target)
        if depth >= (MAX_DEPTH if allowed is None else allowed) or len(explorer.active) > 8 * MAX_DEPTH:
            if allowed is None:
                self.outcome.open[last.pc] = "recursion"
            return
        start, since, stack = state.time, state.since.copy(), state.w[15]
        if not tail:
            state.flags = State().flags
        before = state.copy()
        found, general = explorer.call(target, state, many)
        self.outcome.take(found, start, since, (self.code.entry,))
        level = explorer.rules.back(target)
        if level is not None and found.left is not None:
            back = state.copy()
            self._lose_registers(back)
            back.time, back.ipl = found.left, (level, level)
            back.w[15] = stack - 4 & 0xFFFF
            ends = [back]
        else:
            ends = [self._behind(before, end, found.wild) if general else end.copy() for end in found.ends.values()]
        rare = explorer.rare(last.pc)
        if rare is not None and ends:
            cycles = min(end.time for end in ends)
            self.outcome.share(*rare, cycles)
            for end in ends:
                end.shift(-cycles)
        for end in ends:  # W8-W14 are preserved (abi-elf.md §2.1)
            if not tail and level is None:
                end.w[8:15] = before.w[8:15]
            end.shift(start)
            end.since = [since[k] if s == INHERITED else s for k, s in enumerate(end.since)]
            self._levels(end, last.pc)
            if tail:
                self._finish(end)
            elif len(ends) > 1 and self._decides(last.after):
                self._block(self.code.blocks[last.after], end)
            else:
                self._arrive(last.after, end)

    def _behind(self, before: State, end: State, wild: bool) -> State:
        """The caller's state behind a call that was run for all its calls."""
        private = self.explorer.world.private
        new = end.copy()
        new.w = [*end.w[:15], before.w[15] - 4 & 0xFFFF]
        kept = {a: v for a, v in before.mem.items() if (a if a >= 0 else ~a) & ~1 not in private}
        if wild and (before.leaked < NOWHERE or any(self.area.inside(value) for value in before.w[:8])):
            kept = {}
        new.mem = kept | {a: v for a, v in end.mem.items() if (a if a >= 0 else ~a) & ~1 in private}
        new.leaked = min(before.leaked, *(ends(v)[0] if self.area.inside(v) else NOWHERE for v in before.w[:8]))
        return new

    def _decides(self, head: int) -> bool:
        """Whether a block does nothing but choose a way: results of a call are kept apart until then."""
        block = self.code.blocks[head]
        short = len(block.steps) <= CHOICE and block.steps[-1].flow in (Branch, Skip)
        return short and head not in self.code.heads

    @staticmethod
    def _lose_registers(state: State) -> None:
        """What a call may change (abi-elf.md §2.1)."""
        fresh = State()
        state.w[:8] = fresh.w[:8]
        state.flags = fresh.flags

    def _return(self, target: Value, state: State) -> None:
        if not exact(state.w[15]):
            if not self.explorer.rules.switches(self.code.entry):
                self.outcome.open[self.code.entry] = ELSEWHERE
            self.outcome.left = max(self.outcome.left or 0, state.time)
            state.ipl, state.disi = (0, 0), 0  # whatever level it is, this stack is done with it
            self._levels(state, self.code.entry)
            return
        self._finish(state)

    def _finish(self, state: State) -> None:
        top = state.w[15]
        above = (
            {k for k in state.mem if (at := k if k >= 0 else ~k) >= top and self.area.holds(at)} if exact(top) else ()
        )
        for key in above:
            del state.mem[key]
        state.w[4:8], state.flags = State().w[4:8], State().flags  # not preserved (abi-elf.md §2.1)
        if exact(top) and state.leaked >= top:
            state.leaked = NOWHERE  # what has leaked is gone
        result = state.w[0]
        shown = result if exact(result) and result in RESULTS else None
        end = self.outcome.ends.get(shown)
        self.outcome.ends[shown] = state if end is None else self.area.join(end, state)

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
