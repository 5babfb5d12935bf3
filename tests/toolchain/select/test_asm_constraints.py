"""Register letters of XC16 in inline assembly, and refused uses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.toolchain.c_programs import build, run
from toolchain.driver import driver
from toolchain.frontend.asm_constraints import CLASSES

ONE = """
volatile int in = 7;
int main(void)
{
    int out, both = 5;
    __asm__ volatile("mov %%1,w6\\n mov w6,%%0 ; letter %%0 %%1" : "=%(letter)s"(out) : "%(letter)s"(in) : "w6");
    return out;
}
"""
SEVERAL = """
volatile int five = 5, seven = 7;
int f(int x, int y)
{
    int low, product = x;
    __asm__ volatile("mul.uu %[a],%[b],w6\\n mov w6,%0" : "=a"(low) : [a] "z"(x), [b] "z"(y) : "w6", "w7");
    __asm__ volatile("add %0,%1,%0" : "+b"(product) : "c"(y));
    return low * 100 + product;
}
int main(void) { return f(five, seven); }
"""


@pytest.mark.slow
@pytest.mark.parametrize("letter", sorted(CLASSES))
@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_a_letter_is_a_register_of_its_class(letter: str, level: str, tmp_path: Path) -> None:
    """Each constraint letter selects a register of its class (XC16 User's Guide, "register letters supported by the
    compiler")."""
    (tmp_path / "one.c").write_text(ONE % {"letter": letter})
    built = build([tmp_path / "one.c"], tmp_path / "one.s", level, "-S", "-fno-lto")
    assert built.status == 0, built.messages
    named = re.findall(r"; letter w(\d+) w(\d+)", (tmp_path / "one.s").read_text())
    assert named
    assert {int(r) for pair in named for r in pair} <= set(CLASSES[letter])
    built = build([tmp_path / "one.c"], tmp_path / "one.elf", level)
    assert built.status == 0, built.messages
    assert run(tmp_path / "one.elf").status == 7


@pytest.mark.parametrize("level", ["-O0", "-O1", "-Os", "-O2"])
def test_letters_of_several_operands(level: str, tmp_path: Path) -> None:
    """Letters work for named operands, read-write operands and two operands of one class."""
    (tmp_path / "several.c").write_text(SEVERAL)
    built = build([tmp_path / "several.c"], tmp_path / "several.elf", level)
    assert built.status == 0, built.messages
    assert run(tmp_path / "several.elf").status == 3512


REFUSED = {
    'int main(void) {\n  __asm__ goto("bra %l[out]" : : : : out);\nout: return 2; }\n': "asm goto",
    'int main(void) {\n  int p, q;\n  __asm__("nop" : "=a"(p), "=a"(q));\n  return p + q; }\n': "constraint 'a'",
    'int main(void) {\n  int p;\n  __asm__("nop" : "=t"(p));\n  return p; }\n': "constraint '=t'",
}


@pytest.mark.parametrize("text", REFUSED, ids=list(REFUSED.values()))
@pytest.mark.parametrize("options", [(), ("-Os",), ("-O1", "-fno-lto"), ("-g",)], ids=" ".join)
def test_what_is_refused_names_its_line(
    text: str, options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "main.c"
    source.write_text(text)
    assert driver.main([*options, str(source), "-o", str(tmp_path / "x.elf")]) in (1, 2)
    said = capsys.readouterr().err
    line = next(n for n, one in enumerate(text.splitlines(), 1) if "__asm__" in one)
    assert f"main.c:{line}:" in said
    assert REFUSED[text] in said
