"""Pages for users: every message exists in the code, every `[10]` and `Eq. (2)` has a source, the notebook runs."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from arena.cli import main
from tests.firmware.conftest import built_once

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def test_every_message_of_the_troubleshooting_page_exists() -> None:
    """Each part between `...` is in the text of the Makefile or of one module."""
    sources = [ROOT / "Makefile"]
    for package in ("emu", "toolchain", "arena", "openswarm"):
        sources += [path for path in (ROOT / package).rglob("*.py") if "firmware" not in path.parts[-3:]]
    texts = [path.read_text(encoding="utf-8") for path in sources]
    messages = re.findall(r"^\| `([^`]+)` \|", (DOCS / "troubleshooting.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(messages) > 20
    missing = [one for one in messages if not any(all(part in text for part in one.split("...")) for text in texts)]
    assert missing == []


def test_every_numbered_source_is_in_the_bibliography() -> None:
    """Pages cite `[10]` and `Eq. (1)` by the paper's numbers; the bibliography explains each number."""
    known = (DOCS / "bibliography.md").read_text(encoding="utf-8")
    cited: set[str] = set()
    for page in (*DOCS.glob("*.md"), *(ROOT / "arena").rglob("*.py")):
        text = page.read_text(encoding="utf-8")
        cited.update(re.findall(r"(?:ref\.|reference) (\[\d+\])", text))
        cited.update(re.findall(r"Eq\. \(\d\)", text))
    assert {"[10]", "Eq. (2)"} <= cited
    assert [one for one in sorted(cited) if f"**{one}**" not in known] == []


def test_the_systems_page_names_the_version_that_is_needed() -> None:
    page = (DOCS / "systems.md").read_text(encoding="utf-8")
    needed = re.search(r'requires-python = ">=(\S+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert needed is not None
    assert f"Python {needed[1]} (" in page
    assert re.findall(r"^\| (\w+)[^|]*\| tested ", page, re.MULTILINE) == ["Linux", "Containers"]


@pytest.mark.slow
def test_the_notebook_page_runs(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All blocks of docs/notebook.md run in order in one namespace, in an empty folder with a firmware image."""
    pytest.importorskip("pandas", reason="pandas is not installed (extra: test)")
    import matplotlib as mpl

    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    shutil.copy(built_once(tmp_path_factory, "hello"), tmp_path)
    blocks = re.findall(r"```(sh|python)\n(.*?)```", (DOCS / "notebook.md").read_text(encoding="utf-8"), re.DOTALL)
    assert [kind for kind, _ in blocks] == ["sh", "python", "python", "python", "python"]
    names: dict[str, object] = {}
    for kind, text in blocks:
        if kind == "sh":
            assert main(shlex.split(text)[1:]) == 0
        else:
            exec(compile(text, "docs/notebook.md", "exec"), names)
    assert len(names["trials"]) == 2  # type: ignore[arg-type]
    assert "metric" in names["trial"]._repr_html_()  # type: ignore[attr-defined]
    assert len(repr(names["trial"])) <= 200
    assert names["samples"].shape[0] == 61  # type: ignore[attr-defined]
    assert "main" in set(names["memory"].frame()["name"])  # type: ignore[attr-defined]
    assert (tmp_path / "build/path.png").stat().st_size > 5000
    assert (tmp_path / "build/shares.png").stat().st_size > 5000


@pytest.mark.slow
def test_the_page_of_an_own_experiment_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All blocks of docs/own-experiment.md run in order in an empty folder; the page's file names are used."""
    pytest.importorskip("pandas", reason="pandas is not installed (extra: test)")
    import matplotlib as mpl

    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    page = (DOCS / "own-experiment.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```(\w+)\n(.*?)```", page, re.DOTALL)
    assert [kind for kind, _ in blocks] == ["toml", "python", "python", "sh", "sh", "python", "sh"]
    for name, (_, text) in zip(("scatter.toml", "scatter.py", "near.py"), blocks[:3], strict=True):
        Path(name).write_text(text)
    for kind, text in blocks[3:]:
        if kind == "python":
            exec(compile(text, "docs/own-experiment.md", "exec"), {})
            continue
        for command in text.splitlines():
            if command.startswith("sed "):
                subprocess.run(["sh", "-c", command], check=True)
            else:
                assert main(shlex.split(command)[1:]) == 0, command
    assert Path("gap.png").stat().st_size > 5000
    said = capsys.readouterr().out
    assert "mean distance to the nearest robot at 30 s" in said
    assert "p cannot fall below 0.25" in " ".join(said.split())
    assert Path("far.py").read_text() != Path("near.py").read_text()
