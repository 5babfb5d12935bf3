"""Errors that the assembler and the linker find stand at the line of the C source."""

from __future__ import annotations

from pathlib import Path

import pytest

from toolchain import driver

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
        f"{source}:4: error: undefined symbol _missing, used in function 'main'",
        f"{source}:5: error: undefined symbol _gone, used in function 'main'",
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
    """Clang takes what the two paths share off the name."""
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    source = tmp_path / "there" / "main.c"
    source.write_text("int main(void) { extern int missing(void); return missing(); }\n")
    assert driver.main([str(source), "-o", "x.elf"]) == 2
    assert capsys.readouterr().err.startswith(f"{source}:1: error: undefined symbol _missing")
