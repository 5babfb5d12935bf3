"""Entries of an image together: what holds an interrupt back, and stacks with all that interrupts them, by priority.

What enters: the bound of each entry alone (report.py).  What leaves: responses and stacks.  Both are for interrupts
that do not come again before their handler has returned.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

from toolchain.bounds.annotations.rules import SLEEPS, WAITS
from toolchain.bounds.program import Program
from toolchain.bounds.report import Analyst, Bound
from toolchain.errors import ToolError
from toolchain.stack.effects import CALL_BYTES

TRAP_LEVEL = 8
LATENCY = 5
"""Cycles counted from a request to the handler's first instruction, at least: 4, and one more behind an instruction of
three (isa.md §14.3)."""
ENTRY = 2
"""Cycles of entry beyond the instruction that a request falls into the first cycle of."""
MOST_ORDERS = 12
"""Interrupts whose nesting is looked at in every order; of more, all are taken to nest."""
START = "_main"


@dataclass(slots=True)
class Response:
    """An interrupt: cycles from the request to its handler's first instruction if every other interrupt comes once
    meanwhile, and every trap whose handler returns."""

    name: str
    level: int
    masked: int | None
    where: str
    cycles: int | None


@dataclass(slots=True)
class Report:
    """Everything about one image."""

    calls: list[Bound]
    threads: list[Bound]
    interrupts: list[Bound]
    nested: list[Bound]
    """The same interrupts, entered on the other stack."""
    main: Bound | None = None
    """What runs in front of threads, or instead of them, whatever was asked for."""
    responses: list[Response] = field(default_factory=list)
    stacks: dict[str, int | None] = field(default_factory=dict)
    """Bytes by stack: of main and of each thread with everything that interrupts it, and of the other stack."""
    open: dict[str, str] = field(default_factory=dict)
    """Why no response and no stack of several entries is known: source line -> what contradicts the levels told."""

    @property
    def late(self) -> dict[str, str]:
        """Why responses have no bound: source line -> what holds interrupts back there for ever, or stops the clock."""
        rows = [row for row in self.rows if row.held and row.level < TRAP_LEVEL]
        highest: dict[str, int] = {}
        for row in rows:
            for level, place in row.held.items():
                highest[place] = max(level, highest.get(place, 0))
        stopped = {row.asleep: SLEEPS for row in self.rows if row.asleep}
        return stopped | {
            place: f"an endless loop in which levels up to {level} are held back" for place, level in highest.items()
        }

    @property
    def rows(self) -> list[Bound]:
        """Everything looked at on the stack it is entered on, each once."""
        rows = [*self.calls, *self.threads, *self.interrupts]
        return rows if self.main is None or any(row is self.main for row in rows) else [self.main, *rows]


def report_of(program: Program, functions: Iterable[str]) -> Report:
    """Bounds of the named functions, of main, of all threads and interrupts, and what follows for stacks and responses.

    Raises `ToolError` for a name that is no function.
    """
    analyst = Analyst(program)
    calls, threads, interrupts, nested = [], [], [], []
    asked: dict[int, Bound] = {}
    for name in functions:
        address = program.address(name)
        if address is None or address not in program.calls.entries:
            raise ToolError(f"no function is called {name}")
        asked[address] = analyst.bound(name, address, "call")
        calls.append(asked[address])
    for entry in program.threads():
        threads.append(analyst.bound(program.calls.name(entry), entry, "thread"))
    for entry, name, level in program.interrupts():
        interrupts.append(analyst.bound(name, entry, "interrupt", level))
        if analyst.other is not None:
            nested.append(analyst.bound(name, entry, "interrupt", level, on_other=True))
    start = program.address(START)
    main = None
    if start is not None and start in program.calls.entries:
        main = asked.get(start) or analyst.bound(START, start, "main")
    report = Report(calls, threads, interrupts, nested, main)
    for row in (*report.rows, *nested):
        for place, which in row.levels.items():
            report.open[place] = f"gives an interrupt another priority than is told (INTERRUPT_LEVEL): {which}"
    report.responses = [_response(report, one) for one in interrupts if one.level < TRAP_LEVEL]
    _stacks(report, analyst)
    return report


def _response(report: Report, one: Bound) -> Response:
    """Held back by the longest stretch of anything of a lower level, then by every interrupt of a higher level once, by
    those of its own level that come first, by traps, and by what DISI in a handler holds back behind its end.

    Without nesting (NSTDIS) a handler of a lower level holds back for as long as it runs.
    """
    level = one.level
    longest, where, more = 0, "", one.behind
    known = not report.open and not any(row.asleep for row in report.rows)
    unnested = any(row.unnested for row in report.rows)
    latency = max(LATENCY, ENTRY + max(row.slowest for row in report.rows))
    for other in report.rows:
        if other is one or (other.level >= TRAP_LEVEL and not other.returns):
            continue
        if other.level >= level:
            known &= other.cycles is not None
            more += (other.cycles or 0) + other.behind + latency
            continue
        cycles, place = other.masked.get(level, (0, ""))
        if unnested and other.kind == "interrupt":
            known &= other.cycles is not None
            cycles, place = max(cycles, other.cycles or 0), place or other.unnested
        if other.kind == "interrupt" and other.behind:
            more += cycles
        elif cycles > longest:
            longest, where = cycles, f"{place} in {other.name}"
        known &= level not in other.held and all(why == WAITS for why in other.open.values())
    return Response(one.name, level, longest if known else None, where, longest + more + latency if known else None)


def _stacks(report: Report, analyst: Analyst) -> None:
    """Each stack with the deepest chain of interrupts on top."""

    def known(*parts: Bound) -> bool:
        return not report.open and all(part.stack_is_known for part in parts)

    on_thread = partial(_on_top, report.interrupts)
    on_other = partial(_on_top, report.nested)
    users = report.threads if report.main is None else [report.main, *report.threads]
    for user in users:
        total = max((depth + on_thread(level) for level, depth in user.stack.items()), default=0)
        report.stacks[user.name] = CALL_BYTES + total if known(user, *report.interrupts) else None
    if analyst.other is not None:
        depths = [depth + on_other(level) for row in report.rows for level, depth in row.other.items()]
        report.stacks["kernel stack"] = max(depths, default=0) if known(*report.rows, *report.nested) else None


def _on_top(interrupts: list[Bound], level: int) -> int:
    """Bytes that interrupts above a level can put on a stack, one within the other, each once: of rising priority, or
    within one that lowers the priority it came with."""
    able = [one for one in interrupts if one.level < TRAP_LEVEL and one.stack]
    if len(able) > MOST_ORDERS and any(at < one.level for one in able for at in one.stack):
        return sum(CALL_BYTES + one.bytes for one in able)
    found: dict[tuple[int, frozenset[int]], int] = {}

    def deepest(level: int, used: frozenset[int]) -> int:
        key = level, used
        if key not in found:
            found[key] = max(
                (
                    CALL_BYTES + depth + deepest(at, used | {number})
                    for number, one in enumerate(able)
                    if number not in used and one.level > level
                    for at, depth in one.stack.items()
                ),
                default=0,
            )
        return found[key]

    return deepest(level, frozenset())
