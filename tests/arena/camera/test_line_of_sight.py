"""The line-of-sight sensor of robots without firmware (line_of_sight.c)."""

from __future__ import annotations

import math
import random

import pytest

from arena.camera.appearance import NOTHING, OBJECT, ROBOT
from arena.camera.line_of_sight import LineOfSight
from arena.scene.loader import load_scene, scene_of
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
        for _ in range(12):
            places = [(5 + draw.random() * width, 5 + draw.random() * depth) for _ in range(robots + objects)]
            x, y = draw.uniform(5, 295), draw.uniform(5, 295)
            near = min(places, key=lambda place: math.dist(place, (x, y)))  # every second robot looks there
            towards = math.atan2(near[1] - y, near[0] - x) - traits.yaw
            own = x, y, draw.choice([draw.uniform(-math.pi, math.pi), towards])
            poses = Poses([own, *((*place, 0.0) for place in places[:robots])], places[robots:])
            camera = ReferenceCamera(scene, poses, 0, traits=traits)
            seen = LineOfSight(scene, 0, traits).look(poses)
            assert seen == sensor_of(camera), f"seed {base_seed()}: {robots} robots, {objects} objects, from {own}"
            answers.add(seen)
    assert answers == {NOTHING, OBJECT, ROBOT}


def test_answers_equal_the_reference_among_bodies_of_several_kinds() -> None:
    """Kilobots, large and small discs, polygons, obstacles: the answer equals that of the reference camera."""
    draw = random.Random(base_seed())
    triangle, square = [[0, 0], [9, 0], [0, 9]], [[110, 90], [125, 90], [125, 105], [110, 105]]
    answers = set()
    for is_walled in (True, False):
        scene = scene_of({
            "name": "kinds", "arena": {"walls": is_walled},
            "robots": [{"count": 6}, {"kind": "kilobot", "image": "gradient", "count": 20}],
            "objects": [{"count": 8, "radius_cm": 9.0, "height_cm": 40.0, "colour": "green"},
                        {"count": 8, "radius_cm": 1.0}, {"count": 4, "polygon": triangle}],
            "obstacles": [{"polygon": square}, {"x_cm": 200, "y_cm": 200, "radius_cm": 12, "colour": "red"}],
        })  # fmt: skip
        for _ in range(60):
            places = [(draw.uniform(5, 295), draw.uniform(5, 295), draw.uniform(-3, 3)) for _ in range(46)]
            poses = Poses(places[:26], [*((x, y) for x, y, _ in places[26:42]), *places[42:]])
            own = draw.randrange(6)
            seen = LineOfSight(scene, own).look(poses)
            assert seen == sensor_of(ReferenceCamera(scene, poses, own)), f"seed {base_seed()}: robot {own} of {places}"
            answers.add(seen)
    assert answers == {NOTHING, OBJECT, ROBOT}


def test_a_body_at_no_finite_place_hides_no_other() -> None:
    """A robot sees what is before it although other bodies are at places that are no or not finite numbers."""
    draw, odd = random.Random(base_seed()), (math.inf, -math.inf, math.nan, 1e300, -1e300, 1e160)
    scene = load_scene("clustering").with_values(robots__count=40, objects__count=40, arena__walls=False)
    for _ in range(200):
        places = [(draw.choice(odd), draw.choice((5.0, *odd))) for _ in range(78)]
        poses = Poses([(100.0, 100.0, 0.0), *((x, y, 0.0) for x, y in places[:39])], [(120.0, 100.0), *places[39:]])
        seen = LineOfSight(scene, 0).look(poses)
        assert seen == OBJECT or any(map(math.isnan, poses.values))


def test_a_look_within_a_quantum_uses_the_interpolated_pose() -> None:
    """A look between two quanta uses the pose interpolated between the last two."""
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
