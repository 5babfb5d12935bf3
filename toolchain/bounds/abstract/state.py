"""Abstract state at one program point: registers, stack contents, CPU priority and elapsed cycles."""

from __future__ import annotations

from typing import Any

from toolchain.bounds.abstract.values import (
    BIT,
    RAM_POINTER,
    WORD,
    Interval,
    Value,
    extremes,
    is_ram_address,
    key_of,
    union,
)

FLAGS = ("C", "Z", "OV", "N", "DC", "OA", "OB", "SA", "SB")
LEVELS = 8
NO_ADDRESS = 1 << 16
INHERITED = -(1 << 60)
"""Value in `masked_since`: the level has been masked since before the function was called."""


class AbstractState:
    """One abstract state.  `time` is the greatest number of cycles of any path to this point.

    mem           tracked data: word address -> word, ~byte address -> byte; any other location has an unknown value
    ipl           least and greatest CPU priority; 8 is added while a trap is served (IPL3)
    masked_since  by level, the time at which masking of interrupts of that level began; None if not masked
    disi_end      time until which DISI blocks interrupts at instruction boundaries (isa.md §12)
    do_loops      active DO loops, outermost first: (start, end, remaining iterations)
    repeat        count of a REPEAT directly before the next instruction, None without one
    stall         bit mask of registers whose use as a source address costs one stall cycle in the next instruction
    lowest_leak   lowest stack address stored in an untracked location, NO_ADDRESS without one
    waits         addresses of PWRSAV instructions executed since the function was entered
    """

    __slots__ = (
        "disi_end", "do_loops", "flags", "ipl", "lowest_leak", "masked_since", "mem", "regs", "repeat", "stall", "time",
        "w", "waits",
    )  # fmt: skip

    def __init__(self) -> None:
        self.w: list[Value] = [WORD] * 16
        self.flags: dict[str, Value] = dict.fromkeys(FLAGS, BIT)
        self.regs: dict[str, Value] = {}
        self.mem: dict[int, Value] = {}
        self.time = 0
        self.stall = 0
        self.ipl = (0, 0)
        self.disi_end = 0
        self.masked_since: list[int | None] = [None] * LEVELS
        self.do_loops: tuple[tuple[int, int, Value], ...] = ()
        self.repeat: Value | None = None
        self.lowest_leak = NO_ADDRESS
        self.waits: frozenset[int] = frozenset()

    def copy(self) -> AbstractState:
        """Return an independent copy."""
        new = AbstractState.__new__(AbstractState)
        new.w, new.flags, new.mem = self.w.copy(), self.flags.copy(), self.mem.copy()
        new.regs, new.masked_since = self.regs.copy(), self.masked_since.copy()
        new.time, new.stall, new.ipl, new.disi_end = self.time, self.stall, self.ipl, self.disi_end
        new.do_loops, new.repeat, new.lowest_leak, new.waits = self.do_loops, self.repeat, self.lowest_leak, self.waits
        return new

    def key(self) -> tuple[Any, ...]:
        """Return a key that is equal for states that differ only in time and in when masking began."""
        return (
            tuple(map(key_of, self.w)),
            tuple(key_of(v) for v in self.flags.values()),
            tuple((name, key_of(v)) for name, v in sorted(self.regs.items())),
            frozenset((address, key_of(v)) for address, v in self.mem.items()),
            self.stall,
            self.ipl,
            self.disi_remaining,
            tuple(s is None for s in self.masked_since),
            tuple((start, end, key_of(n)) for start, end, n in self.do_loops),
            None if self.repeat is None else key_of(self.repeat),
            self.lowest_leak,
            self.waits,
        )

    @property
    def disi_remaining(self) -> int:
        """Cycles for which DISI still blocks, including the cycle of the current instruction boundary."""
        return max(0, self.disi_end - self.time)

    def shift(self, cycles: int) -> None:
        """Add `cycles` to all times of the state."""
        self.time += cycles
        if self.disi_end:
            self.disi_end += cycles
        self.masked_since = [s if s is None or s == INHERITED else s + cycles for s in self.masked_since]


