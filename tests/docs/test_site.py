"""The documentation site builds without a warning and links to every page. Its search finds kernel calls, options and
keys of scenes at their own anchors."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]
WANTED = ("mkdocs", "material", "mkdocstrings_handlers")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site, which is built without a warning."""
    if any(importlib.util.find_spec(name) is None for name in WANTED):
        pytest.skip("the site's generator is missing (extra: docs)")
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, str(ROOT / "docs" / "tools" / "site.py"), "--out", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    return folder


@pytest.mark.slow
def test_the_site_has_every_page_of_its_contents(site: Path) -> None:
    """Every page that mkdocs.yml lists exists; the Python reference names methods."""
    pages = re.findall(r": ([\w/.-]+\.md)$", (ROOT / "docs" / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(pages) > 25
    missing = [page for page in pages if not (site / _html(page)).is_file()]
    assert missing == []
    assert "emu.machine.machine.Machine.run" in (site / "reference/python.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_every_page_is_reached_from_home_in_three_clicks(site: Path) -> None:
    """Following links from the front page leads to every page in at most three steps, and each link has a file."""
    reached, edge = {site / "index.html"}, [site / "index.html"]
    for _ in range(3):
        found = {target for page in edge for target in _links(page)}
        absent = sorted(str(one.relative_to(site)) for one in found if not one.is_file())
        assert absent == []
        edge = sorted(found - reached)
        reached |= found
    pages = set(site.rglob("*.html"))
    assert sorted(str(page.relative_to(site)) for page in pages - reached) == []


@pytest.mark.slow
def test_pages_name_their_files_relative_to_themselves(site: Path) -> None:
    """Relative names make the site work from disk and in any folder of a server."""
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    assert [page for page, text in pages.items() if re.search(r'(href|src)="/', text)] == []


@pytest.mark.slow
def test_formulas_in_tables_and_lists_are_complete(site: Path) -> None:
    """Braces at the end of a cell are no attributes, bars have no backslash, and products are no emphasis."""
    isa = (site / "docs/reference/isa.html").read_text(encoding="utf-8")
    assert "[W15+2] = {000000000, PCret&lt;22:16&gt;}" in isa
    assert re.findall(r"<t[dh] (?!style=|class=)[^>]*>", isa) == []
    assert r"\|" not in (site / "docs/reference/avr.html").read_text(encoding="utf-8")
    dsp = (site / "toolchain/runtime/dsp.html").read_text(encoding="utf-8")
    assert "31 + M*(7 + N*(7 + 4*S))" in dsp


@pytest.mark.slow
def test_every_kernel_call_has_an_anchor(site: Path) -> None:
    """Every function and macro `Sys_*` that a header declares has an anchor of its name on the page of the kernel."""
    text = (site / "reference/kernel-calls.html").read_text(encoding="utf-8")
    declared: set[str] = set()
    for header in (ROOT / "firmware/openswarm/include").glob("*.h"):
        code = re.sub(r"/\*.*?\*/", "", header.read_text(encoding="utf-8"), flags=re.DOTALL)
        declared.update(re.findall(r"^(?:#define |[\w ]+[ *])(Sys_\w+)\(", code, re.MULTILINE))
    assert len(declared) > 60
    assert sorted(name for name in declared if f'id="{name}"' not in text) == []


@pytest.mark.slow
def test_the_search_finds_calls_of_kernel_and_python(site: Path) -> None:
    """Every anchor of a kernel call, and of a public class, method, function and value of Python, is an entry."""
    entries = json.loads((site / "search/search_index.json").read_text(encoding="utf-8"))["docs"]
    found = {entry["location"] for entry in entries}
    for page, pattern, least in (
        ("reference/kernel-calls.html", r'<h4 id="(Sys_\w+)"', 90),
        ("reference/python.html", r'<h[3-6] id="((?:emu|arena|openswarm)\.[\w.]+)"', 200),
    ):
        anchors = re.findall(pattern, (site / page).read_text(encoding="utf-8"))
        assert len(anchors) > least, page
        assert [name for name in anchors if f"{page}#{name}" not in found] == []
    assert "reference/python.html#emu.machine.machine.Machine.run" in found


@pytest.mark.slow
def test_the_search_finds_options_and_keys_at_their_own_anchors(site: Path) -> None:
    """Every `--option` of a command's usage and every key of a scene is an entry of the search, with an anchor."""
    entries = json.loads((site / "search/search_index.json").read_text(encoding="utf-8"))["docs"]
    titles = {entry["location"]: entry["title"] for entry in entries}
    for program in ("emu", "toolchain", "arena", "openswarm"):
        text = (site / f"reference/{program}.html").read_text(encoding="utf-8")
        usages = re.findall(r"usage: ([a-z]+ [a-z]+) (.*?)\n\n", re.sub("<[^>]+>", "", text), re.DOTALL)
        assert len(usages) > 3
        for command, usage in usages:
            options = set(re.findall(r"(?<=[\[ ])--[a-z][\w-]+", usage))
            anchors = {option: f"reference/{program}.html#{command.replace(' ', '-')}{option}" for option in options}
            assert [one for one, anchor in sorted(anchors.items()) if anchor not in titles] == [], command
            assert all(titles[anchor].startswith(f"{command} -") for anchor in anchors.values())
    keys = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/scene-keys.md").read_text(encoding="utf-8"), re.MULTILINE)
    found = [title for location, title in titles.items() if location.startswith("docs/scene-keys.html#")]
    assert len(keys) > 100
    assert [key for key in keys if not any(title.endswith(f".{key}") for title in found)] == []
    assert titles["docs/scene-keys.html#infrared.lost_share"] == "infrared.lost_share"


def _html(page: str) -> str:
    """Return the path of a page in the site."""
    folder, _, name = page.rpartition("/")
    return f"{folder}/{'index' if name == 'README.md' else name.removesuffix('.md')}.html".lstrip("/")


def _links(page: Path) -> set[Path]:
    """Return the pages of the site that a page links to."""
    targets = re.findall(r'href="?([^"#?> ]+\.html)', page.read_text(encoding="utf-8"))
    return {(page.parent / unquote(one)).resolve() for one in targets if ":" not in one}
