"""The documentation site builds without a warning and contains every page of its table of contents."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WANTED = ("mkdocs", "material", "mkdocstrings_handlers")


@pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in WANTED),
    reason="the site's generator is missing (extra: docs)",
)
def test_the_site_builds_without_a_warning(tmp_path):
    words = [sys.executable, str(ROOT / "docs" / "tools" / "site.py"), "--out", str(tmp_path / "site")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    pages = re.findall(r": ([\w/.-]+\.md)$", (ROOT / "docs" / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(pages) > 25
    for page in pages:
        place = re.sub(r"(README|index)$", "", page.removesuffix(".md")).rstrip("/")
        assert (tmp_path / "site" / place / "index.html").is_file(), page
    python = (tmp_path / "site" / "reference" / "python" / "index.html").read_text(encoding="utf-8")
    assert "emu.machine.machine.Machine.run" in python
