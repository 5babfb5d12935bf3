"""Unreferenced definitions that the image must contain: attributes `used`, `retain` and XC16's `keep`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import Built, build
from toolchain.commands import archiver
from toolchain.elf.read import read_executable

LEVELS = ["-O0", "-O1", "-Os", "-O2"]
ALONE = ["", "-fno-lto"]

MARKED = """
__attribute__((used)) void used_function(void) {}
static __attribute__((used)) void used_static(void) {}
__attribute__((used)) int used_zero;
static int used_value __attribute__((used)) = 5;
__attribute__((used)) const int used_constant = 6;
__attribute__((used, section("mine"))) void used_elsewhere(void) {}
__attribute__((retain)) void retained(void) {}
__attribute__((keep)) void kept_function(void) {}
int kept_value __attribute__((keep)) = 7;
static int behind = 8;
__attribute__((used)) int *used_pointer(void) { return &behind; }
__attribute__((used)) int used_counter;
__attribute__((used)) int used_reader(void) { return used_counter; }
void plain_function(void) {}
int plain_value = 9;
"""
NAMES = {
    "_used_function", "_used_static", "_used_zero", "_used_value", "_used_constant", "_used_elsewhere", "_retained",
    "_kept_function", "_kept_value", "_behind", "_used_pointer", "_used_counter", "_used_reader",
}  # fmt: skip


def names_of(built: Built, image: Path) -> set[str]:
    """Return the symbols of a linked image."""
    assert built.status == 0, built.messages
    return {symbol.name for symbol in read_executable(image.read_bytes(), image.name).symbols}


@pytest.mark.parametrize("alone", ALONE)
@pytest.mark.parametrize("level", LEVELS)
def test_used_definitions_remain_in_the_image(level: str, alone: str, tmp_path: Path) -> None:
    """Definitions with the attribute and their references remain; others are removed, and no helper symbol is added."""
    (tmp_path / "a.c").write_text(MARKED + "int main(void) { return 0; }\n")
    names = names_of(build([tmp_path / "a.c"], tmp_path / "a.elf", level, *alone.split(), "-Wall"), tmp_path / "a.elf")
    assert not NAMES - names
    assert not {"_plain_function", "_plain_value"} & names
    assert not [name for name in names if name.startswith("__keep_")]


@pytest.mark.parametrize("level", ["-O0", "-Os"])
def test_used_definitions_of_objects_and_archives_remain(level: str, tmp_path: Path) -> None:
    """Only referenced members of an archive are linked, as by GNU's linker; in these, used definitions remain."""
    (tmp_path / "main.c").write_text("int wanted(void); int main(void) { return wanted(); }\n")
    (tmp_path / "direct.c").write_text("__attribute__((used)) void in_object(void) {}\n")
    (tmp_path / "one.c").write_text(
        "__attribute__((used)) void in_member(void) {} static void gone(void) {}\n"
        "void (*unwanted)(void) = gone; int wanted(void) { return 1; }\n"
    )
    (tmp_path / "two.c").write_text("__attribute__((used)) void in_other_member(void) {}\n")
    for name in ("main", "direct", "one", "two"):
        built = build([tmp_path / f"{name}.c"], tmp_path / f"{name}.o", level, "-c")
        assert built.status == 0, built.messages
    assert archiver.main(["rcs", *(str(tmp_path / n) for n in ("lib.a", "one.o", "two.o"))]) == 0
    sources = [tmp_path / n for n in ("main.o", "direct.o", "lib.a")]
    names = names_of(build(sources, tmp_path / "a.elf", level), tmp_path / "a.elf")
    assert {"_in_object", "_in_member", "_wanted"} <= names
    assert not {"_in_other_member", "_unwanted", "_gone"} & names


def test_a_section_remains_if_its_second_function_is_used(tmp_path: Path) -> None:
    """A section remains if any of its functions has the attribute, in any order of definitions."""
    (tmp_path / "a.c").write_text(
        '__attribute__((section("mine"))) void first(void) {}\n'
        '__attribute__((section("mine"), used)) void second(void) {}\nint main(void) { return 0; }\n'
    )
    names = names_of(build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-fno-lto"), tmp_path / "a.elf")
    assert {"_first", "_second"} <= names


def test_used_functions_are_not_specialised(tmp_path: Path) -> None:
    """Whole-program optimisation specialises neither the argument of a used function nor the value of its variable."""
    (tmp_path / "a.c").write_text(
        "__attribute__((used)) int factor = 1;\n"
        "__attribute__((used, noinline)) int twice(int n) { return factor ? n + n : 7; }\n"
        "int main(void) { return twice(2); }\n"
    )
    (tmp_path / "b.s").write_text(" .section .text,code\n nop\n")
    built = build([tmp_path / "a.c"], tmp_path / "a.elf", "-Os", "-save-temps")
    assert built.status == 0, built.messages
    text = (tmp_path / "a.s").read_text()
    assert ".global _twice" in text
    body = text.split("_twice:\n", 1)[1].split(".size", 1)[0]
    assert "_factor" in body
    assert "add w0,w0,w0" in body or "sl w0,w0" in body
