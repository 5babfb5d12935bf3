"""Documentation pages: links are valid, examples are accepted by the tools, each fact is stated in one file only."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from arena.scene.loader import load_scene
from emu.host import exit_status as status

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "tools"))
import exit_status  # noqa: E402

PAGES = sorted(
    path for path in ROOT.rglob("*.md") if not {".venv", "build", "template", "node_modules"} & set(path.parts)
)
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub generates them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_link_is_broken(page):
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        place, _, anchor = target.partition("#")
        found = (page.parent / place).resolve() if place else page
        assert found.exists(), target
        if anchor and found.suffix == ".md":
            assert anchor in anchors(found), target


def test_every_page_of_the_documents_is_listed():
    listed = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert page.name == "README.md" or f"]({page.name})" in listed, page.name


def test_the_table_of_exit_statuses_is_the_code_s():
    assert exit_status.PAGE.read_text(encoding="utf-8") == exit_status.TEXT
    numbers = {value for name, value in vars(status).items() if name.isupper() and isinstance(value, int)}
    assert numbers == set(status.MEANING)


def test_the_scene_of_the_page_is_a_scene(tmp_path):
    page = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    (tmp_path / "yard.toml").write_text(re.search(r"```toml\n(.*?)```", page, re.DOTALL)[1])
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "firmware.elf").touch()
    scene = load_scene(str(tmp_path / "yard.toml"))
    assert (scene.robots.count, scene.objects.count, len(scene.obstacles)) == (3, 6, 1)


def test_the_version_stands_in_one_place():
    """The version is stated in `pyproject.toml`; changelog and citation agree with it, and no code repeats it."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] in (version, "Unreleased")
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()
    listed = subprocess.run(["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.split():
        assert f'"{version}"' not in (ROOT / name).read_text(encoding="utf-8"), name


@pytest.mark.parametrize("fact", ["XDG_CACHE_HOME", "platformdirs"])
def test_the_cache_s_place_is_named_once(fact):
    home = "emu/host/paths.py"
    parts = ("emu", "toolchain", "arena", "openswarm")
    code = [path for part in parts for path in (ROOT / part).rglob("*.py") if "commands" not in path.parts]
    assert [path.relative_to(ROOT).as_posix() for path in code if fact in path.read_text(encoding="utf-8")] == [home]
