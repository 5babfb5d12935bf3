"""Colours of figures, films and pages, distinct for colour-blind readers too: the palette of Okabe and Ito (2008).

Camera pictures and the objects of a page keep the colours of the scene.
"""

from __future__ import annotations

from typing import Final

INK, PAPER = "#222222", "#ffffff"
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#56b4e9", "#cc79a7"
YELLOW: Final = "#f0e442"
SEEN: Final = ("#bbbbbb", VERMILION, GREEN)
"""Colours of robots by the answer of their line-of-sight sensor: nothing, object, robot."""
OBJECT, PALE_OBJECT, ROBOT = VERMILION, "#fbe3d6", GREEN
"""Colours of bodies in figures: objects of the largest group, other objects, robots."""
GROUPS: Final = (ORANGE, SKY, YELLOW, BLUE, PURPLE, VERMILION, GREEN)
"""Colours of groups of objects, used in turn."""
LINES: Final = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Colours of the curves of one figure, in their order."""


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of a colour `#rrggbb`."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue
