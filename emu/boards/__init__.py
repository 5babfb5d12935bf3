"""Boards: what a robot adds to the chip, by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

_MADE_BY: Final = {"epuck": "emu.boards.epuck.board:Epuck", "none": ""}
"""Module and name of what is called with the chip's peripherals; nothing for bare pins."""

BOARDS: Final = tuple(_MADE_BY)
"""What can be around a chip, by name, the default first; "none" is bare pins."""


def board_named(name: str) -> Callable[..., Any] | None:
    """What `Machine(board=...)` wants for a board; None for bare pins. Raises ValueError for an unknown name."""
    if name not in _MADE_BY:
        raise ValueError(f"there is no board {name!r}; expected one of {', '.join(BOARDS)}")
    module, _, maker = _MADE_BY[name].partition(":")
    made: Callable[..., Any] | None = getattr(import_module(module), maker) if maker else None
    return made
