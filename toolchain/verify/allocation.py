"""Allocation, checked by following values: at every use the register chosen holds the value wanted.

For each real register the set of virtual registers whose value it holds travels along all edges; a copy makes two names
for one value. What was never written may be anywhere. Sets are bit masks over virtual registers.
"""

from __future__ import annotations

from toolchain.mir.mir import FIRST_VIRTUAL, MI, MFunction
from toolchain.verify.error import fail

State = tuple[list[int], int]  # contents of W0-W15, registers possibly written


class Step:
    """One instruction as it moves values between registers."""

    __slots__ = ("kept", "mi", "names", "source", "uses", "wiped", "written")

    def __init__(self, m: MFunction, mi: MI, colour: dict[int, int]) -> None:
        self.mi = mi
        self.uses = [(r, colour[r]) for r in mi.uses() if r >= FIRST_VIRTUAL]
        source = mi.args[0] if mi.is_copy() else None
        self.source = -1  # the real register it copies
        if isinstance(source, int):
            self.source = colour[source] if source >= FIRST_VIRTUAL else source
        self.wiped: list[int] = []
        self.written: list[tuple[int, int]] = []  # real register, and the name it gets
        self.names = 0  # virtual registers whose old values are no longer meant
        for r in mi.defs():
            if r < FIRST_VIRTUAL:
                self.wiped.append(r)
                self.written.append((r, 0))
                continue
            self.names |= 1 << r
            places = [colour[r], colour[r] + 1] if r in m.pairs else [colour[r]]
            self.wiped += places
            self.written += [(k, 1 << r) for k in places]
        self.kept = ~self.names


def check(m: MFunction, colour: dict[int, int]) -> None:
    """`m` still has virtual registers; `colour` is the real register of each (of a pair, the lower one)."""
    steps = {b.name: [Step(m, mi, colour) for mi in b.insts] for b in m.blocks}
    succs = {b.name: b.succs for b in m.blocks}
    starts: dict[str, State] = {m.blocks[0].name: ([0] * 16, 0)}
    for b in m.blocks:
        if b.address_taken:
            starts.setdefault(b.name, ([0] * 16, 0))
    work = list(starts)
    while work:
        name = work.pop()
        state = _through(steps[name], starts[name], "")
        for s in succs[name]:
            old = starts.get(s)
            new = state if old is None else _meet(old, state)
            if new != old:
                starts[s] = new
                work.append(s)
    for name, state in starts.items():
        _through(steps[name], state, name)


def _meet(a: State, b: State) -> State:
    anywhere, here, written = ~a[1], ~b[1], a[1] | b[1]
    return [(x | anywhere) & (y | here) & written for x, y in zip(a[0], b[0], strict=True)], written


def _through(steps: list[Step], state: State, checked: str) -> State:
    """The state behind a block; `checked` is its name when its uses are checked."""
    held, written = list(state[0]), state[1]
    for step in steps:
        if checked:
            for r, k in step.uses:
                if written >> r & 1 and not held[k] >> r & 1:
                    fail(f"W{k} does not hold v{r}", checked, step.mi)
        value = held[step.source] if step.source >= 0 else 0
        for k in step.wiped:
            held[k] = 0
        if step.names:
            kept = step.kept
            held = [x & kept for x in held]
            written |= step.names
        for k, name in step.written:
            held[k] = value | name
    return held, written
