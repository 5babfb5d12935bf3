"""The e-puck's circuits around its microcontroller. The board to load is `emu.boards.epuck.board.Epuck`."""

from emu.boards.epuck.config import CONFIG

__all__ = ["CONFIG"]
