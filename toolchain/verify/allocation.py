"""Check of register allocation: at every use, the chosen register contains the value of the virtual register.

Forward data flow: for each real register, the set of virtual registers whose value it contains. A copy gives a value a
second name. A virtual register that has not been written may be in any register. Sets are bit masks.
"""

from __future__ import annotations

from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import FIRST_VIRTUAL
from toolchain.verify.error import fail

Contents = tuple[list[int], int]  # sets of virtual registers: in each of W0-W15; possibly written


class ValueTransfer:
    """Effect of one instruction on the contents of registers."""

    __slots__ = ("kept", "mi", "names", "source", "uses", "wiped", "written")

    def __init__(self, m: MFunction, mi: MI, colour: dict[int, int]) -> None:
        self.mi = mi
        self.uses = [(r, colour[r]) for r in mi.uses() if r >= FIRST_VIRTUAL]
        source = mi.args[0] if mi.is_copy() else None
        self.source = -1  # real register that it copies, -1 if it is no copy
        if isinstance(source, int):
            self.source = colour[source] if source >= FIRST_VIRTUAL else source
        self.wiped: list[int] = []  # real registers whose contents become unknown
        self.written: list[tuple[int, int]] = []  # (real register, its new set of virtual registers)
        self.names = 0  # virtual registers that it writes
        for r in mi.defs():
            if r < FIRST_VIRTUAL:
                self.wiped.append(r)
                self.written.append((r, 0))
                continue
            self.names |= 1 << r
            real = [colour[r], colour[r] + 1] if r in m.pairs else [colour[r]]
            self.wiped += real
            self.written += [(k, 1 << r) for k in real]
        self.kept = ~self.names


def check(m: MFunction, colour: dict[int, int]) -> None:
    """Check an allocation that has not been applied yet; raise MachineError if a value is lost.

    `colour` is the real register of each virtual register, the lower one of a pair."""
    steps = {b.name: [ValueTransfer(m, mi, colour) for mi in b.insts] for b in m.blocks}
    succs = {b.name: b.succs for b in m.blocks}
    starts: dict[str, Contents] = {m.blocks[0].name: ([0] * 16, 0)}
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


def _meet(a: Contents, b: Contents) -> Contents:
    """Contents at a block with two predecessors."""
    anywhere, here, written = ~a[1], ~b[1], a[1] | b[1]
    return [(x | anywhere) & (y | here) & written for x, y in zip(a[0], b[0], strict=True)], written


def _through(steps: list[ValueTransfer], state: Contents, checked: str) -> Contents:
    """Contents after a block; `checked` is the block's name if its uses are to be checked, else ""."""
    contents, written = list(state[0]), state[1]
    for step in steps:
        if checked:
            for r, k in step.uses:
                if written >> r & 1 and not contents[k] >> r & 1:
                    fail(f"W{k} does not contain v{r}", checked, step.mi)
        value = contents[step.source] if step.source >= 0 else 0
        for k in step.wiped:
            contents[k] = 0
        if step.names:
            kept = step.kept
            contents = [x & kept for x in contents]
            written |= step.names
        for k, name in step.written:
            contents[k] = value | name
    return contents, written
