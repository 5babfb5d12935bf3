"""Interference between entries: response times of interrupts, and stacks under nested interrupts.

In: the bound of each entry in isolation (report.py).  Out: response times and stack depths.  Both assume that an
interrupt is not requested again before its handler has returned, and that a handler clears its flag before it lowers
its own priority.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

from toolchain.abi.target import RETURN_ADDRESS_BYTES
from toolchain.bounds.annotations.flow_facts import CLOCK_STOPPED
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.errors import ToolError

TRAP_LEVEL = 8
LATENCY = 5
"""Minimum of the worst-case latency in cycles from a request to the handler's first instruction: 4, and one more if the
interrupted instruction takes three cycles (isa.md §14.3)."""
ENTRY = 2
"""Cycles of interrupt entry in addition to the instruction in whose first cycle the request occurs."""
MOST_ORDERS = 12
"""Greatest number of interrupts whose nesting orders are enumerated; with more, all are assumed to nest."""
START = "_main"
SECOND_STACK = "kernel stack"
"""Name of the second stack (STACK_AREA) in reports."""


@dataclass(slots=True)
class Response:
    """Response of an interrupt: cycles from the request to its handler's first instruction.

    Every other interrupt, and every trap whose handler returns, is requested once in this time.
    """

    name: str
    level: int
    masked: int | None
    where: str
    cycles: int | None


@dataclass(slots=True)
class BoundsReport:
    """Bounds of the entries of one image, and the interference between them."""

    calls: list[Bound]
    threads: list[Bound]
    interrupts: list[Bound]
    on_second_stack: list[Bound]
    """Bounds of the interrupts, entered on the second stack (STACK_AREA)."""
    main: Bound | None = None
    """Bound of main, which runs before threads or without them; computed for every report."""
    responses: list[Response] = field(default_factory=list)
    stacks: dict[str, int | None] = field(default_factory=dict)
    """Bytes of each stack: main's and that of each thread, as in their rows, and the second stack."""
    contradictions: dict[str, str] = field(default_factory=dict)
    """Reasons why responses and stacks are unknown: source line -> contradiction to an annotated level."""

    @property
    def unbounded_responses(self) -> dict[str, str]:
        """Return the reasons why responses have no bound, by source line: endless masking, or a stopped clock."""
        rows = [row for row in self.rows if row.masked_for_ever and row.level < TRAP_LEVEL]
        highest: dict[str, int] = {}
        for row in rows:
            for level, place in row.masked_for_ever.items():
                highest[place] = max(level, highest.get(place, 0))
        stopped = {row.clock_stopped_at: CLOCK_STOPPED for row in self.rows if row.clock_stopped_at}
        return stopped | {
            place: f"an endless loop in which levels up to {level} are masked" for place, level in highest.items()
        }

    @property
    def unbounded_stacks(self) -> dict[str, str]:
        """Return the reasons why stacks have no bound: source line -> reason."""
        rows = (*self.rows, *self.on_second_stack)
        return self.contradictions | {place: why for row in rows for place, why in row.unbounded_stack.items()}

    @property
    def rows(self) -> list[Bound]:
        """All bounds of entries on their own stack, each once."""
        rows = [*self.calls, *self.threads, *self.interrupts]
        return rows if self.main is None or any(row is self.main for row in rows) else [self.main, *rows]


def report_of(program: Program, functions: Iterable[str]) -> BoundsReport:
    """Return the bounds of the named functions, main, all threads and interrupts, with response times and stacks.

    Raises `ToolError` for a name that is no function.
    """
    analysis = BoundAnalysis(program)
    calls, threads, interrupts, nested = [], [], [], []
    asked: dict[int, Bound] = {}
    for name in functions:
        address = program.address(name)
        if address is None or address not in program.calls.entries:
            raise ToolError(f"no function is called {name}")
        asked[address] = analysis.bound(name, address, "call")
        calls.append(asked[address])
    for entry in program.threads():
        threads.append(analysis.bound(program.calls.name(entry), entry, "thread"))
    for entry, name, level in program.interrupts():
        interrupts.append(analysis.bound(name, entry, "interrupt", level))
        if analysis.second_stack is not None:
            nested.append(analysis.bound(name, entry, "interrupt", level, on_second_stack=True))
    start = program.address(START)
    main = None
    if start is not None and start in program.calls.entries:
        main = asked.get(start) or analysis.bound(START, start, "main")
    report = BoundsReport(calls, threads, interrupts, nested, main)
    for row in (*report.rows, *nested):
        for place, which in row.priority_changes.items():
            report.contradictions[place] = f"sets an interrupt priority that contradicts INTERRUPT_LEVEL: {which}"
    report.responses = [_response(report, one) for one in interrupts if one.level < TRAP_LEVEL]
    _stacks(report, analysis)
    return report


