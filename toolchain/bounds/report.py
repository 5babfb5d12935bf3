"""Bounds of functions and entries in isolation; interference.py adds interrupts."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolchain.abi.target import RETURN_ADDRESS_BYTES
from toolchain.bounds.abstract.state import LEVELS, AbstractState, StackAreas
from toolchain.bounds.abstract.values import Value, interval
from toolchain.bounds.annotations.flow_facts import (
    BUDGET_EXCEEDED,
    CLOCK_STOPPED,
    STACK_STILL_BOUNDED,
    UNBALANCED_RETURN,
    WAITS_FOR_INTERRUPT,
    FlowFacts,
)
from toolchain.bounds.calling_contexts import AnalysisCache
from toolchain.bounds.explorer import BudgetExceededError, Explorer
from toolchain.bounds.program import Program
from toolchain.bounds.result import FunctionResult
from toolchain.bounds.transfer import ImageModel

RAM = (0x0800, 0x2800)
STACK_END = 0x8000
"""End of the stack area in the analysis: above all RAM, so that no analysed stack overflows."""


@dataclass(slots=True)
class Bound:
    """Bound of one function or entry in isolation.

    cycles  worst case from the first instruction to the return, or to the end of the switch to another thread;
            None without a bound
    stack   greatest depth above the return address in bytes, by CPU priority at that depth
    second_stack  the same on the second stack (STACK_AREA), from its start
    masked  by level, the longest time for which interrupts of that level are masked, and where; None if not known
    """

    name: str
    kind: str
    level: int = 0
    cycles: int | None = None
    stack: dict[int, int] = field(default_factory=dict)
    stack_bytes: int | None = None
    """Bytes of stack, return address included, of main and threads with the deepest chain of interrupts; None if not
    known.  Set by interference.py."""
    second_stack: dict[int, int] = field(default_factory=dict)
    path: list[str] = field(default_factory=list)
    masked: dict[int, tuple[int | None, str]] = field(default_factory=dict)
    unbounded: dict[str, str] = field(default_factory=dict)
    """Code without a bound: source line -> reason."""
    is_endless: bool = False
    masked_for_ever: dict[int, str] = field(default_factory=dict)
    """By level: the endless loop that masks interrupts of that level."""
    disi_after_return: int = 0
    """Cycles for which DISI still blocks interrupts after the return."""
    returns: bool = False
    longest_instruction: int = 0
    """Cycles of the longest instruction."""
    clock_stopped_at: str = ""
    """Source line that stops the clock, "" if none does."""
    nesting_disabled_at: str = ""
    """Source line that disables interrupt nesting, "" if none does."""
    priority_changes: dict[str, str] = field(default_factory=dict)
    """Source lines that set a priority that contradicts an annotation: source line -> interrupt."""

    @property
    def stack_is_known(self) -> bool:
        """Whether the stack has a bound, which it may have although loop bounds are missing."""
        return not self.unbounded_stack

    @property
    def only_waits_are_unbounded(self) -> bool:
        """Whether all code has a bound except waits for interrupts, which mask none."""
        return all(why == WAITS_FOR_INTERRUPT for why in self.unbounded.values())

    @property
    def unbounded_stack(self) -> dict[str, str]:
        """Code that leaves the stack without a bound: source line -> reason."""
        return {place: why for place, why in self.unbounded.items() if why not in STACK_STILL_BOUNDED}

    @property
    def bytes(self) -> int:
        """Greatest depth in bytes of the stack on which the entry is called."""
        return max(self.stack.values(), default=0)


class BoundAnalysis:
    """Computes bounds of the functions of one program."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.cache = AnalysisCache(program.graph)
        self.second_stack = self._find_second_stack()
        self.base = self._base()
        areas = [(self.base, STACK_END)]
        if self.second_stack is not None:
            areas.append(self.second_stack)
        self.private, self.known = self._values("private"), self._values("known")
        kept = {a for a, _ in (*self.private, *self.known)}
        self.model = ImageModel(
            StackAreas(areas),
            program.words,
            program.window,
            kept,
            program.pointers_in_ram,
            program.priorities(),
            program.enable_registers(),
        )
        self.flow_facts = FlowFacts(
            loop_bound=program.bindings.loop_bound,
            total_iterations=program.bindings.total_iterations,
            shared_iterations=program.bindings.shared_iterations,
            sharing_scopes=program.bindings.sharing_scopes(),
            merged_loops=program.bindings.merged_loops,
            is_single_loop=program.bindings.is_single_loop,
            call_counts=program.bindings.call_counts,
            is_never_called=program.bindings.is_never_called,
            excluded=program.excluded(),
            call_targets=program.call_targets,
            recursion_depths=program.recursions,
            stack_depths=program.depths,
            resume_points=program.resume_points,
            switches_stack=program.switches_stack,
            return_level=program.return_level,
        )

    def _find_second_stack(self) -> tuple[int, int] | None:
        """Return the range of the second stack, which interrupts switch to, by STACK_AREA."""
        for annotation in self.program.annotations.of("stack"):
            name, _, text = annotation.text.partition(" ")
            start, size = self.program.address(name, annotation), self.program.annotations.number(text, annotation)
            if start is not None and size is not None:
                return start, start + size
        return None

    def _base(self) -> int:
        """Return a stack start for analysed functions above all data sections."""
        sections = [s for s in self.program.image.sections if s.is_ram]
        end = max((s.address + s.units for s in sections), default=RAM[0])
        return end + 1 & ~1

    def _values(self, kind: str) -> list[tuple[int, Value]]:
        found: list[tuple[int, Value]] = []
        for annotation in self.program.annotations.of(kind):
            name, _, text = annotation.text.partition(" ")
            address, value = self.program.address(name, annotation), self.program.annotations.number(text, annotation)
            if address is not None and value is not None:
                found.append((address & ~1, value))
        return found

    def execute(
        self, entry: int, level: int, on_second_stack: bool, thread: bool, sharing: bool = False
    ) -> FunctionResult:
        """Execute a function abstractly from one entry state; raises `BudgetExceededError`."""
        state = AbstractState()
        state.ipl = level, level
        state.masked_since = [0 if 0 < k <= level else None for k in range(LEVELS)]
        state.mem.update(self.known)
        state.w[15] = (
            self.base + RETURN_ADDRESS_BYTES
            if not on_second_stack or self.second_stack is None
            else self.second_stack[0] + RETURN_ADDRESS_BYTES
        )
        if thread:
            state.mem.update(self.private)
        for annotation in self.program.annotations.of("argument"):
            name, number, text = annotation.text.split(None, 2)
            most = self.program.annotations.number(text, annotation)
            if self.program.address(name, annotation) == entry and most is not None:
                state.w[int(number)] = interval(0, most)
        start = state.w[15]
        found = Explorer(self.model, self.cache, self.flow_facts, sharing).run(entry, state)
        if any(end.w[15] != start - RETURN_ADDRESS_BYTES for end in found.return_states.values()):
            found.unbounded[entry] = UNBALANCED_RETURN
        return found

    def bound(self, name: str, entry: int, kind: str, level: int = 0, on_second_stack: bool = False) -> Bound:
        """Return the bound of one function."""
        result = Bound(name.removeprefix("_"), kind, level)
        try:
            outside = kind != "interrupt" or entry in self.program.handlers_outside_sections()
            contexts = [outside, False] if kind == "call" and self.private else [outside]
            found, *others = (self.execute(entry, level, on_second_stack, thread) for thread in contexts)
            shared = []
            if any(self.program.annotations.of(kind) for kind in ("total", "share", "often")):
                shared = [self.execute(entry, level, on_second_stack, thread, sharing=True) for thread in contexts]
        except BudgetExceededError:
            result.unbounded[self.program.place(entry)] = BUDGET_EXCEEDED
            return result
        self._fill(result, found, on_second_stack)
        self._time(result, [found, *others], shared)
        return result

    def _time(self, result: Bound, contexts: list[FunctionResult], shared: list[FunctionResult]) -> None:
        """Set the cycles of a bound to those of the longest path in any context.

        PRIVATE_VALUEs hold for threads outside critical sections only.  Shared iterations are counted in two ways: at
        each loop with its own limit, or once for all loops at the cost of the longest.  The smaller sum is the bound.
        """
        place = self.program.place
        for found in contexts:
            result.unbounded |= {place(pc): why for pc, why in found.unbounded.items()}
            for pc in found.waits.union(*(end.waits for end in found.return_states.values())):
                result.unbounded.setdefault(
                    place(pc), CLOCK_STOPPED if pc in found.clock_stops else WAITS_FOR_INTERRUPT
                )
        if not result.only_waits_are_unbounded:
            result.masked = {level: (None, where) for level, (_, where) in result.masked.items()}
        sums = [max(times) for group in (contexts, shared) if (times := _times(group))]
        if sums and not result.unbounded:
            result.cycles = min(sums)

    def _fill(self, result: Bound, found: FunctionResult, on_second_stack: bool) -> None:
        place = self.program.place
        result.masked_for_ever = {level: place(head) for level, head in found.masked_for_ever.items()}
        result.returns, result.longest_instruction = bool(found.return_states), found.longest_instruction
        result.clock_stopped_at = next(map(place, sorted(found.clock_stops)), "")
        result.nesting_disabled_at = next(map(place, sorted(found.nesting_disabled)), "")
        result.priority_changes = {place(pc): which for pc, which in found.priority_changes.items()}
        result.disi_after_return = max((end.disi_remaining for end in found.return_states.values()), default=0)
        result.is_endless = not found.return_states and found.switch_time is None and bool(found.endless_loops)
        start = RETURN_ADDRESS_BYTES + (
            self.second_stack[0] if on_second_stack and self.second_stack is not None else self.base
        )
        deepest = -1
        for (stack, level), (top, chain) in found.peak.items():
            own = stack == (1 if on_second_stack else 0)
            base = start if own else self.second_stack[0] if self.second_stack is not None else 0
            table = result.stack if own else result.second_stack
            table[level] = max(table.get(level, 0), top - base)
            if top - base > deepest and (own or result.kind == "interrupt"):
                deepest, result.path = top - base, [self.program.calls.name(e).removeprefix("_") for e in chain]
        masked: dict[int, tuple[int, str]] = {}
        for table_ in (found.masked, found.masked_prefix):
            for level, (cycles, where) in table_.items():
                if cycles > masked.get(level, (-1, ""))[0]:
                    masked[level] = cycles, place(where)
        for end in found.return_states.values():
            for level in range(1, LEVELS):
                since = end.masked_since[level]
                if since is not None:
                    blocked = end.disi_remaining if level < LEVELS - 1 else 0
                    cycles = end.time + blocked - max(since, 0)
                    if cycles > masked.get(level, (-1, ""))[0]:
                        masked[level] = cycles, "its end"
        result.masked.update(masked)


def _times(contexts: list[FunctionResult]) -> list[int]:
    """Return the cycles of every path through a function."""
    found = []
    for one in contexts:
        rounds = one.excluded_cycles(None)
        found += [end.time + rounds for end in one.return_states.values()]
        found += [one.switch_time + rounds] if one.switch_time is not None else []
    return found
