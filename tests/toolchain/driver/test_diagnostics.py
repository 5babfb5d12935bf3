"""Messages about mistakes name file, line, cause and cure, also those that only the linker or the assembler finds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.toolchain.c_programs import build

MAIN = "int main(void) { return 0; }\n"
MISTAKES: dict[str, tuple[dict[str, str], tuple[str, ...], str]] = {
    "two definitions in one program": (
        {"a.c": "int f(void) { return 1; }\n" + MAIN, "b.c": "\nint f(void) { return 2; }\n"},
        (),
        "b.c:2: error: duplicate symbol 'f': first defined at a.c:1; make one of them static, or remove it",
    ),
    "two definitions in separate files": (
        {"a.c": "int v = 1;\n" + MAIN, "b.c": "\n\nint v = 2;\n"},
        ("-fno-lto",),
        "b.c:3: error: duplicate symbol 'v': first defined at a.c:1",
    ),
    "two objects at one address": (
        {"a.c": "int x __attribute__((address(0x1000))) = 1;\nint y __attribute__((address(0x1000))) = 2;\n" + MAIN},
        (),
        "a.c:2: error: a.c:(.data._y) at 0x1000..0x1001 overlaps a.c:(.data._x) at 0x1000..0x1001: give one of them",
    ),
    "an odd address": ({"a.c": "int x __attribute__((address(0x1001))) = 1;\n" + MAIN}, (), "a.c:1: error: "),
    "a branch that does not reach": (
        {"a.c": "void far(void) __attribute__((address(0x15000)));\nvoid far(void) {}\n\n"
                'int main(void) { __asm__ volatile("bra _far"); far(); return 0; }\n'},
        ("-Os",),
        "words away, a branch or RCALL reaches 32767: compile with -mlarge-code, or use CALL and GOTO",
    ),
    "a register that does not exist": (
        {"a.c": '\nint main(void) { __asm__("mov w0,[w16]"); return 0; }\n'},
        (),
        "a.c:2: error: mov w0,[w16]: there is no register W16, only W0 to W15",
    ),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake(mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files, options, expected = MISTAKES[mistake]
    for name, text in files.items():
        Path(name).write_text(text)
    built = build([Path(name) for name in files], Path("x.elf"), *options)
    assert built.status == 2
    assert expected in built.first_error
    assert built.first_error.startswith(tuple(f"{name}:" for name in files))


def test_polled_flag_is_named_with_its_file_without_debug_information(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text(
        "#include <xc.h>\nstatic char flag;\nvoid _ISR _T1Interrupt(void) { flag = 1; }\n"
        "int main(void) {\n    while (!flag) {}\n    return 0;\n}\n"
    )
    for level, warned in (("-O0", False), ("-Os", True)):
        built = build([tmp_path / "a.c"], tmp_path / "x.elf", level)
        assert built.status == 0
        assert (
            f"{tmp_path / 'a.c'}:5: warning: 'flag' is written by an interrupt function" in built.messages
        ) == warned