def _response(report: BoundsReport, one: Bound) -> Response:
    """Return the response time of an interrupt: the sum of the delays that other entries cause.

    - the longest time for which code of a lower level masks the interrupt
    - the runs of every interrupt of the same or a higher level for one request, and one of every trap that returns
    - DISI that continues after the end of a handler

    Without nesting (NSTDIS), a handler of a lower level masks the interrupt as long as it runs.
    """
    level = one.level
    longest, where, more = 0, "", one.disi_after_return
    known = not report.contradictions and not any(row.clock_stopped_at for row in report.rows)
    unnested = any(row.nesting_disabled_at for row in report.rows)
    runs = _runs(report.interrupts)
    latency = max(LATENCY, ENTRY + max(row.longest_instruction for row in report.rows))
    for other in report.rows:
        if other is one or (other.level >= TRAP_LEVEL and not other.returns):
            continue
        if other.level >= level:
            known &= other.cycles is not None
            more += runs.get(other.name, 1) * ((other.cycles or 0) + other.disi_after_return + latency)
            continue
        masked, place = other.masked.get(level, (0, ""))
        cycles = masked or 0
        if unnested and other.kind == "interrupt":
            known &= other.cycles is not None
            cycles, place = max(cycles, other.cycles or 0), place or other.nesting_disabled_at
        if other.kind == "interrupt" and other.disi_after_return:
            more += cycles
        elif cycles > longest:
            longest, where = cycles, f"{place} in {other.name}"
        known &= level not in other.masked_for_ever and other.only_waits_are_unbounded
    return Response(one.name, level, longest if known else None, where, longest + more + latency if known else None)


def _runs(interrupts: Iterable[Bound]) -> dict[str, int]:
    """Return the most runs of each handler for one request of every interrupt.

    A handler that is interrupted before it clears its flag runs again within each handler of a higher level that
    lowers its priority below that of the first one.
    """
    runs: dict[str, int] = {}
    falling = sorted((one for one in interrupts if one.level < TRAP_LEVEL), key=lambda one: -one.level)
    for one in falling:
        above = (other for other in falling if other.level > one.level and min(other.stack, default=0) < one.level)
        runs[one.name] = 1 + sum(runs[other.name] for other in above)
    return runs


def _stacks(report: BoundsReport, analysis: BoundAnalysis) -> None:
    """Compute the stack bytes of each entry and of the second stack, with the deepest chain of nested interrupts."""

    def known(*parts: Bound) -> bool:
        return not report.contradictions and all(part.stack_is_known for part in parts)

    for row in (*report.rows, *report.on_second_stack):
        row.stack_bytes = RETURN_ADDRESS_BYTES + row.bytes if row.stack_is_known else None
    on_thread = partial(_on_top, report.interrupts)
    on_second_stack = partial(_on_top, report.on_second_stack)
    for user in report.threads if report.main is None else [report.main, *report.threads]:
        total = max((depth + on_thread(level) for level, depth in user.stack.items()), default=0)
        user.stack_bytes = RETURN_ADDRESS_BYTES + total if known(user, *report.interrupts) else None
        report.stacks[user.name] = user.stack_bytes
    if analysis.second_stack is not None:
        depths = [depth + on_second_stack(level) for row in report.rows for level, depth in row.second_stack.items()]
        report.stacks[SECOND_STACK] = max(depths, default=0) if known(*report.rows, *report.on_second_stack) else None


def _on_top(interrupts: list[Bound], level: int) -> int:
    """Return the greatest number of bytes used by nested interrupts above a level, each of which is requested once.

    An interrupt nests in one of lower priority, or in one that has lowered its own priority.
    """
    able = [one for one in interrupts if one.level < TRAP_LEVEL and one.stack]
    runs = _runs(able)
    if len(able) > MOST_ORDERS and any(at < one.level for one in able for at in one.stack):
        return sum(runs[one.name] * (RETURN_ADDRESS_BYTES + one.bytes) for one in able)
    found: dict[tuple[int, tuple[int, ...]], int] = {}

    def deepest(level: int, left: tuple[int, ...]) -> int:
        """Return the bytes above `level`; each handler still has `left` runs."""
        key = level, left
        if key not in found:
            found[key] = max(
                (
                    RETURN_ADDRESS_BYTES + depth + deepest(at, (*left[:number], left[number] - 1, *left[number + 1 :]))
                    for number, one in enumerate(able)
                    if left[number] and one.level > level
                    for at, depth in one.stack.items()
                ),
                default=0,
            )
        return found[key]

    return deepest(level, tuple(runs[one.name] for one in able))
