"""Propagation of infrared light: reflections, strength by distance and angle, bodies in between."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from arena.cli import main
from arena.infrared.propagation import PUBLISHED, Optics, amplitude, beam, brightest, distance_of
from arena.scene import dimensions, geometry
from arena.scene.loader import Scene, load_scene
from arena.scene.schema import ObjectKind, Obstacle
from arena.world.physics import World
from arena.world.poses import Poses
from emu.boards.epuck.analog import reflection_at

UP = math.pi / 2


@pytest.fixture
def scene() -> Scene:
    return load_scene("clustering").with_values(robots__count=2, objects__count=1)


def test_surfaces_have_distance_and_reflection(scene: Scene) -> None:
    """Each sensor axis yields the distance of the nearest surface in mm and its reflection share; the distance is inf
    beyond the response table. Bearings are clockwise from the front."""
    scene = scene.with_values(infrared__object_share=0.6, infrared__wall_share=0.9)
    seen = Optics(scene).surfaces(Poses([(8.7, 150.0, UP)], [(17.5, 150.0)]), 0)
    assert seen[2] == pytest.approx((10 * (8.8 - 3.7 - 5.0), 0.6))  # sensor 2 faces right, to the object
    assert seen[5] == pytest.approx((10 * (8.7 - 3.7), 0.9))  # sensor 5 faces left, to the wall
    assert seen[0] == seen[7] == (math.inf, 0.0)


def test_a_wall_at_an_angle_reflects_by_the_cosine(scene: Scene) -> None:
    """For sensor 2, which faces 90 degrees to the right, and a robot turned by 30 degrees, the distance to a wall is
    multiplied by 2/sqrt(3) and the share by cos 30."""
    optics = Optics(scene)
    straight, askew = (optics.surfaces(Poses([(8.7, 150.0, a)], []), 0)[2] for a in (-UP, -UP + math.pi / 6))
    assert straight == pytest.approx((50.0, 1.0))
    assert askew.millimetres == pytest.approx(10 * (8.7 / math.cos(math.pi / 6) - 3.7))
    assert askew.share == pytest.approx(math.cos(math.pi / 6))


def received(scene: Scene, *robots: tuple[float, float, float], objects: tuple[tuple[float, float], ...] = ()) -> float:
    """Return the counts on the strongest sensor of robot 0 while all emitters of robot 1 are lit."""
    found = Optics(scene).signals(Poses(robots, objects), 0, [1])
    return max((sum(one.counts) * max(one.shares) for one in found), default=0.0)


def test_the_strength_of_light_equals_the_published_table(scene: Scene) -> None:
    """swarmcom.md §3.1: the fit of light strength over distance has a logarithmic error of 6.3 % and is limited only
    at its strongest value."""
    right = (100.0, 150.0, UP)
    errors = []
    for distance, counts in PUBLISHED:
        shining = (100 + distance, 150.0, math.pi + math.radians(31.5))  # its front points to the right of the line
        errors.append(math.log(received(scene, right, shining) / counts))
    assert math.sqrt(sum(error**2 for error in errors) / len(errors)) == pytest.approx(0.063, abs=0.004)
    assert [amplitude(distance) for distance in (3.0, 7.4)] == [3500.0, 3500.0]
    assert distance_of(amplitude(33.0)) == pytest.approx(33.0)
    assert received(scene, right, (230.0, 150.0, UP)) == pytest.approx(amplitude(130) / brightest(20.0), rel=3e-3)
    assert received(scene, right, (245.0, 150.0, UP)) == 0


def test_light_falls_off_both_axes_as_powers_of_the_cosine(scene: Scene) -> None:
    """Light halves at 15 degrees from an emitter's axis and at 36 degrees from a receiver's axis (swarmcom.md §7)."""
    here, there = (100.0, 150.0, UP), (120.0, 150.0, UP)  # sensor 2 faces sensor 5 of the other robot
    counts = amplitude(20.0) / brightest(20.0)
    assert received(scene, here, there) == pytest.approx(counts, rel=3e-3)
    turned = Optics(scene).signals(Poses([here, (120.0, 150.0, UP + math.radians(15))], []), 0, [1])[0]
    assert turned.counts[1] == pytest.approx(counts / 2, rel=0.01)  # emitter 5 is on line 1
    aside = Optics(scene).signals(Poses([(100.0, 150.0, UP + math.radians(36)), there], []), 0, [1])[0]
    assert aside.shares[2] == pytest.approx(0.5, rel=0.01)
    wide = scene.with_values(infrared__emitter_power=0.0, infrared__signal_gain=2.0)
    assert brightest(0.0) == 8
    assert received(wide, here, there) == pytest.approx(2 * amplitude(20.0))


def test_walls_objects_and_other_robots_block_the_light(scene: Scene) -> None:
    here, there = (100.0, 150.0, UP), (130.0, 150.0, UP)
    assert received(scene, here, there, objects=((115.0, 144.9),)) > 0
    assert received(scene, here, there, objects=((115.0, 145.1),)) == 0
    assert received(scene, here, there, (115.0, 153.6, 0.0)) == 0
    assert received(scene, here, there, (115.0, 153.8, 0.0)) > 0
    bent = scene.with_values(arena__polygon=((0, 0), (300, 0), (300, 300), (115, 140), (110, 300), (0, 300)))
    assert received(bent, here, there) == 0
    assert received(bent, here, (100.0, 120.0, UP)) > 0


@pytest.mark.parametrize(("height_cm", "blocks"), [(0.2, False), (2.4, False), (2.5, True), (50.0, True)])
def test_bodies_lower_than_the_ring_neither_block_nor_reflect(scene: Scene, height_cm: float, blocks: bool) -> None:
    """Light passes over a sill or a disc lower than 2.5 cm, the height of the ring (epuck.md §9)."""
    sill = Obstacle(polygon=((107.4, 95), (107.6, 95), (107.6, 105), (107.4, 105)), height_cm=height_cm)
    disc = Obstacle(x_cm=107.5, y_cm=100, radius_cm=1, height_cm=height_cm)
    kind = ObjectKind(radius_cm=1, height_cm=height_cm, place="poses", poses=((107.5, 100),))
    poses = [(100.0, 100.0, 0.0), (115.0, 100.0, math.pi)]
    empty = replace(scene, objects=replace(scene.objects, count=0))
    for one, objects in (
        (replace(empty, obstacles=(sill,)), []),
        (replace(empty, obstacles=(disc,)), []),
        (replace(scene, kinds=(kind,), objects=replace(scene.objects, count=1)), [(107.5, 100.0)]),
    ):
        optics = Optics(one)
        assert bool(optics.signals(Poses(poses, objects), 0, [1])) is not blocks
    optics = Optics(replace(empty, obstacles=(replace(sill, polygon=((103, 90), (104, 90), (104, 110), (103, 110))),)))
    assert math.isfinite(optics.surfaces(Poses(poses[:1], []), 0)[0].millimetres) is blocks


def meeting(x: float, y: float, east: float, north: float, side: geometry.Side) -> float:
    """Return the distance at which a ray from a point hits a side, or inf if it misses."""
    x1, y1, x2, y2 = side
    ex, ey = x2 - x1, y2 - y1
    across = east * ey - north * ex
    if across == 0:
        return float("inf")
    along = ((x1 - x) * ey - (y1 - y) * ex) / across
    part = ((x1 - x) * north - (y1 - y) * east) / across
    return along if along > 0 and 0 <= part <= 1 else float("inf")


def plain_signals(scene: Scene, poses: Poses, robot: int) -> list[tuple[int, float, list[float]]]:
    """Return the light signals at a robot by a reference calculation.

    A signal is (sending robot, counts on a sensor that faces it, share of each sensor).
    """
    x, y, heading = poses.robots[robot]
    discs = [(*place[:2], dimensions.ROBOT_RADIUS) for place in poses.robots]
    discs += [(*place, scene.kind_of(number).radius_cm) for number, place in enumerate(poses.objects)]
    discs += [(one.x_cm, one.y_cm, one.radius_cm) for one in scene.obstacles if one.radius_cm]
    shapes = [scene.arena.polygon, *(one.polygon for one in scene.obstacles)]
    found = []
    for other, (to_x, to_y, turned) in enumerate(poses.robots):
        strength = amplitude(math.dist((x, y), (to_x, to_y)))
        line = (x, y, to_x, to_y)
        hidden = any(geometry.distance_to(*disc[:2], line) < disc[2]
                     for number, disc in enumerate(discs) if number not in (robot, other))  # fmt: skip
        hidden |= any(meeting(x, y, to_x - x, to_y - y, side) < 1
                      for shape in shapes if shape for side in geometry.sides(shape))  # fmt: skip
        if other != robot and strength >= 0.1 and not hidden:
            towards = math.atan2(to_y - y, to_x - x)
            counts = strength / brightest(20.0) * sum(beam(towards + math.pi - turned, 20.0))
            found.append((other, counts, beam(towards - heading, 3.3)))
    return found


def plain_surfaces(scene: Scene, poses: Poses, robot: int) -> list[tuple[float, float]]:
    """Return the surface that each sensor axis hits by a reference calculation: distance in mm and reflection share."""
    x, y, heading = poses.robots[robot]
    width, height = scene.arena.width_cm, scene.arena.height_cm
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    room = geometry.sides(corners) if scene.arena.walls else []
    room += geometry.sides(scene.arena.polygon) if scene.arena.polygon else []
    sides = [(side, scene.infrared.wall_share) for side in room]
    sides += [(side, one.share) for one in scene.obstacles if one.polygon for side in geometry.sides(one.polygon)]
    kinds = map(scene.kind_of, range(len(poses.objects)))
    discs = [(*place, one.radius_cm, one.share) for place, one in zip(poses.objects, kinds, strict=True)]
    discs += [(one.x_cm, one.y_cm, one.radius_cm, one.share) for one in scene.obstacles if one.radius_cm]
    discs += [(*one[:2], dimensions.ROBOT_RADIUS, scene.infrared.robot_share)
              for i, one in enumerate(poses.robots) if i != robot]  # fmt: skip
    found = []
    for bearing in dimensions.IR_BEARINGS_DEG:
        east, north = math.cos(heading - math.radians(bearing)), math.sin(heading - math.radians(bearing))
        met = []
        for side, share in sides:
            dx, dy = side[2] - side[0], side[3] - side[1]
            askew = abs(east * dy - north * dx) / math.hypot(dx, dy)
            met.append((meeting(x, y, east, north, side), share * askew))
        for at_x, at_y, radius, share in discs:
            dx, dy = at_x - x, at_y - y
            along, aside = dx * east + dy * north, dx * north - dy * east
            if along > 0 and abs(aside) < radius:
                half = math.sqrt(radius * radius - aside * aside)
                met.append((along - half, share * half / radius))
        distance, share = min(met, default=(math.inf, 0.0))
        gap = max(distance - dimensions.ROBOT_RADIUS, 0.0)
        found.append((10 * gap, share) if gap <= dimensions.IR_RANGE else (math.inf, 0.0))
    return found


def beam_surfaces(scene: Scene, poses: Poses, robot: int, rays: int) -> list[tuple[float, float]]:
    """Return the surface that each sensor faces with `rays` rays within 15 degrees of its axis, by a reference
    calculation: the nearest distance in mm, and the share of the reflections of a white wall at this distance."""
    turns = [math.radians(15) * (2 * ray / (rays - 1) - 1) for ray in range(rays)]
    robots, (x, y, heading) = list(poses.robots), poses.robots[robot]
    by_turn = []
    for turn in turns:
        robots[robot] = x, y, heading + turn
        by_turn.append(plain_surfaces(scene, Poses(robots, poses.objects), robot))
    found = []
    for rows in zip(*by_turn, strict=True):
        nearest, radius = min(distance for distance, _ in rows), 10 * dimensions.ROBOT_RADIUS
        if math.isinf(nearest):
            found.append((math.inf, 0.0))
            continue
        white = sum(math.cos(turn) * reflection_at((radius + nearest) / math.cos(turn) - radius) for turn in turns)
        found.append((nearest, min(sum(share * reflection_at(distance) for distance, share in rows) / white, 1.0)))
    return found


def test_beams_of_several_rays_equal_the_reference() -> None:
    """With five rays per sensor, native propagation gives the surfaces of the reference."""
    scene = load_scene("avoidance").with_values(infrared__wall_share=0.7)
    beams, partly = Optics(scene.with_values(infrared__side_rays=2)), 0
    for seed in range(40):
        poses = World(scene, seed).poses
        for robot in range(4):
            for one, other in zip(beam_surfaces(scene, poses, robot, 5), beams.surfaces(poses, robot), strict=True):
                assert other == pytest.approx(one, rel=1e-7, abs=1e-7)
                partly += 0 < one[1] < 0.1
    assert partly > 10


@pytest.mark.parametrize("distance", [0.0, 4.0, 20.0, 55.0, 96.0])
def test_a_wall_across_the_axis_gives_the_published_response(distance: float) -> None:
    """With several rays a white wall across the axis has the distance and the reflection that a single ray has."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=0, infrared__side_rays=3)
    poses = Poses([(dimensions.ROBOT_RADIUS + distance / 10, 150.0, math.pi / 2)], [])
    assert Optics(scene).surfaces(poses, 0)[5] == pytest.approx((distance, 1.0), abs=1e-9)


