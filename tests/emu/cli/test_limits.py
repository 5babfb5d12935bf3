"""A run whose output has no room ends with an error; a debugger script ends when its time limit is reached."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from emu.host.exit_status import BAD_INPUT
from tests.full_device import needs_full_device
from tests.watchdog import HANG
from toolchain.driver import driver

HELLO = Path(__file__).with_name("hello.hex")
SOURCE = """\
volatile int n;
__attribute__((noinline)) int never(void) { return n; }
int main(void) { for (;;) { n = (n + 1) & 0x3FFF; if (n < 0) { never(); } } }
"""
WATCHED = "break main\nrun\nnext\nwatch n == 99\ncontinue 999999\n"


@pytest.fixture(scope="module")
def endless(tmp_path_factory):
    folder = tmp_path_factory.mktemp("endless")
    (folder / "main.c").write_text(SOURCE)
    assert driver.main(["-O1", "-g", str(folder / "main.c"), "-o", str(folder / "main.elf")]) == 0
    return folder / "main.elf"


@needs_full_device
@pytest.mark.parametrize("words", [(), ("--uart1", "/dev/full")])
def test_output_without_room_is_an_error(words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "emu", "run", str(HELLO), *words], stdout=full, stderr=subprocess.PIPE, text=True,
            check=False, timeout=HANG,
        )  # fmt: skip
    assert done.returncode == BAD_INPUT
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("script", ["break never\nrun\n", pytest.param(WATCHED, marks=pytest.mark.slow)])
def test_a_script_ends_at_its_time_limit(endless, script):
    done = subprocess.run(
        [sys.executable, "-m", "emu", "debug", "--tui", str(endless), "--seconds", "0.001"], input=script,
        capture_output=True, text=True, check=False, timeout=HANG,
    )  # fmt: skip
    assert done.returncode == BAD_INPUT, done.stdout
    assert done.stderr == "emu debug: the limit of 0.001 simulated seconds is reached (--seconds)\n"


def test_the_limit_belongs_to_the_prompt(capsys):
    from emu.cli import main

    assert main(["debug", "--seconds", "3"]) == BAD_INPUT
    assert "--seconds needs --tui" in capsys.readouterr().err
