"""Bounds of the functions and entries of an image, each alone; together.py adds what interrupts what."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.bounds.abstract.state import LEVELS, Area, State
from toolchain.bounds.abstract.values import Value, span
from toolchain.bounds.annotations.rules import CUT, FOLLOWED, SLEEPS, WAITS, Rules
from toolchain.bounds.builder import World
from toolchain.bounds.explore import Explorer, TooMuch
from toolchain.bounds.program import Program
from toolchain.bounds.result import Outcome
from toolchain.stack.effects import CALL_BYTES

RAM = (0x0800, 0x2800)
STACK_END = 0x8000
"""Where the stack that functions are tried on ends: behind all RAM, so that none is too deep."""


@dataclass(slots=True)
class Bound:
    """One function or entry, looked at by itself.

    cycles  worst case from its first instruction to behind its return, or to the end of the switch to another thread;
            None without a bound
    stack   most bytes above the return address, by CPU priority at that depth
    other   the same on the other stack, from its beginning
    masked  by level, the longest time in which that level is held back
    """

    name: str
    kind: str
    level: int = 0
    cycles: int | None = None
    stack: dict[int, int] = field(default_factory=dict)
    other: dict[int, int] = field(default_factory=dict)
    path: list[str] = field(default_factory=list)
    masked: dict[int, tuple[int, str]] = field(default_factory=dict)
    open: dict[str, str] = field(default_factory=dict)
    """What is not known: source line -> why."""
    forever: bool = False
    held: dict[int, str] = field(default_factory=dict)
    """By level: the endless loop in which it is held back for ever."""
    behind: int = 0
    """Cycles for which DISI goes on behind its end."""
    returns: bool = False
    slowest: int = 0
    """Cycles of its longest instruction."""
    asleep: str = ""
    """Where it stops the clock."""
    unnested: str = ""
    """Where it turns the nesting of interrupts off."""
    levels: dict[str, str] = field(default_factory=dict)
    """Where it gives an interrupt another priority than is told."""

    @property
    def stack_is_known(self) -> bool:
        """Whether nothing is open but rounds of loops."""
        return all(why in FOLLOWED for why in self.open.values())

    @property
    def bytes(self) -> int:
        """Most bytes on the stack it was entered on."""
        return max(self.stack.values(), default=0)


class Analyst:
    """Looks at functions of one program."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.other = self._other_stack()
        self.base = self._base()
        areas = [(self.base, STACK_END)]
        if self.other is not None:
            areas.append(self.other)
        self.private, self.known = self._values("private"), self._values("known")
        kept = {a for a, _ in (*self.private, *self.known)}
        self.world = World(
            Area(areas),
            program.words,
            program.window,
            kept,
            program.links_in_ram,
            program.priorities(),
            program.enables(),
        )
        self.rules = Rules(
            loop=program.bindings.rounds,
            total=program.bindings.total,
            together=program.bindings.together,
            scopes=program.bindings.scopes(),
            same=program.bindings.same,
            one=program.bindings.one,
            times=program.bindings.times,
            never=program.bindings.never,
            without=program.without(),
            calls=program.targets,
            recursion=program.recursion,
            resumed=program.resumed,
            switches=program.switches,
            back=program.comes_back,
        )

    def _other_stack(self) -> tuple[int, int] | None:
        """The stack interrupts move to, by STACK_AREA."""
        for note in self.program.notes.of("stack"):
            name, _, text = note.text.partition(" ")
            start, size = self.program.address(name, note), self.program.notes.number(text, note)
            if start is not None and size is not None:
                return start, start + size
        return None

    def _base(self) -> int:
        """An address for stacks of functions, behind all that has a name and behind the other stack."""
        sections = [s for s in self.program.image.sections if s.is_ram]
        end = max((s.address + s.units for s in sections), default=RAM[0])
        return end + 1 & ~1

    def _values(self, kind: str) -> list[tuple[int, Value]]:
        found: list[tuple[int, Value]] = []
        for note in self.program.notes.of(kind):
            name, _, text = note.text.partition(" ")
            address, value = self.program.address(name, note), self.program.notes.number(text, note)
            if address is not None and value is not None:
                found.append((address & ~1, value))
        return found

    def explore(self, entry: int, level: int, on_other: bool, thread: bool, sharing: bool = False) -> Outcome:
        """Run a function from one state of entry; raises `TooMuch`."""
        state = State()
        state.ipl = level, level
        state.since = [0 if 0 < k <= level else None for k in range(LEVELS)]
        state.mem.update(self.known)
        state.w[15] = self.base + CALL_BYTES if not on_other or self.other is None else self.other[0] + CALL_BYTES
        if thread:
            state.mem.update(self.private)
        for note in self.program.notes.of("argument"):
            name, number, text = note.text.split(None, 2)
            most = self.program.notes.number(text, note)
            if self.program.address(name, note) == entry and most is not None:
                state.w[int(number)] = span(0, most)
        return Explorer(self.world, self.program.graph, self.rules, sharing).run(entry, state)

    def bound(self, name: str, entry: int, kind: str, level: int = 0, on_other: bool = False) -> Bound:
        """The bound of one function."""
        result = Bound(name.removeprefix("_"), kind, level)
        try:
            outside = kind != "interrupt" or entry in self.program.outside()
            contexts = [outside, False] if kind == "call" and self.private else [outside]
            found, *others = (self.explore(entry, level, on_other, thread) for thread in contexts)
            shared = []
            if any(self.program.notes.of(kind) for kind in ("total", "share", "often")):
                shared = [self.explore(entry, level, on_other, thread, sharing=True) for thread in contexts]
        except TooMuch:
            result.open[self.program.place(entry)] = CUT
            return result
        self._fill(result, found, on_other)
        self._time(result, [found, *others], shared)
        return result

    def _time(self, result: Bound, contexts: list[Outcome], shared: list[Outcome]) -> None:
        """The longest way in any context; PRIVATE_VALUEs are those of threads only outside of sections.

        Rounds that loops share are counted where they are as often as one entry may have them, or once for all, with
        the longest of them; the smaller sum is the bound.
        """
        place = self.program.place
        for found in contexts:
            result.open |= {place(pc): why for pc, why in found.open.items()}
            for pc in found.waits.union(*(end.waits for end in found.ends.values())):
                result.open.setdefault(place(pc), SLEEPS if pc in found.asleep else WAITS)
        sums = [max(times) for group in (contexts, shared) if (times := _times(group))]
        if sums and not result.open:
            result.cycles = min(sums)

    def _fill(self, result: Bound, found: Outcome, on_other: bool) -> None:
        place = self.program.place
        result.held = {level: place(head) for level, head in found.held.items()}
        result.returns, result.slowest = bool(found.ends), found.slowest
        result.asleep = next(map(place, sorted(found.asleep)), "")
        result.unnested = next(map(place, sorted(found.unnested)), "")
        result.levels = {place(pc): which for pc, which in found.levels.items()}
        result.behind = max((end.blocked for end in found.ends.values()), default=0)
        result.forever = not found.ends and found.left is None and bool(found.forever)
        start = CALL_BYTES + (self.other[0] if on_other and self.other is not None else self.base)
        deepest = -1
        for (stack, level), (top, chain) in found.peak.items():
            own = stack == (1 if on_other else 0)
            base = start if own else self.other[0] if self.other is not None else 0
            table = result.stack if own else result.other
            table[level] = max(table.get(level, 0), top - base)
            if top - base > deepest:
                deepest, result.path = top - base, [self.program.calls.name(e).removeprefix("_") for e in chain]
        for table_ in (found.masked, found.prefix):
            for level, (cycles, where) in table_.items():
                if cycles > result.masked.get(level, (-1, ""))[0]:
                    result.masked[level] = cycles, place(where)
        for end in found.ends.values():
            for level in range(1, LEVELS):
                since = end.since[level]
                if since is not None:
                    blocked = end.blocked if level < LEVELS - 1 else 0
                    cycles = end.time + blocked - max(since, 0)
                    if cycles > result.masked.get(level, (-1, ""))[0]:
                        result.masked[level] = cycles, "its end"


def _times(contexts: list[Outcome]) -> list[int]:
    """Cycles of every way through."""
    found = []
    for one in contexts:
        rounds = one.rounds_of(None)
        found += [end.time + rounds for end in one.ends.values()]
        found += [one.left + rounds] if one.left is not None else []
    return found
