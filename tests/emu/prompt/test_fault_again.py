"""A recorded fault is reported again when the debugger runs to it again."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

import emu
from emu.dap.server import Server
from emu.host.exit_status import FAULT
from emu.prompt.reader import Prompt
from tests.emu.cli.programs import executable

PROGRAM = """
    mov #0x900, w15
    mov #0x1001, w1
    nop
    mov w0, [w1]
    nop
    end:
    bra @end
"""


@pytest.mark.parametrize(
    "way", ["restart\nrun", "goto 2\ncontinue", "reverse-continue\ncontinue", "reverse-stepi\ncontinue"]
)
def test_a_fault_is_reported_again_after_going_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], way: str
) -> None:
    """After going back, a run to the fault prints the same report, and the script ends with the status of a fault."""
    path = tmp_path / "fault.elf"
    path.write_bytes(executable(PROGRAM))
    machine = emu.load(path, board=None)
    prompt = Prompt("emu debug", lambda client: Server(client, lambda _launch: machine))
    status = prompt.serve({}, io.StringIO(f"run\n{way}\n"))
    reports = [line for line in capsys.readouterr().out.splitlines() if line.startswith("firmware fault")]
    assert status == FAULT
    assert len(reports) == 2
    assert reports[0] == reports[1]
