"""Conformance test with an independent client: the test-support package of the protocol from npm."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.emu.dap.node import ROOT, mocha, node_modules
from tests.emu.dap.test_dap import SOURCE, line_of
from tests.watchdog import HANG
from toolchain.driver import driver


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return node_modules(tmp_path_factory.mktemp("npm"))


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["stdio", "tcp"])
def test_the_server_passes_the_test_support_package(modules: Path, tmp_path: Path, transport: str) -> None:
    image = tmp_path / "program.elf"
    assert driver.main(["-g", "-O0", str(SOURCE), "-o", str(image)]) == 0
    launcher = tmp_path / "launcher.py"
    launcher.write_text("import sys\nfrom emu.cli import main\nsys.exit(main(['debug']))\n")
    lines = {"total": line_of("total = sum;"), "twice": line_of("int twice") + 1, "once": line_of("int once")}
    environment = {"EMU_LAUNCHER": str(launcher), "EMU_PROGRAM": str(image), "EMU_SOURCE": str(SOURCE),
                   "EMU_LINES": json.dumps(lines)}  # fmt: skip
    server = None
    if transport == "tcp":
        server = subprocess.Popen(
            [sys.executable, "-m", "emu", "debug", "--port", "0"], stderr=subprocess.PIPE, text=True, cwd=ROOT
        )
        assert server.stderr is not None
        found = re.search(r"127\.0\.0\.1:(\d+)", server.stderr.readline())
        assert found is not None
        environment["EMU_PORT"] = found[1]
    try:
        output = mocha(modules, Path(__file__).with_name("conformance.js"), **environment)
    finally:
        if server is not None:
            server.terminate()
            server.wait(timeout=HANG)
    assert "3 passing" in output
