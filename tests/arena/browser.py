"""Chromium for tests of web pages: Debian's package, because pip cannot install a browser."""

from __future__ import annotations

import shutil
from typing import Final

import pytest

BROWSER: Final = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium here (Debian package chromium)")
"""Marker of tests that need a browser to run the scripts of a page."""
