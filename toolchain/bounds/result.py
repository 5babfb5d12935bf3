"""What a run of one function found: its ends, stacks, masked times, and what has no bound."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from toolchain.bounds.abstract.state import INHERITED, State

Scope = tuple[int | None, str]
"""Rounds that are counted together: those in one call of the function at an address (None: in all), and which."""


@dataclass(slots=True)
class Outcome:
    """What a run of one function found.  Addresses are program addresses, times cycles."""

    ends: dict[int | None, State] = field(default_factory=dict)
    """At its return, by the number in W0 where it is small and known; without any it never returns."""
    peak: dict[tuple[int, int], tuple[int, tuple[int, ...]]] = field(default_factory=dict)
    """By stack and CPU priority: the highest address used, and the functions on the way there."""
    masked: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By level: longest time it was held back, and where it ended; complete stretches only."""
    prefix: dict[int, tuple[int, int]] = field(default_factory=dict)
    """The same for stretches that began before the call, from the call on."""
    open: dict[int, str] = field(default_factory=dict)
    """What has no bound: address -> why."""
    forever: set[int] = field(default_factory=set)
    """Heads of loops without a way out."""
    left: int | None = None
    """Longest time to a change to another stack, from which it does not return by itself."""
    wild: bool = False
    """It stores where the address says nothing."""
    arguments: bool = False
    """It reads its caller's part of the stack."""
    visited: set[int] = field(default_factory=set)
    """Functions run."""
    waits: set[int] = field(default_factory=set)
    """PWRSAV on the ways to another stack; those on the ways to its return are in `ends`."""
    asleep: set[int] = field(default_factory=set)
    """PWRSAV #0 on any way: it stops the clock."""
    held: dict[int, int] = field(default_factory=dict)
    """Levels held back for ever: level -> head of the endless loop."""
    slowest: int = 0
    """Most cycles from one instruction boundary to the next."""
    unnested: set[int] = field(default_factory=set)
    """Where it turns the nesting of interrupts off (INTCON1.NSTDIS)."""
    levels: dict[int, str] = field(default_factory=dict)
    """Where it gives an interrupt another priority than is told: place -> which."""
    shared: dict[Scope, tuple[int, int]] = field(default_factory=dict)
    """Rounds of loops that its times leave out (`Explorer.sharing`): the longest of them, and how many in all."""

    def share(self, scope: Scope, total: int, cycles: int) -> None:
        """Leave out a round of a loop, of so many in all."""
        most = self.shared.get(scope, (0, 0))
        self.shared[scope] = max(most[0], cycles), max(most[1], total)

    def rounds_of(self, entry: int | None) -> int:
        """Cycles of the rounds left out that belong to the calls of a function, or to no call."""
        return sum(cycles * total for (of, _), (cycles, total) in self.shared.items() if of == entry)

    def take(self, other: Outcome, start: int, since: list[int | None], caller: tuple[int, ...]) -> None:
        """Add what a call, made at time `start`, found."""
        for stack, (top, chain) in other.peak.items():
            if top > self.peak.get(stack, (-1,))[0]:
                self.peak[stack] = top, caller + chain
        for level, (cycles, where) in other.masked.items():
            self.longer(self.masked, level, cycles, where)
        for level, (cycles, where) in other.prefix.items():
            began = since[level]
            if began == INHERITED:
                self.longer(self.prefix, level, start + cycles, where)
            elif began is not None:
                self.longer(self.masked, level, start + cycles - began, where)
        self.open.update(other.open)
        self.forever |= other.forever
        self.visited |= other.visited
        self.wild |= other.wild
        self.asleep |= other.asleep
        self.held = other.held | self.held
        self.slowest = max(self.slowest, other.slowest)
        self.unnested |= other.unnested
        self.levels |= other.levels
        for scope, (cycles, total) in other.shared.items():
            self.share(scope, total, cycles)
        if other.left is not None:
            self.left = max(self.left or 0, start + other.left)

    def moved(self, stack: int, distance: int) -> Outcome:
        """The same, entered that many bytes further up a stack."""
        peak = {k: (top + distance if k[0] == stack else top, chain) for k, (top, chain) in self.peak.items()}
        return replace(self, peak=peak)

    @staticmethod
    def longer(table: dict[int, tuple[int, int]], level: int, cycles: int, where: int) -> None:
        """Keep the longest."""
        if cycles > table.get(level, (-1, 0))[0]:
            table[level] = cycles, where
