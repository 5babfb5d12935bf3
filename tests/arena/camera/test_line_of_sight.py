"""The line-of-sight sensor of robots without firmware (line_of_sight.c)."""

from __future__ import annotations

import math
import random

import pytest

from arena.camera.appearance import NOTHING, OBJECT, ROBOT
from arena.camera.line_of_sight import LineOfSight
from arena.scene.loader import load_scene
from arena.scene.robot_kind import Traits
from arena.world.poses import Poses
from tests.arena.reference_camera import ReferenceCamera, sensor_of
from tests.fuzz.seeds import base_seed


@pytest.mark.parametrize(("changes", "traits"), [
    ({}, Traits()),
    ({"camera__range_cm": 60.0}, Traits(yaw=0.3)),
    ({"arena__walls": False, "camera__range_cm": math.inf, "camera__pitch_deg": 2.0}, Traits(pitch_deg=-1.5)),
    ({"camera__pitch_deg": -9.0}, Traits()),
])  # fmt: skip
def test_answers_equal_the_reference_in_swarms_of_any_size_and_density(
    changes: dict[str, object], traits: Traits
) -> None:
    """The answer equals that of the reference camera, which tests every body for every ray: few and many bodies, in a
    crowd, spread, and in a row, seen from anywhere in the room."""
    draw = random.Random(base_seed())
    answers = set()
    for robots, objects, width, depth in ((1, 0, 200, 100), (2, 1, 60, 40), (12, 20, 280, 280), (150, 120, 250, 280),
                                          (60, 60, 290, 0.01), (80, 0, 40, 40), (0, 90, 150, 150)):  # fmt: skip
        scene = load_scene("clustering").with_values(robots__count=robots + 1, objects__count=objects, **changes)
        for _ in range(6):
            places = [(5 + draw.random() * width, 5 + draw.random() * depth) for _ in range(robots + objects)]
            own = draw.uniform(5, 295), draw.uniform(5, 295), draw.uniform(-math.pi, math.pi)
            poses = Poses([own, *((x, y, 0.0) for x, y in places[:robots])], places[robots:])
            camera = ReferenceCamera(scene, poses, 0, traits=traits)
            seen = LineOfSight(scene, 0, traits).look(poses)
            assert seen == sensor_of(camera), f"seed {base_seed()}: {robots} robots, {objects} objects, from {own}"
            answers.add(seen)
    assert answers == {NOTHING, OBJECT, ROBOT}


def test_a_look_within_a_quantum_is_made_from_the_extrapolated_pose() -> None:
    """A look between two poses is made from the pose between them."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=1)
    turned, object_at = math.radians(15), [(150.0, 100.0)]
    before, now = Poses([(80.0, 100.0, -turned)], object_at), Poses([(100.0, 100.0, turned)], object_at)
    sight = LineOfSight(scene, 0)
    assert [sight.look(now, before, quanta) for quanta in (0.0, -0.5, -1.0)] == [NOTHING, OBJECT, NOTHING]


def test_poses_of_more_bodies_than_the_scene_has_are_refused() -> None:
    """Poses of more bodies than the scene has are refused; fewer are accepted."""
    sight = LineOfSight(load_scene("clustering").with_values(robots__count=2, objects__count=2), 0)
    assert sight.look(Poses([(100.0, 100.0, 0.0)], [(120.0, 100.0)])) == OBJECT
    with pytest.raises(ValueError, match="1 robots and 3 objects are more than the scene has"):
        sight.look(Poses([(100.0, 100.0, 0.0)], [(120.0, 100.0)] * 3))
