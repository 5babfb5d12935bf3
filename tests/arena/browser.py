"""The browser that pages are opened in: Debian's chromium, which the project's own environment cannot install."""

from __future__ import annotations

import shutil
from typing import Final

import pytest

BROWSER: Final = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium here (Debian package chromium)")
"""For tests that look at a page as its users do: nothing else runs what is written in it."""
