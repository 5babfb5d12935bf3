"""Lines of the prompt have at most 80 columns without broken pairs, and colours where they are wanted."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

import pytest

import emu
from emu.cli import main
from emu.dap.server import Server
from emu.prompt.appearance import COLUMNS, fold, has_colours
from emu.prompt.reader import Prompt
from toolchain.driver import driver

SOURCE = """
typedef struct { int number, weight; char name[12]; } Item;
Item items[9]; volatile int total;
int weigh(Item *item, int factor)
{
    total += item->weight * factor;
    return total;
}
int main(void)
{
    for (int i = 0; i < 9; i++) { items[i].number = 1000 + i; items[i].weight = -20000 + 7 * i; }
    for (;;) weigh(&items[total & 7], 3); /* a comment that makes this line of the source longer than eighty columns */
}
"""
COMMANDS = (
    "break weigh if factor > 1 && factor < 200 && item->weight != 12345 && item->number > 3 && total < 12345", "run",
    "backtrace", "info breakpoints", "info locals", "info registers", "info statics", "info sfr", "info sfr U1STA",
    "info sfr interrupts", "info threads", "p items", "p *item", "x/40xb items", "x/16xh items", "x/8th items",
    "x/32db items", "time", "help",
)  # fmt: skip
PAIR = re.compile(r"[\w.\[\]]+ ?= ?$")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("appearance")
    (folder / "p.c").write_text(SOURCE)
    assert driver.main(["-g", "-O0", str(folder / "p.c"), "-o", str(folder / "p.elf")]) == 0
    return folder / "p.elf"


def played(program: Path, capsys: pytest.CaptureFixture[str], *lines: str, colours: bool = False) -> list[str]:
    """Return the lines that a script prints."""
    machine = emu.load(program)
    prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine), colours)
    assert prompt.serve({}, io.StringIO("\n".join(lines))) == 0
    return capsys.readouterr().out.splitlines()


def test_lines_have_80_columns_and_whole_pairs(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Source code is shown as it is."""
    lines = played(program, capsys, *COMMANDS)
    assert [line for line in lines if len(line) > COLUMNS] == []
    assert [line for line in lines if PAIR.search(line) or line.lstrip().startswith("=")] == []
    assert len(lines) > 100
    text = " ".join(line.strip() for line in lines)
    assert "number = 1003, weight = -19979" in text
    assert max(map(len, played(program, capsys, "list main"))) > COLUMNS


@pytest.mark.parametrize(
    ("text", "folded"),
    [
        ("a" * 90, "a" * 90),
        (f"{'a' * 70} name = value", f"{'a' * 70}\n    name = value"),
        (f"{'a' * 69} name=value rest", f"{'a' * 69} name=value\n    rest"),
        (f"short\n{'b ' * 45}".rstrip(), f"short\n{'b ' * 40}".rstrip() + "\n    b b b b b"),
        ("c" * 80, "c" * 80),
        (f"    {'d' * 78} e", f"    {'d' * 78}\n    e"),
    ],
)
def test_a_long_line_is_folded_between_pairs(text: str, folded: str) -> None:
    assert fold(text) == folded


def test_colours_mark_stops_locations_and_the_current_line(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The text is the same without them; source lines other than the current one have none."""
    commands = ("break weigh", "run", "list")
    plain, coloured = played(program, capsys, *commands), played(program, capsys, *commands, colours=True)
    assert [re.sub(r"\x1b\[\d*m", "", line) for line in coloured] == plain
    assert "\x1b[36mbreakpoint 1\x1b[0m" in coloured
    assert any(line.startswith("\x1b[1mweigh at p.c:6,") for line in coloured)
    assert sum(line.startswith("\x1b[32m>") for line in coloured) == 2
    assert not any("\x1b" in line for line in plain)


def test_when_output_has_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """NO_COLOR counts if it is not empty. `always` overrides it, and a dumb terminal has no colours."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert not has_colours("auto")
    monkeypatch.setattr(sys, "stdout", type("Terminal", (io.StringIO,), {"isatty": lambda _self: True})())
    assert [has_colours(one) for one in ("auto", "always", "never")] == [True, True, False]
    monkeypatch.setenv("NO_COLOR", "")
    assert has_colours("auto")
    monkeypatch.setenv("NO_COLOR", "1")
    assert [has_colours(one) for one in ("auto", "always", "never")] == [False, True, False]
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("TERM", "dumb")
    assert not has_colours("auto")


def test_the_option_of_the_command(
    program: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for option, expected in (("always", True), ("auto", False)):
        monkeypatch.setattr(sys, "stdin", io.StringIO("break weigh\nrun\n"))
        assert main(["debug", "--tui", str(program), "--color", option]) == 0
        assert ("\x1b[" in capsys.readouterr().out) is expected
