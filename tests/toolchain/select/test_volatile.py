"""Volatile accesses have the number, order and width of the source at every level (C11 5.1.2.3p6).

An access of 32 or 64 bits is made by words, low word first. MOV.D counts as two words. XC16 does the same.
"""

from __future__ import annotations

import pytest

from tests.toolchain.compiled import assembly, body

LEVELS = ("0", "1", "s", "2")
DECLARED = """extern volatile unsigned A, B; extern volatile unsigned char C; extern volatile unsigned long L;
extern volatile struct { unsigned a : 1, b : 1, : 14; } F;"""

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
    """Return the memory accesses of straight-line code in order: the address, followed by = for a write."""
    out: list[str] = []
    for line in lines:
        op, _, rest = line.partition(" ")
        operands = [_address_operand(a) for a in rest.split(",")]
        wide = ["", "+2"] if op == "mov.d" else [""]
        if op in ("bset", "bclr", "btg", "inc", "ior", "and", "bset.b", "bclr.b", "btg.b") and operands[0][:1] == "_":
            out += [operands[0], operands[0] + "="]
        elif op in ("clr", "setm", "clr.b"):
            out += [operands[0] + "="] if operands[0] else []
        else:
            out += [_at_offset(operands[0], k) for k in wide if operands[0]]
            out += [_at_offset(operands[-1], k) + "=" for k in wide if len(operands) > 1 and operands[-1]]
    return [a for a in out if not a.startswith(("[w15", "[w14"))]


def _address_operand(operand: str) -> str:
    """Return a memory operand without its register number, or "" for other operands."""
    if operand.startswith("[w") and not operand.startswith(("[w15", "[w14")):
        return "[w" + operand.lstrip("[w0123456789")
    return operand if operand.startswith("_") else ""


def _at_offset(place: str, words: str) -> str:
    return place if not words else place[:-1] + words + "]" if place.endswith("]") else place + words


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(("source", "expected"), [row[1:] for row in ORDERED], ids=[row[0] for row in ORDERED])
def test_accesses_have_the_number_and_order_of_the_source(level: str, source: str, expected: list[str]) -> None:
    """The sequence of volatile accesses equals the source's at each level."""
    assert accesses(body(assembly(DECLARED + source, level), "f")) == expected


BITS = [
    ("another bit in each branch", "void f(int x){ if (x) A |= 4; else A &= ~8; }", ["bclr _A,#3", "bset _A,#2"]),
    ("the same bit", "void f(int x){ if (x) A |= 4; else A &= ~4; }", ["bclr _A,#2", "bset _A,#2"]),
    ("of a byte", "void f(int x){ if (x) C |= 4; else C ^= 128; }", ["bset.b _C,#2", "btg.b _C,#7"]),
    ("behind calls",
     "void g(void); void f(int x){ if (x) { g(); A |= 4; } else if (B) A &= ~4; else { g(); A |= 8; } }",
     ["bclr _A,#2", "bset _A,#2", "bset _A,#3"]),
    ("of a variable at an address", """#define D (*(volatile unsigned *)0x2D6)
     void f(int x){ if (x) D |= 4; else D &= ~8; }""", ["bclr 0x02D6,#3", "bset 0x02D6,#2"]),
    ("in a loop", "void f(int n){ while (n--) { if (B & 2) A |= 4; else A &= ~8; } }", ["bclr _A,#3", "bset _A,#2"]),
    ("beside a whole value", "void f(int x){ if (x & 1) A |= 4; else A = x; B = 1; }", ["bset _A,#2"]),
    ("by a bit of an argument", "void f(int x){ if (x & 1) A |= 8; else A &= ~8; }", ["bclr _A,#3", "bset _A,#3"]),
    ("by a bit above", "void f(int x){ if (x & 0x400) A |= 8; else A &= ~8; }", ["bclr _A,#3", "bset _A,#3"]),
    ("by a sign", "void f(int x){ if (x < 0) A &= 0x7FFF; else A |= 0x8000; }", ["bclr _A,#15", "bset _A,#15"]),
    ("of a byte by a bit of a word", "void f(int x){ if (x & 0x400) C |= 2; else C &= ~2; }",
     ["bclr.b _C,#1", "bset.b _C,#1"]),
    ("a bit that is copied", "void f(void){ F.a = F.b; }", ["bclr _F,#0", "bset _F,#0"]),
    ("a bit that is turned", "void f(void){ F.a ^= 1; }", ["btg _F,#0"]),
    ("the contrary of a bit", "void f(void){ F.b = !F.a; }", ["bclr _F,#1", "bset _F,#1"]),
    ("in a switch", """void f(int x){ switch (x) { case 0: A |= 1; break; case 1: A &= ~1; break;
     case 2: A |= 2; break; default: A &= ~2; } }""", ["bclr _A,#0", "bclr _A,#1", "bset _A,#0", "bset _A,#1"]),
]  # fmt: skip


@pytest.mark.parametrize("level", LEVELS[1:])
@pytest.mark.parametrize(("source", "expected"), [row[1:] for row in BITS], ids=[row[0] for row in BITS])
def test_single_bit_writes_in_branches_are_one_instruction_each(level: str, source: str, expected: list[str]) -> None:
    """A single-bit write in a branch is one instruction.

    Storing the whole word would overwrite changes that an interrupt makes after the load (isa.md §5.4).
    """
    lines = body(assembly(f"{DECLARED}\n{source}", level), "f")
    assert sorted(line for line in lines if line.startswith(("bset", "bclr", "btg"))) == expected
    assert not any(line.startswith("mov _A,") for line in lines)


@pytest.mark.parametrize("level", LEVELS)
def test_bit_fields_are_set_and_cleared_by_one_instruction(level: str) -> None:
    """A bit-field is set and cleared by one instruction (BSET, BCLR), as programs for XC16 rely on.

    The front end clears a field before it sets it.
    """
    near = body(assembly(f"{DECLARED} void f(void) {{ F.a = 1; F.b = 0; F.b = 1; }}", level), "f")
    assert [line for line in near if "_F" in line] == ["bset _F,#0", "bclr _F,#1", "bset _F,#1"]
    assert not any(line.startswith("mov") for line in near)
    text = assembly("struct S { unsigned a : 1, b : 1, : 14; }; void f(volatile struct S *p) { p->b = 1; }", level)
    operands = [line.split()[1].split(",")[0] for line in body(text, "f") if line.startswith("bset")]
    assert [_address_operand(operand) for operand in operands] == ["[w]"]
