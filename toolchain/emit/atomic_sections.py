"""Atomic sections: computes the number of cycles for which their DISI delays interrupts.

`begin_atomic` becomes `DISI #n`. Code skips it if a DISI of the source is active for at least n more cycles, which it
would shorten (isa.md §12). `end_atomic` emits no code. Needs: final instructions and blocks. Ensures: every
`begin_atomic` has its n.
"""

from __future__ import annotations

from toolchain.mir.function import MFunction
from toolchain.mir.instruction import MI
from toolchain.mir.operands import Imm
from toolchain.mir.operations import SKIPS

LIMIT = 0x3FFF  # greatest operand of DISI #lit14
BRANCH_CYCLES = 3  # cycles of a taken branch with a stall


def run(m: MFunction) -> None:
    """Compute n of every `begin_atomic`. Raise AssertionError if a section does not end within LIMIT cycles."""
    for number, b in enumerate(m.blocks):
        for k, mi in enumerate(b.insts):
            if mi.op == "begin_atomic":
                mi.args = [Imm(_cycles(m, number, k + 1))]


def _cycles(m: MFunction, number: int, at: int) -> int:
    """Upper bound of the cycles from instruction `at` to the end of its section.

    A section contains no branches of the source, but tail merging may have moved its end to another block."""
    total, blocks = 0, m.block_map()
    b = m.blocks[number]
    while total <= LIMIT:
        following = ""
        for mi in b.insts[at:]:
            if mi.op == "end_atomic":
                return total
            ends = ("bra", "ret", "call", "callr", "begin_atomic")
            assert mi.op not in ends, f"{m.name}: {mi!r} in an atomic section"
            if mi.op == "jump":
                following = str(mi.args[0])
            total += BRANCH_CYCLES if mi.op == "jump" or mi.op in SKIPS else _max_cycles(mi)
        order = m.blocks.index(b) + 1
        b, at = blocks[following] if following else m.blocks[order], 0
    raise AssertionError(f"{m.name}: an atomic section does not end")


def _max_cycles(mi: MI) -> int:
    """Upper bound of the cycles of an instruction with a stall (isa.md §13)."""
    return (2 if mi.op == "movd" else max(1, mi.info.words)) + 1
