"""Assignments of volatile single-bit fields are one instruction: BSET, BCLR or BTG (isa.md §5.4)."""

from __future__ import annotations

import pytest

from tests.toolchain.compiled import assembly, body

TOGGLES = {
    "xor": "LATDbits.LATD3 ^= 1",
    "not": "LATDbits.LATD3 = !LATDbits.LATD3",
    "complement": "LATDbits.LATD3 = ~LATDbits.LATD3",
    "difference": "LATDbits.LATD3 = 1 - LATDbits.LATD3",
    "macro": "_LATD3 ^= 1",
    "increment": "LATDbits.LATD3++",
    "comparison": "LATDbits.LATD3 = LATDbits.LATD3 == 0",
    "choice": "LATDbits.LATD3 = LATDbits.LATD3 ? 0 : 1",
}
OWN = "volatile struct { unsigned a : 1, b : 3, c : 1, : 11, d : 1; } own;\n"
OWN += "void own_bit(void) { own.d = !own.d; own.c ^= 1; }"


@pytest.mark.parametrize("level", ["0", "1", "s", "2"])
def test_toggling_a_bit_is_one_instruction(level: str) -> None:
    """Every way to write that a bit is inverted becomes BTG, which reads the register once."""
    source = "#include <xc.h>\n" + "".join(f"void {name}(void) {{ {text}; }}\n" for name, text in TOGGLES.items())
    text = assembly(source + OWN, level)
    assert {name: body(text, name)[0] for name in TOGGLES} == dict.fromkeys(TOGGLES, "btg _LATDbits,#3")
    assert all(body(text, name)[1:] == ["return"] for name in TOGGLES)
    assert [line.split()[0].removesuffix(".b") for line in body(text, "own_bit")] == ["btg", "btg", "return"]


def test_a_bit_that_depends_on_another_one_is_no_toggle() -> None:
    """A bit that gets the complement of another bit, or of another register's bit, is not inverted."""
    source = "#include <xc.h>\nvoid f(void) { LATDbits.LATD3 = !LATDbits.LATD4; }\n"
    source += "void g(void) { LATDbits.LATD3 = !LATFbits.LATF3; }"
    text = assembly(source, "s")
    assert not any(line.startswith("btg") for name in "fg" for line in body(text, name))


def test_a_bit_from_a_variable_is_written_by_one_instruction_without_optimisation() -> None:
    """At -O0, too, an interrupt between read and write of the register cannot change other bits."""
    text = assembly("#include <xc.h>\nvoid f(int x) { LATDbits.LATD3 = x; }", "0")
    lines = body(text, "f")
    assert "bset _LATDbits,#3" in lines
    assert "bclr _LATDbits,#3" in lines
    assert not any(line.endswith(",_LATDbits") for line in lines)
