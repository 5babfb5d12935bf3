"""Swarms of up to 10,000 scripted robots: limits and placement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from arena.campaign.campaign import Plan
from arena.commands.options.plan import plan_from
from arena.commands.run import parser
from arena.scene import dimensions
from arena.scene.loader import SceneError
from arena.scene.placement import place_all

ROOM = 'name = "large"\n[arena]\nwidth_cm = 2600\nheight_cm = 2600\n[objects]\ncount = 0\n'
ON_MARKS = "[marks]\ncolumns = 101\nrows = 101\nspacing_cm = 25\n[robots]\ncount = 10000\n"
AT_RANDOM = '[[robots]]\ncount = 10000\nplace = "uniform"\n'


def plan_of(folder: Path, text: str, *words: str) -> Plan:
    """Return the plan of `arena run` for these scene and options."""
    (folder / "large.toml").write_text(text)
    return plan_from(parser().parse_args([str(folder / "large.toml"), *words]), 1)


@pytest.mark.parametrize("robots", [ON_MARKS, AT_RANDOM])
def test_ten_thousand_scripted_robots_are_placed_without_contacts(tmp_path: Path, robots: str) -> None:
    """10,000 scripted robots are placed on marks and at random; none touches another one."""
    scene = plan_of(tmp_path, ROOM + robots, "--brain", "scripted").scene
    places = np.array([pose[:2] for pose in place_all(scene, np.random.default_rng(1))[0]])
    distances, _ = cKDTree(places).query(places, 2)
    assert len(places) == 10_000
    assert distances[:, 1].min() >= 2 * dimensions.ROBOT_RADIUS


def test_at_most_a_thousand_robots_run_firmware(tmp_path: Path) -> None:
    """A scene with 1001 robots is refused with firmware only, whether the scene or an option names the number."""
    message = r"robots\.count: 1001 robots run firmware; expected at most 1000, or --brain scripted"
    with pytest.raises(SceneError, match=message):
        plan_of(tmp_path, ROOM + ON_MARKS, "--robots", "1001", "--brain", "openswarm")
    with pytest.raises(SceneError, match=message):
        plan_of(tmp_path, ROOM + AT_RANDOM.replace("10000", "1001"))
    assert plan_of(tmp_path, ROOM + ON_MARKS, "--robots", "1001", "--brain", "scripted").scene.robots.count == 1001
