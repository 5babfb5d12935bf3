"""Registers: none becomes undefined, and those a caller keeps are kept."""

from __future__ import annotations

from toolchain.abi.target import CALLEE_SAVED, SP
from toolchain.mir.liveness import bits, members, solve
from toolchain.mir.mir import MI, MBlock, Mem, MFunction
from toolchain.verify.error import MachineError

KEPT = bits(list(CALLEE_SAVED))


def undefined_at_entry(m: MFunction, reads: dict[str, int], kill: dict[str, int]) -> int:
    """Registers somebody may read before the function has written them: arguments, and values C leaves undefined.

    `reads` and `kill` are the blocks' (`summary`).
    """
    first = m.blocks[0].name
    return (reads[first] | solve(m, reads, kill)[first] & ~kill[first]) & ~(1 << SP)


def compare(before: int, after: int) -> None:
    """A pass may not read more at the entry than was read there before it."""
    if after & ~before & ~KEPT:
        names = ", ".join(f"W{r}" for r in members(after & ~before & ~KEPT))
        raise MachineError(f"{names} is read before it is written")


def summary(b: MBlock) -> tuple[int, int, int, int]:
    """`liveness.summary`: registers read before they are written, and written; those it pushes, and those it writes
    outside of an epilogue."""
    reads = kill = pushed = written = 0
    for mi in reversed(b.insts):
        u, d = mi.register_sets()
        reads = reads & ~d | u
        kill |= d
        pushed |= _pushed(mi)
        if not mi.epilogue:
            written |= d
    return reads, kill, pushed, written


def check_saved(m: MFunction, pushed: int, written: int) -> None:
    """Registers that must survive are pushed before they are written. Interrupt functions save what they write.

    `pushed` and `written` are of all blocks together (`summary`).
    """
    saved = pushed | (bits([0, 1, 2, 3]) if "shadow" in m.interrupt else 0)
    if m.uses_fp:
        saved |= 1 << 14
    lost = written & ~saved & ~(1 << SP) & (KEPT if not m.interrupt else 0xFFFF)
    if m.interrupt and m.blocks[0].insts and any(mi.args and mi.args[0] == "pop w0" for mi in m.blocks[0].insts):
        lost &= ~1  # saved around the prologue's own use of it
    if lost:
        raise MachineError(f"{', '.join(f'W{r}' for r in members(lost))} must survive, but is written and not saved")


def _pushed(mi: MI) -> int:
    if mi.op in ("mov", "movd") and len(mi.args) == 2 and isinstance(mi.args[0], int):
        to = mi.args[1]
        if isinstance(to, Mem) and to.mode == "++" and to.base == SP:
            return (3 if mi.op == "movd" else 1) << mi.args[0]
    return 0
