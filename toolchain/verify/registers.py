"""Rules of registers: no pass makes a register undefined, and the function preserves callee-saved registers."""

from __future__ import annotations

from toolchain.abi.target import CALLEE_SAVED, SP
from toolchain.mir.function import MBlock, MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.liveness import mask_of, registers_in, solve
from toolchain.mir.operands import Mem
from toolchain.verify.error import MachineError

KEPT = mask_of(list(CALLEE_SAVED))


def undefined_at_entry(m: MFunction, reads: dict[str, int], kill: dict[str, int]) -> int:
    """Registers that may be read before the function writes them: arguments, and variables that C leaves undefined.

    `reads` and `kill` are those of `summary` for every block.
    """
    first = m.blocks[0].name
    return (reads[first] | solve(m, reads, kill)[first] & ~kill[first]) & ~(1 << SP)


def compare(before: int, after: int) -> None:
    """Raise MachineError if more registers are read before they are written than before the pass."""
    if after & ~before & ~KEPT:
        names = ", ".join(f"W{r}" for r in registers_in(after & ~before & ~KEPT))
        raise MachineError(f"{names} is read before it is written")


def summary(b: MBlock) -> tuple[int, int, int, int]:
    """Register sets of a block: read before written, written, pushed, and written outside of an epilogue."""
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
    """Raise MachineError if a register is written that must be preserved and is not pushed.

    Interrupt functions preserve all registers. `pushed` and `written` are those of all blocks (`summary`).
    """
    saved = pushed | (mask_of([0, 1, 2, 3]) if "shadow" in m.interrupt else 0)
    if m.uses_fp:
        saved |= 1 << 14
    lost = written & ~saved & ~(1 << SP) & (KEPT if not m.interrupt else 0xFFFF)
    if m.interrupt and m.blocks[0].insts and any(mi.args and mi.args[0] == "pop w0" for mi in m.blocks[0].insts):
        lost &= ~1  # W0 is excluded: the prologue saves it around its own use
    if lost:
        names = ", ".join(f"W{r}" for r in registers_in(lost))
        raise MachineError(f"{names} must be preserved, but is written and not saved")


def _pushed(mi: MI) -> int:
    """Registers that an instruction pushes."""
    if mi.op in ("mov", "movd") and len(mi.args) == 2 and isinstance(mi.args[0], int):
        to = mi.args[1]
        if isinstance(to, Mem) and to.mode == "++" and to.base == SP:
            return (3 if mi.op == "movd" else 1) << mi.args[0]
    return 0
