"""Result of the abstract execution of one function."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from toolchain.bounds.abstract.state import INHERITED, AbstractState

Scope = tuple[int | None, str]
"""Scope of shared iterations: the function per whose call they count (None: whole analysis), and annotation text."""


@dataclass(slots=True)
class FunctionResult:
    """Result of the abstract execution of one function.  Addresses are program addresses, times are cycles."""

    return_states: dict[int | None, AbstractState] = field(default_factory=dict)
    """States at the return, by the value of W0 if known and small; empty if the function never returns."""
    peak: dict[tuple[int, int], tuple[int, tuple[int, ...]]] = field(default_factory=dict)
    """By stack and CPU priority: the highest address used, and the call chain that reaches it."""
    masked: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By level: longest masked time that began within the call, and where it ended."""
    masked_prefix: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By level: longest masked time, counted from the call, that began before it, and where it ended."""
    unbounded: dict[int, str] = field(default_factory=dict)
    """Code without a bound: address -> reason."""
    endless_loops: set[int] = field(default_factory=set)
    """Heads of endless loops."""
    switch_time: int | None = None
    """Longest time to a switch to another stack, None without one."""
    unknown_store: bool = False
    """Whether the function stores through an unknown address."""
    reads_caller_stack: bool = False
    """Whether the function reads its caller's part of the stack."""
    visited: set[int] = field(default_factory=set)
    """Functions executed within the call."""
    waits: set[int] = field(default_factory=set)
    """Addresses of PWRSAV on paths to a stack switch; those on paths to a return are in the return states."""
    clock_stops: set[int] = field(default_factory=set)
    """Addresses of PWRSAV #0 on any path, which stops the clock."""
    masked_for_ever: dict[int, int] = field(default_factory=dict)
    """Levels masked for ever: level -> head of the endless loop."""
    longest_instruction: int = 0
    """Greatest number of cycles between two instruction boundaries."""
    nesting_disabled: set[int] = field(default_factory=set)
    """Addresses of instructions that disable interrupt nesting (INTCON1.NSTDIS)."""
    priority_changes: dict[int, str] = field(default_factory=dict)
    """Addresses of instructions that set a priority that contradicts an annotation: address -> interrupt."""
    shared_iterations: dict[Scope, tuple[int, int]] = field(default_factory=dict)
    """Shared iterations that the times exclude, by scope: cycles of the longest one, and their number."""

    def exclude_iteration(self, scope: Scope, total: int, cycles: int) -> None:
        """Exclude one iteration from the times and record it in its scope.

        total   number of iterations in the scope
        cycles  cycles of the excluded iteration
        """
        most = self.shared_iterations.get(scope, (0, 0))
        self.shared_iterations[scope] = max(most[0], cycles), max(most[1], total)

    def excluded_cycles(self, entry: int | None) -> int:
        """Return the cycles of the excluded iterations in scopes of a function.

        `entry` is the function, or None for the whole analysis.
        """
        return sum(cycles * total for (of, _), (cycles, total) in self.shared_iterations.items() if of == entry)

    def merge_call(self, other: FunctionResult, start: int, since: list[int | None], caller: tuple[int, ...]) -> None:
        """Merge the result of a call made at time `start`."""
        for stack, (top, chain) in other.peak.items():
            if top > self.peak.get(stack, (-1,))[0]:
                self.peak[stack] = top, caller + chain
        for level, (cycles, where) in other.masked.items():
            self.keep_longest(self.masked, level, cycles, where)
        for level, (cycles, where) in other.masked_prefix.items():
            began = since[level]
            if began == INHERITED:
                self.keep_longest(self.masked_prefix, level, start + cycles, where)
            elif began is not None:
                self.keep_longest(self.masked, level, start + cycles - began, where)
        self.unbounded.update(other.unbounded)
        self.endless_loops |= other.endless_loops
        self.visited |= other.visited
        self.unknown_store |= other.unknown_store
        self.clock_stops |= other.clock_stops
        self.masked_for_ever = other.masked_for_ever | self.masked_for_ever
        self.longest_instruction = max(self.longest_instruction, other.longest_instruction)
        self.nesting_disabled |= other.nesting_disabled
        self.priority_changes |= other.priority_changes
        for scope, (cycles, total) in other.shared_iterations.items():
            self.exclude_iteration(scope, total, cycles)
        if other.switch_time is not None:
            self.switch_time = max(self.switch_time or 0, start + other.switch_time)

    def relocated(self, stack: int, distance: int) -> FunctionResult:
        """Return this result for an entry with W15 `distance` bytes higher on a stack."""
        peak = {k: (top + distance if k[0] == stack else top, chain) for k, (top, chain) in self.peak.items()}
        return replace(self, peak=peak)

    @staticmethod
    def keep_longest(table: dict[int, tuple[int, int]], level: int, cycles: int, where: int) -> None:
        """Record a masked time if it is the longest of its level."""
        if cycles > table.get(level, (-1, 0))[0]:
            table[level] = cycles, where
