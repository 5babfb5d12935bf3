"""What is known at one point of a program: registers, stack, level, and the longest way here in cycles."""

from __future__ import annotations

from typing import Any

from toolchain.bounds.abstract.values import EITHER, LINK, WORD, Span, Value, ends, is_ram, key_of, union

FLAGS = ("C", "Z", "OV", "N", "DC", "OA", "OB", "SA", "SB")
LEVELS = 8
NOWHERE = 1 << 16
INHERITED = -(1 << 60)
"""In `since`: masked since before this function was called."""


class State:
    """One abstract state.  `time` is the greatest number of cycles of any path that leads here.

    mem      tracked data: word address -> word, ~byte address -> byte; what is missing may be anything
    ipl      least and greatest CPU priority; 8 more while a trap is served (IPL3)
    since    by level, the time from which an interrupt of that level has been held back; None: it has not been
    disi     time up to which DISI blocks: an instruction boundary before it lets nothing in (isa.md §12)
    loops    open DO loops, outermost first: (start, end, remaining)
    repeat   count of the REPEAT in front of the next instruction, None without one
    stall    registers whose use as a source address costs a cycle now
    leaked   the lowest address of the stack that is kept where it is not tracked, NOWHERE without one
    waits    where the CPU has stood still since the function was entered: PWRSAV
    """

    __slots__ = (
        "disi", "flags", "ipl", "leaked", "loops", "mem", "regs", "repeat", "since", "stall", "time", "w", "waits",
    )  # fmt: skip

    def __init__(self) -> None:
        self.w: list[Value] = [WORD] * 16
        self.flags: dict[str, Value] = dict.fromkeys(FLAGS, EITHER)
        self.regs: dict[str, Value] = {}
        self.mem: dict[int, Value] = {}
        self.time = 0
        self.stall = 0
        self.ipl = (0, 0)
        self.disi = 0
        self.since: list[int | None] = [None] * LEVELS
        self.loops: tuple[tuple[int, int, Value], ...] = ()
        self.repeat: Value | None = None
        self.leaked = NOWHERE
        self.waits: frozenset[int] = frozenset()

    def copy(self) -> State:
        """An independent state."""
        new = State.__new__(State)
        new.w, new.flags, new.mem = self.w.copy(), self.flags.copy(), self.mem.copy()
        new.regs, new.since = self.regs.copy(), self.since.copy()
        new.time, new.stall, new.ipl, new.disi = self.time, self.stall, self.ipl, self.disi
        new.loops, new.repeat, new.leaked, new.waits = self.loops, self.repeat, self.leaked, self.waits
        return new

    def key(self) -> tuple[Any, ...]:
        """Equal for states between which nothing but time and the beginnings of masked stretches differs."""
        return (
            tuple(map(key_of, self.w)),
            tuple(key_of(v) for v in self.flags.values()),
            tuple((name, key_of(v)) for name, v in sorted(self.regs.items())),
            frozenset((address, key_of(v)) for address, v in self.mem.items()),
            self.stall,
            self.ipl,
            self.blocked,
            tuple(s is None for s in self.since),
            tuple((start, end, key_of(n)) for start, end, n in self.loops),
            None if self.repeat is None else key_of(self.repeat),
            self.leaked,
            self.waits,
        )

    @property
    def blocked(self) -> int:
        """Cycles for which DISI still blocks, that of the boundary among them."""
        return max(0, self.disi - self.time)

    def shift(self, cycles: int) -> None:
        """Move its clock."""
        self.time += cycles
        if self.disi:
            self.disi += cycles
        self.since = [s if s is None or s == INHERITED else s + cycles for s in self.since]


class Area:
    """The addresses of stacks: what a value may point to them for, and when such a value gets out of sight."""

    def __init__(self, ranges: list[tuple[int, int]]) -> None:
        self.ranges = ranges

    def holds(self, address: int) -> bool:
        """Whether an address is on a stack."""
        return any(lo <= address < hi for lo, hi in self.ranges)

    def inside(self, value: Value) -> bool:
        """Whether every member points to one stack; its first address, where no object lies, stands for the array."""
        a, b = ends(value)
        return any(lo < a and b < hi for lo, hi in self.ranges)

    def join(self, a: State, b: State) -> State:
        """What is known where two paths meet; the slower one's time."""
        new = a.copy()
        new.leaked = min(a.leaked, b.leaked)
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
            elif self.inside(value):
                new.leaked = min(new.leaked, ends(value)[0])
        for address, value in b.mem.items():
            if address not in a.mem and self.inside(value):
                new.leaked = min(new.leaked, ends(value)[0])
        new.time = max(a.time, b.time)
        new.stall = a.stall | b.stall
        new.ipl = min(a.ipl[0], b.ipl[0]), max(a.ipl[1], b.ipl[1])
        blocked = max(a.blocked, b.blocked)
        new.disi = new.time + blocked if blocked else 0
        new.waits = a.waits | b.waits
        if a.since != b.since or a.time != b.time:
            new.since = [longest(new.time, (x, a.time), (y, b.time)) for x, y in zip(a.since, b.since, strict=True)]
        new.loops = tuple((s, e, union(n, m)) for (s, e, n), (_, _, m) in zip(a.loops, b.loops, strict=False))
        if a.repeat is not None or b.repeat is not None:
            new.repeat = union(0 if a.repeat is None else a.repeat, 0 if b.repeat is None else b.repeat)
        return new

    def _union(self, state: State, a: Value, b: Value) -> Value:
        result = union(a, b)
        if hides(result):
            state.leaked = min(state.leaked, *(ends(v)[0] if self.inside(v) else NOWHERE for v in (a, b)))
        return result


def hides(value: Value) -> bool:
    """Whether a set is so wide that, as an address, it says nothing: whoever stores there spares the stack."""
    lo, hi = ends(value)
    return hi - lo >= 0x8000


def longest(time: int, *ways: tuple[int | None, int]) -> int | None:
    """Since when a level has been held back at `time`, if it has for as long as on the worst of the ways there."""
    if any(since == INHERITED for since, _ in ways):
        return INHERITED
    lengths = [now - since for since, now in ways if since is not None]
    return time - max(lengths) if lengths else None


def widened(before: State, after: State) -> State:
    """`after` with every value that differs from `before` given up: two rounds of a loop at most reach an end."""
    new = after.copy()
    new.w = [_given_up(a, b) for a, b in zip(before.w, after.w, strict=True)]
    new.mem = {k: v for k, v in after.mem.items() if k in before.mem and key_of(before.mem[k]) == key_of(v)}
    new.regs = {k: v for k, v in after.regs.items() if k in before.regs and key_of(before.regs[k]) == key_of(v)}
    new.flags = {k: v if key_of(before.flags[k]) == key_of(v) else EITHER for k, v in after.flags.items()}
    return new


def _given_up(before: Value, after: Value) -> Value:
    if key_of(before) == key_of(after):
        return after
    return LINK if is_ram(before) and is_ram(after) else WORD


__all__ = ["INHERITED", "LEVELS", "Area", "Span", "State", "widened"]
