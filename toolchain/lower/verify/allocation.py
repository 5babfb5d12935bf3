"""Allocation, checked by following values: at every use the register chosen holds the value wanted.

For each real register the set of virtual registers whose value it holds travels along all edges; a copy makes two names
for one value. What was never written may be anywhere. Sets are bit masks over virtual registers.
"""

from __future__ import annotations

from ..mir import FIRST_VIRTUAL, MBlock, MFunction
from .error import fail

State = tuple[list[int], int]  # contents of W0-W15, registers possibly written


def check(m: MFunction, colour: dict[int, int]) -> None:
    """`m` still has virtual registers; `colour` is the real register of each (of a pair, the lower one)."""
    blocks = m.block_map()
    starts: dict[str, State] = {m.blocks[0].name: ([0] * 16, 0)}
    for b in m.blocks:
        if b.address_taken:
            starts.setdefault(b.name, ([0] * 16, 0))
    work = list(starts)
    while work:
        name = work.pop()
        state = _through(m, blocks[name], starts[name], colour, False)
        for s in blocks[name].succs:
            old = starts.get(s)
            new = state if old is None else _meet(old, state)
            if new != old:
                starts[s] = new
                work.append(s)
    for name, state in starts.items():
        _through(m, blocks[name], state, colour, True)


def _meet(a: State, b: State) -> State:
    held = [(x | ~a[1]) & (y | ~b[1]) & (a[1] | b[1]) for x, y in zip(a[0], b[0], strict=True)]
    return held, a[1] | b[1]


def _through(m: MFunction, b: MBlock, state: State, colour: dict[int, int], checking: bool) -> State:
    held, written = list(state[0]), state[1]
    for mi in b.insts:
        if checking:
            for r in mi.uses():
                if r >= FIRST_VIRTUAL and written >> r & 1 and not held[colour[r]] >> r & 1:
                    fail(f"W{colour[r]} does not hold v{r}", b.name, mi)
        source = mi.args[0] if mi.is_copy() else None
        value = 0
        if isinstance(source, int):
            value = held[colour[source] if source >= FIRST_VIRTUAL else source]
        defs = mi.defs()
        _clear(m, defs, held, colour)
        for r in defs:
            if r >= FIRST_VIRTUAL:
                written |= 1 << r
                for k in _places(m, r, colour):
                    held[k] = value | 1 << r if k == colour[r] or r in m.pairs else 0
            else:
                held[r] = value
    return held, written


def _clear(m: MFunction, defs: list[int], held: list[int], colour: dict[int, int]) -> None:
    """Forget what is overwritten, and the old values of the names that get new ones."""
    names = 0
    for r in defs:
        if r >= FIRST_VIRTUAL:
            names |= 1 << r
        for k in _places(m, r, colour):
            held[k] = 0
    for k in range(16):
        held[k] &= ~names


def _places(m: MFunction, r: int, colour: dict[int, int]) -> list[int]:
    if r < FIRST_VIRTUAL:
        return [r]
    return [colour[r], colour[r] + 1] if r in m.pairs else [colour[r]]
