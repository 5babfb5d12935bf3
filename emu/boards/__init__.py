"""Boards by name: the hardware that a robot adds to the chip."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

_CONSTRUCTORS: Final = {"epuck": "emu.boards.epuck.board:Epuck", "none": ""}
"""Module and class of each board; empty for bare pins."""

BOARDS: Final = tuple(_CONSTRUCTORS)
"""Names of the boards, the default first. The board "none" consists of the chip's bare pins."""


def board_named(name: str) -> Callable[..., Any] | None:
    """Return the constructor of a board, for `Machine(board=...)`; None for bare pins.

    Raises ValueError for an unknown name.
    """
    if name not in _CONSTRUCTORS:
        raise ValueError(f"there is no board {name!r}; expected one of {', '.join(BOARDS)}")
    module, _, name_in_module = _CONSTRUCTORS[name].partition(":")
    made: Callable[..., Any] | None = getattr(import_module(module), name_in_module) if name_in_module else None
    return made
