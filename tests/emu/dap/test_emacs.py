"""A complete session with another independent client: dap-mode of Emacs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.emu.dap.test_dap import SOURCE, line_of
from tests.watchdog import HANG
from toolchain.driver import driver

ROOT = Path(__file__).resolve().parents[3]
SITE = Path("/usr/share/emacs/site-lisp/elpa-src")
"""Folder of Emacs packages in Debian."""


def test_a_session_in_emacs(tmp_path: Path) -> None:
    """dap-mode can set a breakpoint, show locals, step forward and back, continue forward and in reverse, step out,
    and disconnect."""
    emacs = shutil.which("emacs")
    if emacs is None or not list(SITE.glob("dap-mode-*")):
        pytest.skip("Emacs with dap-mode is not installed (Debian packages emacs-nox, elpa-dap-mode)")
    image = tmp_path / "program.elf"
    assert driver.main(["-g", "-O0", str(SOURCE), "-o", str(image)]) == 0
    environment = os.environ | {
        "HOME": str(tmp_path), "PYTHONPATH": str(ROOT), "EMU_PYTHON": sys.executable, "EMU_PROGRAM": str(image),
        "EMU_SOURCE": str(SOURCE), "EMU_LINE": str(line_of("total = sum;")),
    }  # fmt: skip
    done = subprocess.run(
        [emacs, "--batch", "-l", str(Path(__file__).with_name("conversation.el"))],
        capture_output=True, text=True, env=environment, timeout=HANG, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-9:] == [
        "add at program.c:13: total = sum;", "Locals: a=0 b=0 sum=0", "add at program.c:14: return sum;",
        "add at program.c:13: total = sum;", "add at program.c:13: total = sum;", "Locals: a=0 b=0 sum=0",
        "twice at program.c:20: return add(once, n);", "add at program.c:13: total = sum;",
        "the adapter has ended: 0",
    ]  # fmt: skip
