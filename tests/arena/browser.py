"""Chromium for tests of web pages: Debian's package, because pip cannot install a browser."""

from __future__ import annotations

import re
import shutil
from typing import Final

import pytest

BROWSER: Final = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium here (Debian package chromium)")
"""Marker of tests that need a browser to run the scripts of a page."""


def probed(page: str, probe: str) -> str:
    """Return a page that ends in a probe script; its policy, which permits no other script, is removed."""
    return re.sub(r"<meta http-equiv[^>]*>", "", page).replace("</html>", probe)
