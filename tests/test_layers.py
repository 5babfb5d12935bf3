"""Imports between packages have one direction: the contracts in pyproject.toml hold, and a violation is detected."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import grimp
import pytest

from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[1]
LINTER = Path(sys.executable).with_name("lint-imports")


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(LINTER), "--no-cache"], cwd=folder, capture_output=True, text=True, timeout=HANG, check=False
    )


def test_imports_point_one_way():
    """engines.md §2: the import contracts in pyproject.toml hold."""
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


def test_every_package_is_under_a_contract():
    """engines.md §2: `emu`, `toolchain` and `arena` are each under a contract."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")} & {"emu", "toolchain", "arena"}
    assert packages <= set(settings["root_packages"])


def test_the_instruction_table_is_a_leaf():
    """engines.md §2: `emu.dspic30f.isa` imports no other module of the project."""
    for path in (ROOT / "emu" / "dspic30f" / "isa").rglob("*.py"):
        for line in path.read_text().splitlines():
            if line.lstrip().startswith(("from emu", "import emu", "from ..")):
                assert "emu.dspic30f.isa" in line, f"{path.name}: {line}"


def test_packages_have_no_circles(tmp_path: Path) -> None:
    """The parts of a package do not import each other in a cycle, so that its import graph can be drawn."""
    command = [sys.executable, "docs/tools/import_graph.py", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert {path.name for path in tmp_path.iterdir()} == {
        "imports.md", "imports-emu.svg", "imports-toolchain.svg", "imports-arena.svg"}  # fmt: skip


@pytest.mark.parametrize("package", ["emu", "toolchain", "arena", "openswarm"])
def test_no_folder_and_no_module_is_in_a_circle(package: str) -> None:
    """The modules and subfolders of every folder import each other without cycles; type imports count."""
    graph = grimp.build_graph(package, exclude_type_checking_imports=False)
    below: dict[str, dict[str, set[str]]] = {}
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            one, other = importer.split("."), imported.split(".")
            shared = next((n for n, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), None)
            if shared is not None:
                children = below.setdefault(".".join(one[:shared]), {})
                children.setdefault(one[shared], set()).add(other[shared])
                children.setdefault(other[shared], set())
    for folder, children in below.items():
        try:
            tuple(TopologicalSorter(children).static_order())
        except CycleError as error:
            pytest.fail(f"{folder}: circular imports: {' > '.join(error.args[1])}")


def test_a_circle_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cycle of parts is reported, even if no module is in a cycle."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "tools"))
    architecture = import_module("import_graph")
    with pytest.raises(ValueError, match="circular imports: a > b > c > a"):
        architecture.heights({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert architecture.heights({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {"a": 2, "b": 1, "c": 0}
    assert architecture.transitive_reduction({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == {
        "a": {"b"},
        "b": {"c"},
        "c": set(),
    }
