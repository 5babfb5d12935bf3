"""Volatile accesses: their number, order and width in the code are those of the source, at every level (C11 5.1.2.3p6).

An access of 32 or 64 bits is made word by word, low word first, and MOV.D counts as its two words; XC16 does the same.
"""

from __future__ import annotations

import pytest

from tests.toolchain.lower.compiled import assembly, body

LEVELS = ("0", "1", "s", "2")
DECLARED = "extern volatile unsigned A, B; extern volatile unsigned char C; extern volatile unsigned long L;"

ORDERED = [
    ("high word stored first", "void f(volatile unsigned *p){ p[1] = 5; p[0] = 7; }", ["[w+2]=", "[w]="]),
    ("low word stored first", "void f(volatile unsigned *p){ p[0] = 5; p[1] = 7; }", ["[w]=", "[w+2]="]),
    ("high word loaded first", "unsigned f(volatile unsigned *p){ unsigned h = p[1]; return h - p[0]; }",
     ["[w+2]", "[w]"]),
    ("a register pair stored high word first",
     "void f(volatile unsigned *p, int x, unsigned l, unsigned h){ p[1] = h; p[0] = l; }", ["[w+2]=", "[w]="]),
    ("a register pair loaded high word first",
     "unsigned long f(volatile unsigned *p){ unsigned long h = p[1]; return h << 16 | p[0]; }", ["[w+2]", "[w]"]),
    ("a discarded long is read", "void f(volatile unsigned long *p){ (void)*p; }", ["[w]", "[w+2]"]),
    ("a discarded long long is read", "void f(volatile unsigned long long *p){ (void)*p; }",
     ["[w]", "[w+2]", "[w+4]", "[w+6]"]),
    ("a discarded near long is read", "void f(void){ (void)L; }", ["_L", "_L+2"]),
    ("a long is written low word first", "void f(unsigned long v){ L = v; }", ["_L=", "_L+2="]),
    ("a near long is read before it is written", "void f(void){ L++; }", ["_L", "_L+2", "_L=", "_L+2="]),
    ("near words in the order of the source", "void f(void){ A = 1; B = 0; A = 0; (void)B; }",
     ["_A=", "_B=", "_A=", "_B"]),
    ("one bit in place", "void f(void){ A |= 4; B &= ~8; A ^= 1; }", ["_A", "_A=", "_B", "_B=", "_A", "_A="]),
    ("a byte twice", "unsigned char f(void){ unsigned char x = C; return x + C; }", ["_C", "_C"]),
    ("a poll reads every time", "unsigned f(void){ while (!(A & 2)) ; return B; }", ["_A", "_B"]),
    ("both sides of a choice", "unsigned f(int c){ unsigned a = A, b = B; return c ? a : b; }", ["_A", "_B"]),
]  # fmt: skip


def accesses(lines: list[str]) -> list[str]:
    """Memory accesses of straight-line code in order: the place, with = behind it when written."""
    out: list[str] = []
    for line in lines:
        op, _, rest = line.partition(" ")
        operands = [_place(a) for a in rest.split(",")]
        wide = ["", "+2"] if op == "mov.d" else [""]
        if op in ("bset", "bclr", "btg", "inc", "ior", "and", "bset.b", "bclr.b", "btg.b") and operands[0][:1] == "_":
            out += [operands[0], operands[0] + "="]
        elif op in ("clr", "setm", "clr.b"):
            out += [operands[0] + "="] if operands[0] else []
        else:
            out += [_later(operands[0], k) for k in wide if operands[0]]
            out += [_later(operands[-1], k) + "=" for k in wide if len(operands) > 1 and operands[-1]]
    return [a for a in out if not a.startswith(("[w15", "[w14"))]


def _place(operand: str) -> str:
    """A memory operand with the register's number left out, "" for anything else."""
    if operand.startswith("[w") and not operand.startswith(("[w15", "[w14")):
        return "[w" + operand.lstrip("[w0123456789")
    return operand if operand.startswith("_") else ""


def _later(place: str, words: str) -> str:
    return place if not words else place[:-1] + words + "]" if place.endswith("]") else place + words


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(("source", "expected"), [row[1:] for row in ORDERED], ids=[row[0] for row in ORDERED])
def test_accesses_stay_in_number_and_order(level: str, source: str, expected: list[str]) -> None:
    """The same sequence at each level."""
    assert accesses(body(assembly(DECLARED + source, level), "f")) == expected
