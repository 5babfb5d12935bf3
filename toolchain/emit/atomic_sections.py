"""Lengths of the stretches in which an atomic access holds interrupts off.

`hold` becomes `DISI #n` unless as much is left of a DISI stretch of the source, which it must not shorten (isa.md §12);
`release` marks the end and is no instruction. Needs: final instructions and blocks. Ensures: every `hold` has its n.
"""

from __future__ import annotations

from toolchain.mir.mir import MI, SKIPS, Imm, MFunction

LIMIT = 0x3FFF
FLOW = 3  # cycles of a taken branch and a stall


def run(m: MFunction) -> None:
    """Fill in every `hold`. Raises AssertionError when a `release` is missing or too far."""
    for number, b in enumerate(m.blocks):
        for k, mi in enumerate(b.insts):
            if mi.op == "begin_atomic":
                mi.args = [Imm(_cycles(m, number, k + 1))]


def _cycles(m: MFunction, number: int, at: int) -> int:
    """At least the cycles from instruction `at` to the next release; an atomic sequence has no branches of its own, but
    its end may be shared."""
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
            total += FLOW if mi.op == "jump" or mi.op in SKIPS else _at_most(mi)
        order = m.blocks.index(b) + 1
        b, at = blocks[following] if following else m.blocks[order], 0
    raise AssertionError(f"{m.name}: an atomic sequence does not end")


def _at_most(mi: MI) -> int:
    """Cycles of an instruction, a stall included (isa.md §13)."""
    return (2 if mi.op == "movd" else max(1, mi.info.words)) + 1
