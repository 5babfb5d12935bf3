"""Selection rules of operations with a constant operand.

A rule consists of a condition on the constant, an operation and a form. The first rule whose condition is true applies.
Every form is one word:
    unary     op Ws, Wd                    (Ws may be memory)
    lit5      op Wb, #k, Wd                k transformed by `literal`
    tied      op #k, Wn                    two-address: Wn starts as a copy of the source
    bit       op Wn, #log2(k)              two-address, bit number
Sources: isa.md §3.2 (literal ranges), §5.1 and §5.4 (forms).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from toolchain.abi.target import LIT5_MAX, LIT10_BYTE_MAX, LIT10_MAX

ImmediateForm = Literal["unary", "lit5", "tied", "bit"]


@dataclass(frozen=True, slots=True)
class ImmediateRule:
    """One form of an operation with a constant; `when` and `literal` receive k as unsigned value of `bits` bits."""

    when: Callable[[int, int], bool]
    op: str
    form: ImmediateForm
    literal: Callable[[int, int], int]


def _same(k: int, bits: int) -> int:
    return k


def _negated(k: int, bits: int) -> int:
    return -k & ((1 << bits) - 1)


def _bit(k: int, bits: int) -> int:
    return k.bit_length() - 1


def _zero_bit(k: int, bits: int) -> int:
    return _bit(~k & ((1 << bits) - 1), bits)


def _is(value: int) -> Callable[[int, int], bool]:
    return lambda k, bits: k == value & ((1 << bits) - 1)


def _lit5(k: int, bits: int) -> bool:
    return k <= LIT5_MAX


def _negative_lit5(k: int, bits: int) -> bool:
    return _negated(k, bits) <= LIT5_MAX


def _lit10(k: int, bits: int) -> bool:
    return k <= (LIT10_BYTE_MAX if bits == 8 else LIT10_MAX)


def _negative_lit10(k: int, bits: int) -> bool:
    return _lit10(_negated(k, bits), bits)


def _one_bit(k: int, bits: int) -> bool:
    return k != 0 and k & (k - 1) == 0


def _all_but_one_bit(k: int, bits: int) -> bool:
    return _one_bit(~k & ((1 << bits) - 1), bits)


IMMEDIATE: dict[str, list[ImmediateRule]] = {
    "add": [
        ImmediateRule(_is(1), "inc", "unary", _same),
        ImmediateRule(_is(2), "inc2", "unary", _same),
        ImmediateRule(_is(-1), "dec", "unary", _same),
        ImmediateRule(_is(-2), "dec2", "unary", _same),
        ImmediateRule(_lit5, "add", "lit5", _same),
        ImmediateRule(_negative_lit5, "sub", "lit5", _negated),
        ImmediateRule(_lit10, "addl", "tied", _same),
        ImmediateRule(_negative_lit10, "subl", "tied", _negated),
    ],
    "and": [
        ImmediateRule(_lit5, "and", "lit5", _same),
        ImmediateRule(lambda k, bits: bits == 16 and k == 0xFF, "ze", "unary", _same),
        ImmediateRule(_all_but_one_bit, "bclr", "bit", _zero_bit),
        ImmediateRule(_lit10, "andl", "tied", _same),
    ],
    "or": [
        ImmediateRule(_lit5, "ior", "lit5", _same),
        ImmediateRule(_one_bit, "bset", "bit", _bit),
        ImmediateRule(_lit10, "iorl", "tied", _same),
    ],
    "xor": [
        ImmediateRule(_is(-1), "com", "unary", _same),
        ImmediateRule(_lit5, "xor", "lit5", _same),
        ImmediateRule(_one_bit, "btg", "bit", _bit),
        ImmediateRule(_lit10, "xorl", "tied", _same),
    ],
}

REGISTER_OP = {"add": "add", "sub": "sub", "and": "and", "or": "ior", "xor": "xor"}
COMMUTES = frozenset(("add", "and", "or", "xor"))
# Operation on the second and later words of a multi-word operation (carry in; Z is sticky, isa.md §6.1).
CARRY_OP = {"add": "addc", "sub": "subb", "and": "and", "or": "ior", "xor": "xor"}

# Branch condition after CP by predicate of icmp (isa.md §7.2).
CONDITION = {
    "eq": "z", "ne": "nz", "slt": "lt", "sle": "le", "sgt": "gt", "sge": "ge",
    "ult": "nc", "uge": "c", "ugt": "gtu", "ule": "leu",
}  # fmt: skip

# File-register instruction by operation and constant, for a read-modify-write of a near object (isa.md §5.1, §5.4).
FILE_UNARY = {("add", 1): "incf", ("add", -1): "decf", ("add", 2): "inc2f", ("add", -2): "dec2f", ("xor", -1): "comf",
              ("shl", 1): "slf", ("lshr", 1): "lsrf", ("ashr", 1): "asrf"}  # fmt: skip
FILE_BINARY = {"add": "addf", "sub": "subf", "and": "andf", "or": "iorf", "xor": "xorf"}
FILE_CARRY = FILE_BINARY | {"add": "addcf", "sub": "subbf"}


def immediate_rule(op: str, k: int, bits: int) -> ImmediateRule | None:
    """The first rule for `op` with constant `k`; None if the constant needs a register."""
    for rule in IMMEDIATE.get(op, ()):
        if rule.when(k, bits):
            return rule
    return None
