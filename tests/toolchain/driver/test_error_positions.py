"""Errors of the assembler and the linker have the position of the C source."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolchain.driver import driver

CURE = "define '{}', or name its source, object or library (-l) on the command line"
OPTIONS = [(), ("-Os",), ("-g",), ("-Os", "-fno-lto"), ("-O2", "-g", "-fno-lto")]


@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
def test_an_undefined_symbol_names_the_lines_that_use_it(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "main.c"
    text = "extern int missing(int);\nextern int gone;\nint main(void) {\n  return missing(3)\n    + gone;\n}\n"
    source.write_text(text)
    image = tmp_path / "x.elf"
    assert driver.main([*options, str(source), "-o", str(image)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said == [
        f"{source}:4: error: undefined symbol _missing, used in function 'main'; {CURE.format('missing')}",
        f"{source}:5: error: undefined symbol _gone, used in function 'main'; {CURE.format('gone')}",
    ]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["main.c"]


@pytest.mark.parametrize("options", [*OPTIONS, ("-c",), ("-c", "-Os")], ids=" ".join)
def test_a_wrong_instruction_in_inline_assembly_names_its_line(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "main.c"
    text = '\nint main(void) {\n  __asm__ volatile("nop");\n  __asm__ volatile("frob w0");\n  return 0;\n}\n'
    source.write_text(text)
    assert driver.main([*options, str(source), "-o", str(tmp_path / "x")]) == 2
    assert f"{source}:4: error: unknown instruction 'frob'" in capsys.readouterr().err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["main.c"]


def test_a_source_beside_the_present_folder_is_named_in_full(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors name a source outside of the current folder with its full path, although clang shortens it."""
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    source = tmp_path / "there" / "main.c"
    source.write_text("int main(void) { extern int missing(void); return missing(); }\n")
    assert driver.main([str(source), "-o", "x.elf"]) == 2
    assert capsys.readouterr().err.startswith(f"{source}:1: error: undefined symbol _missing")


@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
@pytest.mark.parametrize(("line", "said"), [
    ("int kept __attribute__((persistent, used)) = 4;",
     "section .pbss has no content: only zero may be stored into it at _kept"),
    ("int t[16] __attribute__((reverse(48), used));",
     "section .nbss._t: reverse(48) is not a power of two up to 32768"),
    ("void __attribute__((interrupt(irq(3)), no_auto_psv)) _T1Interrupt(void) {}",
     "symbol __T1Interrupt is already defined"),
    ('__attribute__((used)) int f(int a) { __asm__("nop\\n nop\\n frob"); return a; }', "unknown instruction 'frob'"),
], ids=["variable", "section", "function", "third line of a text"])  # fmt: skip
def test_assembler_errors_of_a_declaration_name_its_line(
    line: str, said: str, options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An assembler error caused by a declaration has the declaration's position, not a line of generated assembly."""
    source = tmp_path / "main.c"
    source.write_text(f'void first(void) {{ __asm__("nop"); }}\n\n\n{line}\nint main(void) {{ return 0; }}\n')
    assert driver.main([*options, str(source), "-o", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err.splitlines() == [f"{source}:4: error: {said}"]


def test_a_global_variable_in_a_register_is_refused_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "main.c"
    source.write_text('register int r5 __asm__("w5");\nint main(void) {\n  return r5;\n}\n')
    assert driver.main([str(source), "-o", str(tmp_path / "x")]) == 2
    said = "a global variable in a register: only A and B, the accumulators, can be one"
    assert capsys.readouterr().err == f"{source}:3: error: not supported: {said}\n"


@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
@pytest.mark.parametrize(("declared", "said"), [
    ("struct __attribute__((packed)) { char a; int *p; } volatile odd = { 1, (int *)&n };",
     "address in an initialiser at an odd offset (packed struct)"),
    ("int f(int k) { static const int step[] = { &&a - &&a, &&b - &&a }; goto *(&&a + step[k]); a: n++; b: return n; }",
     "a difference of labels in an initialiser: keep the labels themselves (&&label)"),
], ids=["odd address", "labels"])  # fmt: skip
def test_a_refused_initialiser_names_the_line_of_its_variable(
    declared: str, said: str, options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A refused initialiser is reported at its variable, without mention of generated assembly."""
    source = tmp_path / "main.c"
    read = "f(n)" if "f(int" in declared else "*odd.p"
    source.write_text(f"volatile int n;\n\n{declared}\nint main(void) {{ return {read}; }}\n")
    assert driver.main([*options, str(source), "-o", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err == f"{source}:3: error: not supported: {said}\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["main.c"]


HANDLER = "void __attribute__((interrupt{}, no_auto_psv)) {}({}) {{}}"
REFUSED = [
    (HANDLER.format("", "_T1Interrupt", "int x"), "an interrupt function takes and returns nothing"),
    (HANDLER.format(", auto_psv", "_T1Interrupt", "void"), "both auto_psv and no_auto_psv"),
    (HANDLER.format("", "_T9Int", "void"), "interrupt function '_T9Int' does not have a vector's name"),
    (HANDLER.format("(irq(99))", "f", "void"), "interrupt function 'f': irq(99) is not an interrupt number"),
    ("void _T1Interrupt(void) {}", "function '_T1Interrupt' has the name of an interrupt vector"),
    ("__attribute__((used)) int f(int n) { volatile char a[40000]; a[n] = 1; return a[3]; }", "(limit 16382)"),
    ("""volatile int v; __attribute__((used)) void f(void) { __asm__("" :: "r"(v), "r"(v), "r"(v), "r"(v), "r"(v),
     "r"(v) : "w0", "w1", "w2", "w3", "w4", "w5", "w6", "w7", "w8", "w9"); }""",
     "inline assembly: its operands and clobbers need more registers than the CPU has"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
@pytest.mark.parametrize(("line", "said"), REFUSED, ids=[row[1] for row in REFUSED])
def test_what_is_refused_of_a_function_names_its_line(
    line: str, said: str, options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "main.c"
    source.write_text(f"\n{line}\nint main(void) {{ return 0; }}\n")
    assert driver.main([*options, str(source), "-o", str(tmp_path / "x.elf")]) == 2
    assert f"{source}:2" in (heard := capsys.readouterr().err)
    assert said in heard
    assert sorted(p.name for p in tmp_path.iterdir()) == ["main.c"]
