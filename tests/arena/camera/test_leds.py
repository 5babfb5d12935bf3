"""LEDs in other robots' cameras: position on the robot, delay, and firmware that reacts to them (epuck.md §2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from arena.camera.appearance import LED_COLOURS, ROBOT, colours_of, led_classes
from arena.camera.renderer import Renderer
from arena.cli import main
from arena.infrared.channel import LINES, OpticalChannel
from arena.robots.epuck import SELECTOR
from arena.robots.firmware_controller import FirmwareController
from arena.scene import dimensions
from arena.scene.loader import Scene, load_scene
from arena.trial.record import read_trial
from arena.world.poses import Poses
from tests.arena.reference_camera import ReferenceCamera
from tests.arena.robots.test_firmware_controller import AT_ONCE

BLINKER = """
        .include "p30F6014A.inc"
        .text
        .global _main
_main:  bclr    TRISA, #6
1:      btg     LATA, #6                ; LED 0: 50 * 147,456 Tcy = 0.5 s
        mov     #50, w1
2:      mov     #49151, w0
3:      dec     w0, w0
        bra     nz, 3b
        dec     w1, w1
        bra     nz, 2b
        bra     1b
"""
CAMERA = (20.0, 150.0, 0.0)
LENS_X = CAMERA[0] + dimensions.CAMERA_AHEAD


@pytest.fixture
def scene() -> Scene:
    return load_scene("clustering").with_values(
        robots__count=2, objects__count=0, robots__wheel_noise=0.0, camera__sees_leds=True, camera__pixel_noise=0.0
    )


def facing(centimetres: float, turned_deg: float = 0.0) -> Poses:
    """Return poses of a camera robot and of a second robot that faces its lens, turned to the left by `turned_deg`."""
    there = LENS_X + centimetres + dimensions.ROBOT_RADIUS
    return Poses([CAMERA, (there, 150.0, math.pi + math.radians(turned_deg))], [])


@pytest.mark.parametrize("led", range(8))
def test_a_ring_led_is_visible_at_its_bearing_and_height(scene: Scene, led: int) -> None:
    """Ring LEDs are 45 degrees apart, clockwise from the front; each is 1 cm wide and 1 cm high in the picture."""
    red, _ = led_classes(scene)
    lens_to_edge = 20.0
    camera = ReferenceCamera(scene, facing(lens_to_edge, 45.0 * led), 0, leds=(0, 1 << led))
    rows = tuple(range(480))
    per_cm = dimensions.FOCAL_PIXELS / lens_to_edge
    lit = [240 + (dimensions.CAMERA_HEIGHT - z) * per_cm for z in dimensions.RING_HEIGHTS]
    found = [row for row, kind in zip(rows, camera.column(320, rows), strict=True) if kind == red]
    assert (found[0], found[-1]) == (pytest.approx(lit[1], abs=1), pytest.approx(lit[0], abs=1))
    middle = round((lit[0] + lit[1]) / 2)
    columns = [u for u in range(640) if camera.column(u, (middle,)) == [red]]
    assert len(columns) == pytest.approx(dimensions.FOCAL_PIXELS / lens_to_edge, abs=2)
    assert np.mean(columns) == pytest.approx(320, abs=1)


def test_the_body_is_lit_as_a_whole_and_a_led_behind_is_invisible(scene: Scene) -> None:
    _, green = led_classes(scene)
    kinds = {leds: set(ReferenceCamera(scene, facing(20.0), 0, leds=(0, leds)).column(320, tuple(range(170, 300))))
             for leds in (0, 1 << 9, 1 << 4, 1 << 8)}  # fmt: skip
    assert green in kinds[1 << 9]
    assert ROBOT not in kinds[1 << 9]
    assert ROBOT in kinds[0]
    assert kinds[1 << 4] == kinds[0]
    assert len(kinds[1 << 8]) == len(kinds[0]) + 1
    assert colours_of(scene)[list(led_classes(scene))].tolist() == [list(one) for one in LED_COLOURS]


def test_renderer_and_reference_camera_agree_on_leds() -> None:
    """The renderer, which works by rows, and the reference camera, which works by columns, agree for random robots
    and LEDs."""
    scene = load_scene("clustering").with_values(
        robots__count=6, objects__count=6, camera__sees_leds=True, camera__pitch_deg=1.0
    )
    rng = np.random.default_rng(4)
    columns, found = np.arange(0, 640, 9), set()
    for _ in range(60):
        at = rng.uniform(-1, 1, (6, 3)) * (25, 25, math.pi) + (200, 150, 0)
        at[0] = 160, 150, 0
        poses = Poses([(float(x), float(y), float(a)) for x, y, a in at],
                      [(float(x), float(y)) for x, y in rng.uniform((180, 130), (260, 170), (6, 2))])  # fmt: skip
        leds = [int(one) for one in rng.integers(1 << 10, size=6)]
        camera, renderer = ReferenceCamera(scene, poses, 0, leds=leds), Renderer(scene, 0)
        renderer.leds[:] = leds
        renderer.set_viewpoint(poses)
        for row in (200, 215, 225, 240, 262):
            seen = renderer.classify_row(row, columns).tolist()
            assert seen == [camera.column(int(u), (row,))[0] for u in columns]
            found |= set(seen)
    assert found >= {ROBOT, *led_classes(scene)}


def test_leds_are_visible_one_quantum_late() -> None:
    channel = OpticalChannel(2, 1000)
    channel.switch(1, 5000, LINES + 9, lit=True)
    assert [channel.leds(1, cycle) for cycle in (6063, 6064)] == [0, 1 << 9]
    assert channel.is_dark(1, 0, 1 << 40)
    for cycle in range(10_000, 900_000, 1000):
        channel.switch(1, cycle, LINES, lit=bool(cycle // 1000 % 2))
    assert channel.leds(1, 900_500) == 1 | 1 << 9
    assert len(channel._leds[1]) <= 310


@pytest.mark.slow
def test_firmware_takes_a_robot_with_a_lit_red_led_for_an_object(
    clustering_image: Path, assembled: Callable[[str], Path], scene: Scene
) -> None:
    """The clustering firmware takes the robot before it for an object while that robot's LED is lit, otherwise for a
    robot. Without `camera.sees_leds` it never takes it for an object."""
    blinker = assembled(BLINKER)
    poses = facing(14.0)
    for sees, until in ((True, 800), (False, 510)):
        one = scene.with_values(camera__sees_leds=sees)
        channel = OpticalChannel.of(one)
        sees_it = FirmwareController(one, 1, 0, clustering_image, SELECTOR["A"] | AT_ONCE, channel)
        blinks = FirmwareController(one, 1, 1, blinker, 0, channel)
        left = []
        for tick in range(until):
            left.append(sees_it.control_step(tick, poses)[0] / dimensions.WHEEL_SPEED)
            blinks.control_step(tick, poses)
        blinks.reading()
        assert [change.leds for change in blinks.take_led_changes()] == ([1, 0] if sees else [1])
        assert np.median(left[300:500]) == pytest.approx(1.0 if sees else 0.1, abs=0.05)
        if sees:
            assert np.median(left[750:]) == pytest.approx(0.1, abs=0.05)


@pytest.mark.slow
def test_records_are_the_same_for_two_threads(
    clustering_image: Path, assembled: Callable[[str], Path], tmp_path: Path
) -> None:
    """LED changes reach other robots' cameras at the same cycle whichever thread runs a robot."""
    blinker = assembled(BLINKER)
    text = f"""name = "leds"
[camera]
sees_leds = true
[start]
remote = ""
[[robots]]
image = "{clustering_image}"
place = "poses"
poses = [[200, 150, 0]]
selector = {SELECTOR["A"] | AT_ONCE}
[[robots]]
image = "{blinker}"
place = "poses"
poses = [[221, 150, 180]]
"""
    path = tmp_path / "leds.toml"
    path.write_text(text)
    records = []
    for jobs in ("1", "2"):
        out = tmp_path / jobs
        command = ["run", str(path), "--trials", "1", "--minutes", "0.02", "--jobs", jobs, "--out", str(out)]
        assert main(command) == 0
        records.append(out / "trial-0001.parquet")
    assert records[0].read_bytes() == records[1].read_bytes()
    assert any(read_trial(records[0]).columns["lights"])
