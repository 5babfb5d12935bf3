"""`emu run --dump-native` shows generated code with the guest's addresses and instructions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from emu.cli import main
from tests.emu.cli.programs import SPIN, executable


@pytest.fixture
def spin(tmp_path: Path) -> str:
    """Return a program that counts for ever from address 0x102 on."""
    path = tmp_path / "spin.elf"
    path.write_bytes(executable(SPIN))
    return str(path)


@pytest.mark.parametrize("place", ["_spin", "0x104"])
def test_the_code_of_a_place_shows_guest_addresses(spin: str, place: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The code of a function or address is shown as IR with each guest instruction and as host assembly with named
    blocks."""
    assert main(["run", spin, "--engine", "jit", "--cycles", "200000", "--dump-native", place]) == 0
    text = capsys.readouterr().out
    ir, host = text.split("; host code", 1)
    for address, start in ((0x102, "inc.w w0"), (0x104, "mov.w w0"), (0x106, "bra _spin")):
        assert re.search(rf"^ *; {address:06x}  {re.escape(start)}", ir, re.MULTILINE)
    assert "define i64 @entry" in ir
    assert re.search(r"# %b102\b", host)


def test_a_function_is_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The code of a whole function is shown, although the function is entered once, before native code exists."""
    path = tmp_path / "loop.elf"
    path.write_bytes(executable("""
work:
    clr w0
    inc w0, w0
    mov w0, 0x800
    bra 0x102
"""))  # fmt: skip
    assert main(["run", str(path), "--engine", "jit", "--cycles", "200000", "--dump-native", "work"]) == 0
    ir, host = capsys.readouterr().out.split("; host code", 1)
    assert "000104  mov.w w0" in ir
    assert re.search(r"# %b102\b", host)


def test_an_unknown_symbol_is_refused_before_the_run(spin: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An unknown symbol is refused before the run, which would not end."""
    monkeypatch.setattr("emu.run.session.Session.run", lambda _session: pytest.fail("it ran"))
    assert main(["run", spin, "--dump-native", "_nobody"]) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dump-native", "_nobody"], "no function or label '_nobody'"),
        (["--dump-native", "0x4000"], "no native code was compiled for 0x4000"),
        (["--dump-native", "_spin", "--engine", "plain"], "plain compiles no native code"),
    ],
)
def test_code_that_cannot_be_shown_is_reported(
    spin: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Code that cannot be shown is reported in one line, with status 2."""
    assert main(["run", spin, "--cycles", "20000", *arguments]) == 2
    assert message in capsys.readouterr().err
