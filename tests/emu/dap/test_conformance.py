"""The same conversation by a client that others wrote: the protocol's test-support package from npm."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.emu.dap.test_dap import SOURCE, line_of
from toolchain import driver

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("@vscode/debugadapter-testsupport@1.68", "mocha@11")


@pytest.fixture(scope="module")
def node_modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the packages; those of EMU_DAP_NODE_MODULES if it is set."""
    given = os.environ.get("EMU_DAP_NODE_MODULES")
    if given:
        return Path(given)
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("there is no node with npm (Debian packages nodejs, npm)")
    folder = tmp_path_factory.mktemp("npm")
    done = subprocess.run(
        [npm, "install", "--fetch-retries=0", "--no-audit", "--no-fund", "--prefix", str(folder), *PACKAGES],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"npm cannot install {', '.join(PACKAGES)}: {done.stderr.strip().splitlines()[-1:]}")
    return folder / "node_modules"


@pytest.mark.parametrize("way", ["stdio", "tcp"])
def test_the_test_support_package_is_content(node_modules: Path, tmp_path: Path, way: str) -> None:
    image = tmp_path / "program.elf"
    assert driver.main(["-g", "-O0", str(SOURCE), "-o", str(image)]) == 0
    launcher = tmp_path / "launcher.py"
    launcher.write_text("import sys\nfrom emu.cli import main\nsys.exit(main(['debug']))\n")
    lines = {"total": line_of("total = sum;"), "twice": line_of("int twice") + 1, "once": line_of("int once")}
    environment = os.environ | {
        "NODE_PATH": str(node_modules), "EMU_PYTHON": sys.executable, "EMU_LAUNCHER": str(launcher),
        "EMU_PROGRAM": str(image), "EMU_SOURCE": str(SOURCE), "EMU_ROOT": str(ROOT), "EMU_LINES": json.dumps(lines),
        "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    server = None
    if way == "tcp":
        server = subprocess.Popen(
            [sys.executable, "-m", "emu", "debug", "--port", "0"], stderr=subprocess.PIPE, text=True, cwd=ROOT
        )
        assert server.stderr is not None
        found = re.search(r"127\.0\.0\.1:(\d+)", server.stderr.readline())
        assert found is not None
        environment["EMU_PORT"] = found[1]
    try:
        done = subprocess.run(
            ["node", str(node_modules / "mocha" / "bin" / "mocha.js"), str(Path(__file__).with_name("conformance.js"))],
            capture_output=True, text=True, env=environment, timeout=200, check=False,
        )  # fmt: skip
    finally:
        if server is not None:
            server.terminate()
            server.wait(timeout=30)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passing" in done.stdout
