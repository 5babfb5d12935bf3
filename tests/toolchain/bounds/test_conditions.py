"""Refinement by branch conditions is sound: no value for which the condition holds is excluded."""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import pytest

from emu.dspic30f.isa.codec import decode_for_execution, encode
from emu.dspic30f.isa.table import ROWS
from toolchain.bounds.abstract.conditions import FlagResult, _narrow
from toolchain.bounds.abstract.values import Value, extremes, interval
from toolchain.bounds.graph import Instruction

EDGES = (0, 1, 2, 0x7FFD, 0x7FFE, 0x7FFF, 0x8000, 0x8001, 0xFFFE, 0xFFFF)
"""Words around which a comparison changes its result."""


def holds(condition: str, difference: int, carry: bool) -> bool:
    """Whether a condition without OV holds after a result, which is `difference` modulo 2**16 (isa.md §3.2)."""
    zero, negative = difference & 0xFFFF == 0, bool(difference & 0x8000)
    return {"Z": zero, "NZ": not zero, "N": negative, "NN": not negative, "GEU": carry, "LTU": not carry,
            "GTU": carry and not zero, "LEU": not carry or zero}[condition]  # fmt: skip


def signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word


def compared(condition: str, a: int, b: int) -> bool:
    """Whether a condition holds after CP a, b."""
    relations = {"LT": signed(a) < signed(b), "LE": signed(a) <= signed(b), "GT": signed(a) > signed(b),
                 "GE": signed(a) >= signed(b)}  # fmt: skip
    return relations[condition] if condition in relations else holds(condition, a - b, a >= b)


CONDITIONS = ("Z", "NZ", "N", "NN", "GEU", "LTU", "GTU", "LEU", "LT", "LE", "GT", "GE")


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_comparison_keeps_all_pairs_for_which_its_condition_holds(condition: str) -> None:
    """For all pairs of intervals between the edges, each edge in a pair that fulfils the condition remains. If two
    values of equal sign do not fulfil it, the outcome is impossible."""
    ranges = list(combinations_with_replacement(EDGES, 2))
    for (al, ah), (bl, bh) in product(ranges, ranges):
        narrow = _narrow(condition, interval(al, ah), interval(bl, bh))
        pairs = [(a, b) for a in EDGES for b in EDGES
                 if al <= a <= ah and bl <= b <= bh and compared(condition, a, b)]  # fmt: skip
        if narrow is None:
            assert not pairs, (al, ah, bl, bh)
            continue
        assert pairs or (al, bl) != (ah, bh) or (al ^ bl) & 0x8000, (al, bl)
        (low, high), (least, most) = extremes(narrow[0]), extremes(narrow[1])
        assert all(low <= a <= high and least <= b <= most for a, b in pairs), (al, ah, bl, bh)


WRITES = {
    "ADD{.B} Wb, #lit5, Wd": (lambda a: a + 5, lambda a: a + 5 > 0xFFFF),
    "SUB{.B} Wb, #lit5, Wd": (lambda a: a - 5, lambda a: a >= 5),
    "INC{.B} Ws, Wd": (lambda a: a + 1, lambda a: a == 0xFFFF),
    "DEC{.B} Ws, Wd": (lambda a: a - 1, lambda a: a >= 1),
    "DEC2{.B} Ws, Wd": (lambda a: a - 2, lambda a: a >= 2),
    "AND{.B} Wb, #lit5, Wd": (lambda a: a & 5, None),
}
"""Result and carry of W2 = W1 op 5; None: the instruction leaves the carry as it was."""


@pytest.mark.parametrize("syntax", WRITES)
def test_a_result_keeps_all_values_for_which_the_condition_of_its_flags_holds(syntax: str) -> None:
    """For every interval of the source, the result's abstract value keeps each value for which the branch is taken."""
    row = next(row for row in ROWS if row.syntax == syntax)
    insn = decode_for_execution(*encode(row, {"w": 1, "s": 1, "d": 2, "k": 5}))
    assert insn is not None
    step = Instruction(0x200, insn, 0x202, 1, 0, 1 << 2, 0, None)
    result, carries = WRITES[syntax]
    for low, high in combinations_with_replacement(EDGES, 2):
        members = [a for a in EDGES if low <= a <= high]
        results = [result(a) & 0xFFFF for a in members]
        before: list[Value] = [interval(0, 0xFFFF)] * 16
        before[1] = interval(low, high)
        after = list(before)
        least, most = result(low), result(high)
        wraps = least >> 16 != most >> 16 or "AND" in syntax
        after[2] = interval(0, 0xFFFF) if wraps else interval(least & 0xFFFF, most & 0xFFFF)
        flags = FlagResult.of(step, before, after)
        for condition in CONDITIONS[:8]:
            now = flags.restrict(condition, after[2])
            for a, value in zip(members, results, strict=True):
                taken = [holds(condition, value, carry) for carry in
                         ((False, True) if carries is None else (carries(a),))]  # fmt: skip
                if any(taken):
                    assert now is not None, (condition, low, high, a)
                    least, most = extremes(now)
                    assert least <= value <= most, (condition, low, high, a)
