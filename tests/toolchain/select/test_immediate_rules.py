"""Selection rules with immediate operands compute their operation for every constant that they accept."""

from __future__ import annotations

import pytest

from toolchain.abi.target import LIT5_MAX, LIT10_BYTE_MAX, LIT10_MAX
from toolchain.select.rules import IMMEDIATE, ImmediateRule, immediate_rule

MEANING = {"add": lambda a, k: a + k, "and": lambda a, k: a & k, "or": lambda a, k: a | k, "xor": lambda a, k: a ^ k}


def machine(rule: ImmediateRule, a: int, literal: int, bits: int) -> int:
    """Return the result of a rule's instruction (isa.md §6)."""
    mask = (1 << bits) - 1
    unary = {"inc": a + 1, "inc2": a + 2, "dec": a - 1, "dec2": a - 2, "com": ~a, "ze": a & 0xFF}
    match rule.op.removesuffix("l") if rule.form == "tied" else rule.op:
        case "add":
            value = a + literal
        case "sub":
            value = a - literal
        case "and":
            value = a & literal
        case "ior":
            value = a | literal
        case "xor":
            value = a ^ literal
        case "bset":
            value = a | 1 << literal
        case "bclr":
            value = a & ~(1 << literal)
        case "btg":
            value = a ^ 1 << literal
        case op:
            value = unary[op]
    return value & mask


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("op", sorted(IMMEDIATE))
def test_a_constant_rule_computes_the_operation_within_its_literal_range(op: str, bits: int) -> None:
    """A constant rule computes its operation for every literal in range: lit5 0..31, lit10 0..1023, bytes 0..255.

    Source: isa.md §3.2.
    """
    mask = (1 << bits) - 1
    limits = {"lit5": LIT5_MAX, "tied": LIT10_BYTE_MAX if bits == 8 else LIT10_MAX, "bit": bits - 1}
    for k in range(mask + 1):
        rule = immediate_rule(op, k, bits)
        if rule is None:
            continue
        literal = rule.literal(k, bits)
        assert rule.form == "unary" or 0 <= literal <= limits[rule.form]
        for a in (0, 1, 0x5A, 0xFF, 0x1234, 0x8000, 0xFFFF):
            assert machine(rule, a & mask, literal, bits) == MEANING[op](a & mask, k) & mask


def test_constants_that_fit_no_literal_need_a_register() -> None:
    """No rule accepts a constant beyond the range of its literal, which then needs a register."""
    assert immediate_rule("add", 0x1234, 16) is None
    assert immediate_rule("and", 0x1234, 16) is None
    assert immediate_rule("add", 0x1234 & 0xFF, 8) is not None
