"""Imports point one way: the contracts in pyproject.toml hold, and would be broken by what they forbid."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LINTER = Path(sys.executable).with_name("lint-imports")


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(LINTER), "--no-cache"], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


def test_imports_point_one_way():
    """Design §2."""
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


def test_every_package_is_under_a_contract():
    """Design §2: `emu`, `toolchain`, `arena`."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} & {"emu", "toolchain", "arena"}
    assert packages <= set(settings["root_packages"])


def test_the_instruction_table_is_a_leaf():
    """Design §2: `emu.dspic30f.isa` imports nothing of ours but itself."""
    for path in (ROOT / "emu" / "dspic30f" / "isa").rglob("*.py"):
        for line in path.read_text().splitlines():
            if line.lstrip().startswith(("from emu", "import emu", "from ..")):
                assert "emu.dspic30f.isa" in line, f"{path.name}: {line}"


def test_the_pictures_are_what_the_code_says():
    """docs/architecture.md; drawing them also fails where parts of a package import each other in a circle."""
    done = subprocess.run(
        [sys.executable, "docs/tools/import_graph.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_circle_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of parts, even where no module imports itself."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "tools"))
    architecture = import_module("import_graph")
    with pytest.raises(ValueError, match="imports go round: a > b > c > a"):
        architecture.heights({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert architecture.heights({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": 2, "b": 1, "c": 0}
    assert architecture.reduced({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": {"b"}, "b": {"c"}, "c": set()}
