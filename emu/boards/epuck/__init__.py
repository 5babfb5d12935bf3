"""The e-puck around its microcontroller. `CONFIG` is data; the working board is `emu.boards.epuck.board.Epuck`."""

from emu.boards.epuck.config import CONFIG

__all__ = ["CONFIG"]