def test_a_beam_sees_a_post_beside_the_axis() -> None:
    """A thin object 12 degrees beside the axis reflects into one of three rays, and not into a single one."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=1, objects__radius_cm=0.5)
    at = math.radians(90 + 14)
    poses = Poses([(200.0, 150.0, 0.0)], [(200 + 7 * math.cos(at), 150 + 7 * math.sin(at))])
    one, three = (Optics(scene.with_values(infrared__side_rays=sides)).surfaces(poses, 0)[5] for sides in (0, 1))
    assert one == (math.inf, 0.0)
    assert 26 < three.millimetres < 30
    assert 0.1 < three.share < 0.4


@pytest.mark.parametrize("walls", [True, False])
def test_native_propagation_equals_the_reference(walls: bool) -> None:
    """Native propagation gives the signals and surfaces of the reference for random robots and objects in a yard with
    all kinds of obstacles, with and without walls around it."""
    scene = load_scene("avoidance").with_values(infrared__wall_share=0.7)
    if not walls:
        scene = replace(scene, arena=replace(scene.arena, polygon=(), walls=False))
    kinds = load_scene("foraging").kinds
    scene = replace(scene, kinds=kinds, objects=replace(scene.objects, count=6))
    optics, count = Optics(scene), 0
    for seed in range(100):
        poses = World(scene, seed).poses
        plain, found = plain_signals(scene, poses, 0), optics.signals(poses, 0, [1, 2, 3])
        assert [one.robot for one in found] == [one[0] for one in plain]
        for one, (_, counts, shares) in zip(found, plain, strict=True):
            assert sum(one.counts) == pytest.approx(counts, rel=1e-9)
            assert one.shares == pytest.approx(shares, rel=1e-9, abs=1e-12)
        count += len(found)
        for one, other in zip(plain_surfaces(scene, poses, 0), optics.surfaces(poses, 0), strict=True):
            assert other == pytest.approx(one, rel=1e-9, abs=1e-9)
    assert count > 50
    with pytest.raises(ValueError, match="7 objects are more than the scene has"):
        optics.surfaces(Poses([(9.0, 9.0, 0.0)], [(9.0, 9.0)] * 7), 0)


def test_the_channel_is_printed_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`arena channel` prints the properties of the channel and draws the figure of the documentation."""
    path = tmp_path / "channel.svg"
    assert main(["channel", "--set", "infrared.signal_gain=0.5", "--figure", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["table"][5]["model"] == pytest.approx(amplitude(10.0) / 2, rel=0.01)
    assert "<svg" in path.read_text()
    assert main(["channel"]) == 0
    assert "6.1 %" in capsys.readouterr().out
    assert main(["channel", "nowhere"]) == 2
