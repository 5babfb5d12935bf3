"""The command line in shells and pipes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.emu.cli.programs import SPIN, executable
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
EMU = [sys.executable, "-m", "emu"]


@pytest.fixture
def spin(tmp_path):
    path = tmp_path / "spin.elf"
    path.write_bytes(executable(SPIN))
    return str(path)


def emu(*words, **options):
    options = {"capture_output": True, "text": True, "cwd": ROOT, "timeout": HANG, "check": False} | options
    return subprocess.run([*EMU, *words], **options)


def test_the_version_is_that_of_the_package():
    assert emu("--version").stdout == f"emu {version('openswarm')}\n"


@pytest.mark.parametrize("order", [["spin", "main"], ["main", "spin"]])
def test_every_breakpoint_holds(spin, order):
    first = emu("run", spin, "--break", order[0], "--break", order[1])
    assert "breakpoint at 0x000100 (_main)" in first.stderr
    second = emu("run", spin, "--break", "0x9000", "--break", "spin", "--break", "0x9002")
    assert "breakpoint at 0x000102" in second.stderr


def test_a_trace_to_standard_output(spin, tmp_path):
    done = subprocess.run(
        [*EMU, "run", spin, "--cycles", "4", "--trace", "-"],
        capture_output=True, text=True, cwd=tmp_path, timeout=HANG, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0
    assert [line.split()[1] for line in done.stdout.splitlines()[1:]] == ["0x000000", "0x000100", "0x000102"]
    assert not (tmp_path / "-").exists()


@pytest.mark.parametrize("other", [["--uart1", "-"], ["--uart2", "-"], ["--json"], ["--record", "-"]])
def test_only_one_output_can_use_standard_output(spin, other):
    done = emu("run", spin, "--cycles", "4", "--trace", "-", *other)
    assert done.returncode == 2
    assert "standard output" in done.stderr


def test_completion_knows_commands_options_and_choices():
    bash = shutil.which("bash")
    if bash is None:  # only bash can evaluate its completion script
        pytest.skip("there is no bash (Debian package bash)")
    script = emu("completion", "bash").stdout
    ask = 'COMP_WORDS=(emu {words}); COMP_CWORD={last}; _shtab_emu; echo "${{COMPREPLY[@]}}"'

    def completed(*words: str) -> list[str]:
        text = script + "\n" + ask.format(words=" ".join(f"'{word}'" for word in words), last=len(words))
        done = subprocess.run([bash, "-c", text], capture_output=True, text=True, timeout=HANG, check=False)
        return done.stdout.split()

    assert completed("scr") == ["screenshot"]
    assert completed("run", "--ipl") == ["--ipl-slip"]
    assert completed("run", "--board", "") == ["epuck", "none", "kilobot"]


def test_output_is_never_coloured(spin):
    """Output is never coloured, so NO_COLOR is respected; only compiler messages are coloured, and the compiler
    checks NO_COLOR."""
    import pty

    leader, follower = pty.openpty()
    done = subprocess.run(
        [*EMU, "run", spin, "--cycles", "4"], stdin=subprocess.DEVNULL, stdout=follower, stderr=follower, cwd=ROOT,
        timeout=HANG, check=False,
    )  # fmt: skip
    os.close(follower)
    assert done.returncode == 0
    assert b"\x1b[" not in os.read(leader, 65536)
