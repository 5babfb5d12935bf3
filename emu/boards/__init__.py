"""Boards: what a robot adds to the chip. `epuck` is the only one so far."""

from __future__ import annotations

from typing import Final

BOARDS: Final = ("epuck", "none")
"""What can be around a chip, by name, the default first; "none" is bare pins."""
