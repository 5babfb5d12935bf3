"""Colours of figures, films and pages are distinct for readers with deuteranopia and protanopia."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from arena.scene import palette

LEAST = 15.0
"""Least difference of two colours in CIELAB (CIE 1976). Red and green of equal lightness differ by less than 10 for a
reader with deuteranopia."""
SIGHT = {
    "normal": np.eye(3),
    "deuteranopia": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
    "protanopia": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
}  # fmt: skip
"""Matrices on linear RGB: Machado, Oliveira and Fernandes, IEEE TVCG 15 (2009), severity 1.0."""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""Linear sRGB to CIE XYZ (IEC 61966-2-1)."""
SETS = {
    "seen": palette.SEEN,
    "bodies": (palette.OBJECT, palette.PALE_OBJECT, palette.ROBOT),
    "lines": palette.LINES,
}


def seen_colour(colour: str, sight: str) -> NDArray[np.float64]:
    """Return CIELAB of a colour as a reader with this colour vision sees it."""
    values = np.array(palette.rgb(colour)) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    x, y, z = TO_XYZ @ np.clip(SIGHT[sight] @ linear, 0, 1) / (TO_XYZ @ np.ones(3))
    fx, fy, fz = (one ** (1 / 3) if one > (6 / 29) ** 3 else one / 3 * (29 / 6) ** 2 + 4 / 29 for one in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


def difference(one: str, other: str, sight: str) -> float:
    return float(np.linalg.norm(seen_colour(one, sight) - seen_colour(other, sight)))


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("name", SETS)
def test_colours_of_one_figure_are_distinct(name: str, sight: str) -> None:
    """Any two colours with a meaning of their own in one picture differ by `LEAST` or more."""
    found = {pair: difference(*pair, sight) for pair in combinations(SETS[name], 2)}
    assert min(found.values()) >= LEAST, found


@pytest.mark.parametrize("sight", SIGHT)
def test_neighbouring_groups_are_distinct(sight: str) -> None:
    """Each colour of a group differs from the next one, and all from the background."""
    assert min(difference(one, other, sight) for one, other in pairwise(palette.GROUPS)) >= LEAST
    assert min(difference(one, palette.PAPER, sight) for one in palette.GROUPS) >= LEAST


def test_the_simulation_finds_red_and_green_alike() -> None:
    """The simulation is effective: the usual red and green differ much less for a reader with deuteranopia."""
    assert difference("#d62728", "#2ca02c", "normal") > 100
    assert difference("#b01010", "#556b00", "deuteranopia") < LEAST
