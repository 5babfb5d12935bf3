"""The browser for tests of pages: Debian's chromium, which the project's own environment cannot install."""

from __future__ import annotations

import shutil
from typing import Final

import pytest

BROWSER: Final = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium here (Debian package chromium)")
"""Marker of tests that run the scripts of a page."""
