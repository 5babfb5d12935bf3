"""An error within one debugger request fails that request; the session continues."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest

import emu
from emu.dap.server import Server
from emu.debug.history import History
from emu.host.exit_status import BAD_INPUT
from emu.prompt.reader import Prompt
from tests.emu.cli.programs import executable

PROGRAM = """
    mov #0x900, w15
    mov #0x27fe, w1
    mov #5, w0
    mov w0, [w1]
    end:
    bra @end
"""


@pytest.fixture
def machine(tmp_path: Path) -> emu.Machine:
    """Return a machine with a program that writes the last word of RAM."""
    path = tmp_path / "last.elf"
    path.write_bytes(executable(PROGRAM))
    return emu.load(path, engine="plain", board=None)


def _play(machine: emu.Machine, script: str) -> int:
    prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine))
    return prompt.serve({}, io.StringIO(script))


def test_the_last_write_to_the_last_word_of_ram_is_found(
    machine: emu.Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last write to the last word of RAM is found, although the address range ends with RAM."""
    assert _play(machine, "cycle 50\nlastwrite *(int *)0x27fe\n") == 0
    assert "last write: 0000 -> 0500" in capsys.readouterr().out


@pytest.mark.parametrize("place", ["*(long *)0x27fe", "*(int *)0x2800", "*(int *)0x7ffe"])
def test_a_place_beyond_ram_is_refused(machine: emu.Machine, capsys: pytest.CaptureFixture[str], place: str) -> None:
    """A range beyond RAM is refused with a message and the status of a failed command."""
    assert _play(machine, f"cycle 50\nlastwrite {place}\n") == BAD_INPUT
    assert "it ends at 0x2800" in capsys.readouterr().err


def test_an_error_while_the_machine_moves_is_reported_and_the_session_continues(
    machine: emu.Machine, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an error during a run, the error is reported, and the machine is at the same cycle with its recording
    unchanged."""

    def fail(*_arguments: Any) -> None:
        machine.run_until(machine.cycle + 3)
        raise ValueError("the search failed")

    monkeypatch.setattr(History, "_last_write", fail)
    assert _play(machine, "cycle 50\nlastwrite *(int *)0x27fe\ngoto 3\ntime\n") == 0
    out = capsys.readouterr().out
    assert "pause: the request failed: the search failed" in out
    assert "cycle 3, 0.000000203 s, 47 before the present" in out
