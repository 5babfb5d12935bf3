"""Random legal instructions of every row."""

from __future__ import annotations

import random

from emu.dspic30f.isa import codec
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Insn, Row


def random_insn(row: Row, generator: random.Random) -> Insn:
    """Return a legal instruction of ``row`` with random ignored bits."""
    for _ in range(10_000):
        words = [
            value | generator.getrandbits(24) & ~mask & 0xFFFFFF
            for mask, value in zip(row.pattern.mask, row.pattern.value, strict=True)
        ]
        if "z" in row.fields:
            words[0] &= ~sum(run.mask << run.shift for run in row.fields["z"].runs)
        if "t" in row.fields and "v" in row.fields:  # t = v + 1 would be too rare at random
            v = generator.randrange(0, 14, 2)
            x = Operands(**{f.letter: f.get(*words) for f in row.pattern.fields} | {"v": v, "t": v + 1})
            if not row.broken(x):
                return codec.decode(*codec.encode(row, x))
        insn = codec.decode(*words)
        if insn is not None and insn.row is row:
            return insn
    raise AssertionError(f"no legal word found for {row.syntax}")


def idle_fields(insn: Insn) -> dict[str, int]:
    """Return the unused fields of an instruction, with the values that an assembler writes (isa.md §5, §8.1)."""
    fields, x = insn.row.fields, insn.x
    idle = {}
    if "w" in fields and ("g" in fields or "h" in fields) and 6 not in (getattr(x, "g", 0), getattr(x, "h", 0)):
        idle["w"] = 0
    if "i" in fields and x.i == 4:
        idle["x"] = 0
    if "y" in fields and x.j == 4:
        idle["y"] = 0
    return idle