class StackAreas:
    """The address ranges of stacks, and the join of states, which detects stack addresses that become untracked."""

    def __init__(self, ranges: list[tuple[int, int]]) -> None:
        self.ranges = ranges

    def contains(self, address: int) -> bool:
        """Whether an address is in a stack."""
        return any(lo <= address < hi for lo, hi in self.ranges)

    def index(self, address: int) -> int | None:
        """Return the number of the stack that contains an address, None if none does."""
        return next((number for number, (lo, hi) in enumerate(self.ranges) if lo <= address < hi), None)

    def points_into(self, value: Value) -> bool:
        """Whether every member points into one stack.

        The first address of a stack is excluded: no object lies there, and it is the address of the array itself.
        """
        a, b = extremes(value)
        return any(lo < a and b < hi for lo, hi in self.ranges)

    def join(self, a: AbstractState, b: AbstractState) -> AbstractState:
        """Return the join of two states; its time is the greater of both."""
        new = a.copy()
        new.lowest_leak = min(a.lowest_leak, b.lowest_leak)
        for n in range(16):
            new.w[n] = self._union(new, a.w[n], b.w[n])
        for name, value in b.flags.items():
            new.flags[name] = union(a.flags[name], value)
        new.regs = {n: union(v, b.regs[n]) for n, v in a.regs.items() if n in b.regs}
        new.mem = {}
        for address, value in a.mem.items():
            other = b.mem.get(address)
            if other is not None:
                new.mem[address] = self._union(new, value, other)
            elif self.points_into(value):
                new.lowest_leak = min(new.lowest_leak, extremes(value)[0])
        for address, value in b.mem.items():
            if address not in a.mem and self.points_into(value):
                new.lowest_leak = min(new.lowest_leak, extremes(value)[0])
        new.time = max(a.time, b.time)
        new.stall = a.stall | b.stall
        new.ipl = min(a.ipl[0], b.ipl[0]), max(a.ipl[1], b.ipl[1])
        blocked = max(a.disi_remaining, b.disi_remaining)
        new.disi_end = new.time + blocked if blocked else 0
        new.waits = a.waits | b.waits
        if a.masked_since != b.masked_since or a.time != b.time:
            new.masked_since = [
                earliest_masking(new.time, (x, a.time), (y, b.time))
                for x, y in zip(a.masked_since, b.masked_since, strict=True)
            ]
        new.do_loops = tuple((s, e, union(n, m)) for (s, e, n), (_, _, m) in zip(a.do_loops, b.do_loops, strict=False))
        if a.repeat is not None or b.repeat is not None:
            new.repeat = union(0 if a.repeat is None else a.repeat, 0 if b.repeat is None else b.repeat)
        return new

    def _union(self, state: AbstractState, a: Value, b: Value) -> Value:
        result = union(a, b)
        if is_unknown_address(result):
            state.lowest_leak = min(
                state.lowest_leak, *(extremes(v)[0] if self.points_into(v) else NO_ADDRESS for v in (a, b))
            )
        return result


def is_unknown_address(value: Value) -> bool:
    """Whether a set is too wide to serve as an address; stores to it are assumed not to change the stack."""
    lo, hi = extremes(value)
    return hi - lo >= 0x8000


def earliest_masking(time: int, *paths: tuple[int | None, int]) -> int | None:
    """Return the start of masking for which, at `time`, it has lasted as long as on the worst of the paths.

    paths  start of masking (None: not masked) and time at the end of each path
    """
    if any(since == INHERITED for since, _ in paths):
        return INHERITED
    lengths = [now - since for since, now in paths if since is not None]
    return time - max(lengths) if lengths else None


def widen(before: AbstractState, after: AbstractState) -> AbstractState:
    """Return `after` with every value that differs from `before` made unknown, so that loops reach a fixpoint."""
    new = after.copy()
    new.w = [_widen_value(a, b) for a, b in zip(before.w, after.w, strict=True)]
    new.mem = {k: v for k, v in after.mem.items() if k in before.mem and key_of(before.mem[k]) == key_of(v)}
    new.regs = {k: v for k, v in after.regs.items() if k in before.regs and key_of(before.regs[k]) == key_of(v)}
    new.flags = {k: v if key_of(before.flags[k]) == key_of(v) else BIT for k, v in after.flags.items()}
    new.lowest_leak = min(before.lowest_leak, after.lowest_leak)
    new.stall, new.waits = before.stall | after.stall, before.waits | after.waits
    new.ipl = min(before.ipl[0], after.ipl[0]), max(before.ipl[1], after.ipl[1])
    return new


def _widen_value(before: Value, after: Value) -> Value:
    if key_of(before) == key_of(after):
        return after
    return RAM_POINTER if is_ram_address(before) and is_ram_address(after) else WORD


__all__ = ["INHERITED", "LEVELS", "AbstractState", "Interval", "StackAreas", "widen"]
