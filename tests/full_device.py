"""A device that is always full, for tests of output without room."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

FULL_DEVICE: Final = Path("/dev/full")
"""File whose writes fail with ENOSPC. Elsewhere only a mounted file system can be full, and a mount needs root."""
NO_FULL_DEVICE: Final = "only Linux has /dev/full, a device that is always full"
needs_full_device = pytest.mark.skipif(not FULL_DEVICE.exists(), reason=NO_FULL_DEVICE)
