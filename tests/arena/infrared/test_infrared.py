"""Infrared sensors in the world: reflections, room light, lamps, other robots' emitters; and the battery (epuck.md
§5)."""

from __future__ import annotations

import json
import math
import random
import statistics
import subprocess
import sys
from collections.abc import Callable
from ctypes import addressof
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from arena.cli import main
from arena.infrared.channel import OpticalChannel, light_code
from arena.infrared.propagation import PUBLISHED, Optics, amplitude, beam, brightest, distance_of
from arena.infrared.ring import InfraredRing, ambient
from arena.robots.firmware_controller import FirmwareController, volts_after
from arena.scene import dimensions, geometry
from arena.scene.loader import FCY, Scene, SceneError, load_scene
from arena.scene.schema import ObjectKind, Obstacle
from arena.world.physics import Poses, World
from emu.boards.epuck.analog import Infrared, reflection_at
from emu.boards.epuck.board import Epuck
from emu.boards.noise import Noise
from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.machine.machine import Machine
from emu.system.record import Record
from tests.arena import reference_light
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
UP = math.pi / 2

LISTENER = """
        .include "p30F6014A.inc"
        .bss
        .global _dark, _lit, _count
_dark:  .space  2
_lit:   .space  2
_count: .space  2
        .text
        .global _main
_main:  mov     #0x03FF, w0             ; AN10 = sensor 2 is analog
        mov     w0, ADPCFG
        mov     #0x00E0, w0             ; automatic conversion after sampling
        mov     w0, ADCON1
        mov     #0x0A1F, w0
        mov     w0, ADCON3
        mov     #10, w0
        mov     w0, ADCHS
        bset    ADCON1, #15
        bclr    TRISG, #0               ; pulse line 2: sensors 2 and 6
1:      bclr    LATG, #0
        rcall   pause
        rcall   convert
        mov     w0, _dark
        bset    LATG, #0
        rcall   pause
        rcall   convert
        mov     w0, _lit
        inc     _count
        bra     1b
pause:  mov     #8000, w1               ; longer than a quantum of 1 ms, and than the receiver takes to settle
2:      dec     w1, w1
        bra     nz, 2b
        return
convert: bclr   ADCON1, #0              ; DONE of the last time
        bset    ADCON1, #1
3:      btss    ADCON1, #0
        bra     3b
        mov     ADCBUF0, w0
        return
"""

SCANNER = """
        .include "p30F6014A.inc"
        .bss
        .global _rounds, _sum
_rounds: .space 2
_sum:   .space  2
        .text
        .global _main, __ADCInterrupt
_main:  mov     #0x00FF, w0
        mov     w0, ADPCFG
        mov     #0xFF00, w0
        mov     w0, ADCSSL
        mov     #0x041E, w0             ; scan, eight results an interrupt, in halves
        mov     w0, ADCON2
        mov     #0x1F13, w0             ; as the infrared link does
        mov     w0, ADCON3
        bset    IEC0, #11
        mov     #0x80E4, w0
        mov     w0, ADCON1
1:      pwrsav  #1
        bra     1b
__ADCInterrupt:
        bclr    IFS0, #11
        inc     _rounds
        mov     #ADCBUF0, w1
        btss    ADCON2, #7
        mov     #ADCBUF8, w1
        mov     _sum, w0
        repeat  #7
        add     w0, [w1++], w0
        mov     w0, _sum
        retfie
"""

SENDER = """
        .include "p30F6014A.inc"
        .text
        .global _main
_main:  bclr    TRISG, #0
1:      btg     LATG, #0                ; lights sensors 2 and 6 half of the time, 2 ms each
        mov     #9830, w1
2:      dec     w1, w1
        bra     nz, 2b
        bra     1b
"""


@pytest.fixture
def scene() -> Scene:
    return load_scene("clustering").with_values(robots__count=2, objects__count=1)


def built(folder: Path, text: str, name: str) -> Path:
    source, image = folder / f"{name}.s", folder / f"{name}.elf"
    source.write_text(text)
    command = [sys.executable, "-m", "toolchain", "cc", str(source), "-o", str(image)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    return image


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


def test_a_lamp_lowers_the_counts_of_facing_sensors_by_the_inverse_square(scene: Scene) -> None:
    """Raw counts of a sensor that faces a lamp decrease with the inverse square of the distance, but not below 0
    (epuck.md §5)."""
    pose = (100.0, 150.0, 0.0)
    assert ambient(scene, pose) == [3800] * 8
    lit = ambient(scene.with_values(light__lamp_x_cm=200.0, light__lamp_y_cm=150.0, light__lamp_counts=800.0), pose)
    assert lit[0] == lit[7] == round(3800 - 800 * math.cos(math.radians(18)))
    assert lit[3] == lit[4] == 3800  # on the far side
    near = ambient(scene.with_values(light__lamp_x_cm=105.0, light__lamp_y_cm=150.0, light__lamp_counts=800.0), pose)
    assert near[0] == 0


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
    room = geometry.sides(corners) + (geometry.sides(scene.arena.polygon) if scene.arena.polygon else [])
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
        distance, share = min(met)
        gap = max(distance - dimensions.ROBOT_RADIUS, 0.0)
        found.append((10 * gap, share) if gap <= dimensions.IR_RANGE else (math.inf, 0.0))
    return found


def test_native_propagation_equals_the_reference() -> None:
    """Native propagation gives the signals and surfaces of the reference for random robots and objects in a yard with
    all kinds of obstacles."""
    scene = load_scene("avoidance").with_values(infrared__wall_share=0.7)
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


def test_light_arrives_one_quantum_late_for_any_order_of_robots() -> None:
    """Light arrives one quantum late, so the record does not depend on the order in which robots run."""
    channel = OpticalChannel(2, 1000, tau=1e-3)
    channel.switch(1, 5000, 2, lit=True)
    channel.switch(1, 6500, 2, lit=False)
    assert [channel.levels(1, cycle)[2] for cycle in (6063, 6065, 7563, 7565)] == [0, 1, 1, 0]
    assert [channel.is_dark(1, *span) for span in ((6000, 6063), (6000, 6064), (7563, 9000), (7565, 9000))] == [
        True, False, False, True]  # fmt: skip
    for cycle in range(10_000, 900_000, 1000):
        channel.switch(1, cycle, 0, lit=bool(cycle // 1000 % 2))
    assert channel.levels(1, 900_500)[0] == 1
    assert channel.emitter(1).count <= 257


def test_receivers_are_first_order_low_passes_for_any_order_of_queries() -> None:
    """A receiver follows the first-order recursion from the start of the trial, also for pulses much shorter than its
    time constant. Neither the order of the queries nor dropped changes affect it."""
    tau, quantum, rng = 885.0, 14_746, random.Random(5)
    at, switches = 0, []
    for number in range(2000):
        at += rng.choice((150, 600, 2500, 30_000 if number % 50 == 0 else 900))
        switches.append(at)
    asked = sorted(rng.randrange(switches[-600], switches[-1]) for _ in range(300))
    truth = {}
    share, lit, now, turn = 0.0, 0, 0, iter([*switches, 1 << 40])
    change = next(turn)
    for cycle in asked:
        while change <= cycle:
            share, now, lit, change = lit + (share - lit) * math.exp(-(change - now) / tau), change, 1 - lit, next(turn)
        truth[cycle] = lit + (share - lit) * math.exp(-(cycle - now) / tau)
    for shuffled in (False, True):
        channel = OpticalChannel(1, quantum, tau=tau)
        channel.horizon = switches[-600]
        for number, cycle in enumerate(switches):
            channel.switch(0, cycle, 3, lit=number % 2 == 0)
        order = rng.sample(asked, len(asked)) if shuffled else asked
        late = quantum + 64
        for cycle in order:
            assert channel.levels(0, cycle + late)[3] == pytest.approx(truth[cycle], abs=1e-6)
            assert not (channel.is_dark(0, cycle + late, cycle + late) and truth[cycle] > 1e-6)


def test_firmware_reads_reflections_and_another_robots_light(scene: Scene, tmp_path: Path) -> None:
    """The firmware converts sensor 2 with its emitter off and on, beside an object, and measures the reflection;
    beside a blinking robot it measures that robot's light."""
    listener, sender = built(tmp_path, LISTENER, "listener"), built(tmp_path, SENDER, "sender")
    channel = OpticalChannel(2, scene.clock.quantum_tcy)
    ears = FirmwareController(scene, 1, 0, listener, 0, channel)
    mouth = FirmwareController(scene, 1, 1, sender, 0, channel)
    beside_object = Poses([(100.0, 150.0, UP), (300.0, 150.0, 0.0)], [(100 + 3.7 + 2.0 + 5.0, 150.0)])
    for tick in range(200):
        assert ears.control_step(tick, beside_object) == (0.0, 0.0)
    assert ears.machine.peek("count") > 40
    difference = ears.machine.peek("dark") - ears.machine.peek("lit")
    assert difference == pytest.approx(reflection_at(20.0) * scene.infrared.object_share, abs=2)
    assert ears.reading().infrared is not None
    assert mouth.reading().infrared is None

    beside_robot = Poses([(100.0, 150.0, UP), (100 + 7.4 + 12.5, 150.0, -UP)], [(300.0, 20.0)])
    dark = set()
    for tick in range(200, 300):
        ears.control_step(tick, beside_robot)
        mouth.control_step(tick, beside_robot)
        dark.add(ears.machine.peek("dark"))
    assert max(dark) == scene.light.ambient_counts
    assert min(dark) == pytest.approx(scene.light.ambient_counts - amplitude(19.9) / brightest(20.0), abs=1)


def test_samples_have_the_scenes_noise_ripple_and_spread(scene: Scene, tmp_path: Path) -> None:
    """Converted samples have the noise, ripple and spread of the scene. The same seed gives the same samples; other
    robots and seeds give others."""
    listener = built(tmp_path, LISTENER, "listener")
    poses = Poses([(100.0, 150.0, UP), (300.0, 150.0, 0.0)], [(300.0, 20.0)])

    def dark(seed: int, robot: int, **keys: float) -> list[int]:
        controller = FirmwareController(scene.with_values(**keys), seed, robot, listener)
        found = []
        for tick in range(600):
            controller.control_step(tick, poses)
            if controller.machine.peek("dark"):
                found.append(controller.machine.peek("dark"))
        return found[10:]

    noisy = dark(1, 0, infrared__noise_counts=8.0)
    assert statistics.mean(noisy) == pytest.approx(3800, abs=3)
    assert statistics.pstdev(noisy) == pytest.approx(8.0, rel=0.2)
    assert dark(1, 0, infrared__noise_counts=8.0) == noisy
    assert dark(1, 1, infrared__noise_counts=8.0) != noisy != dark(2, 0, infrared__noise_counts=8.0)
    ripple = dark(1, 0, infrared__ripple_counts=50.0)
    assert (min(ripple), max(ripple)) == (pytest.approx(3750, abs=4), pytest.approx(3850, abs=4))
    (level,) = set(dark(1, 0, light__ambient_sd_counts=100.0))
    assert level != 3800
    assert level == pytest.approx(3800, abs=400)
    with pytest.raises(SceneError, match=r"infrared\.tau_us is 0\.0; expected 1 to 1000"):
        scene.with_values(infrared__tau_us=0)


def lit_of_frames(scene: Scene, seed: int, share: float) -> list[list[int]]:
    """Return the scans (0.25 ms each) in which a sensor detects the light of each of 30 frames, sent 100 ms apart by
    another robot.

    A proximity pulse ends 2 ms before each frame. A frame has dark intervals of up to 20 bits between ones of 0.73
    ms.
    """
    scene, channel = scene.with_values(infrared__lost_share=share), OpticalChannel.of(scene)
    ring = InfraredRing(scene, seed, (board := Machine(DSPIC30F6014A, board=Epuck).board), channel, 0, 0)
    poses = Poses([(100.0, 150.0, UP), (100 + 7.4 + 12.5, 150.0, -UP)], [(300.0, 20.0)])
    scan, frame = FCY // 4096, "111111" + "".join("0" * dark + "1" for dark in (1, 4, 9, 15, 20, 4, 5, 12))
    found = []
    for start in range(FCY // 10, FCY // 10 * 31, FCY // 10):
        channel.horizon = start
        channel.switch(1, start - 12 * scan, 2, True)
        channel.switch(1, start - 9 * scan, 2, False)
        for place, (bit, before) in enumerate(zip(frame + "0", "0" + frame, strict=True)):
            if bit != before:
                channel.switch(1, start + 3 * scan * place, 2, bit == "1")
        board.ir.events.now = now = start + channel.delay
        ring.begin_quantum(poses)
        board.ir._level(0, now)
        times = range(now, now + 3 * scan * len(frame), scan)
        seen = [light_code()["light"](addressof(ring._light), 2, cycle + scan // 2) > 10 for cycle in times]
        found.append([place for place, is_lit in enumerate(seen) if is_lit])
    return found


def test_a_share_of_the_frames_is_lost_as_a_whole(scene: Scene) -> None:
    """In a lost frame no receiver detects ten scans of light in a row, with which frames begin
    (firmware/openswarm/io/infrared). In other frames it detects all light. This holds for any dark interval in a
    frame and for light before it. The seed determines which frames are lost."""
    (whole,) = {tuple(one) for one in lit_of_frames(scene, 2, 0.0)}
    assert whole[:18] == tuple(range(18))
    half = lit_of_frames(scene, 2, 0.5)
    assert half == lit_of_frames(scene, 2, 0.5) != lit_of_frames(scene, 3, 0.5)
    kept = [one for one in half if one == list(whole)]
    assert 8 <= len(kept) <= 22
    lost = [one for one in half if one != list(whole)] + lit_of_frames(scene, 2, 1.0)
    assert len(lost) == 60 - len(kept)
    for one in lost:
        assert set(one) < set(whole)
        assert all(one[place] > one[place - 4] + 4 for place in range(4, len(one)))
        assert 0.2 * len(whole) < len(one) < 0.5 * len(whole)


def test_a_robot_without_battery_is_at_rest_and_dark(scene: Scene, tmp_path: Path) -> None:
    """A robot whose battery is empty from a given second on stops and turns its LEDs off; the record has no fault of
    it."""
    sender = built(tmp_path, SENDER, "sender")
    scene = scene.with_values(start__off=[[1, 0.2]], start__silent_s=0.1)
    channel = OpticalChannel.of(scene)
    mouth = FirmwareController(scene, 1, 1, sender, 0, channel)
    poses = Poses([(100.0, 150.0, UP), (200.0, 150.0, -UP)], [(300.0, 20.0)])
    lit = []
    for tick in range(300):
        assert mouth.control_step(tick, poses) == (0.0, 0.0)
        if tick % 4 == 0:
            lit.append(not channel.is_dark(1, tick * scene.clock.quantum_tcy, (tick + 4) * scene.clock.quantum_tcy))
    assert any(lit[:50])
    assert not any(lit[52:])
    assert mouth.machine.cycle < 0.201 * FCY
    assert not mouth.reading().fault


def test_native_light_equals_the_reference_to_the_bit(scene: Scene) -> None:
    """The light at each sensor equals the reference to the bit. Three robots switch emitters at random, sometimes for
    longer than the history, with noise and a third of the transmissions lost."""
    rng, checked = random.Random(3), 0
    scene = scene.with_values(robots__count=4, infrared__lost_share=0.3, infrared__noise_counts=2.0)
    for trial in range(6):
        channel = OpticalChannel.of(scene)
        ring = InfraredRing(scene, trial, (board := Machine(DSPIC30F6014A, board=Epuck).board), channel, 0, 5000)
        poses = Poses([(100 + 12 * i, 150 + 9 * (i % 2), rng.uniform(-3, 3)) for i in range(4)], [(20.0, 20.0)])
        tracks: dict[int, tuple[list[int], list[int]]] = {}
        for robot in (1, 2, 3):
            cycles, lit = tracks.setdefault(robot, ([], [0]))
            at = rng.randrange(100_000)
            for _ in range(rng.choice((5, 100, 700))):
                at += rng.choice((2, 300, 2500, 11_000, 60_000))
                line = rng.randrange(4)
                channel.switch(robot, at, line, lit=not lit[-1] >> line & 1)
                cycles.append(at)
                lit.append(lit[-1] ^ 1 << line)
        last = max(cycles[-1] for cycles, _ in tracks.values())
        channel.horizon = last - 200_000
        board.ir.events.now = now = last - 100_000
        ring.begin_quantum(poses)
        board.ir._level(0, now - 4000)
        seen, light = {one.robot: one for one in Optics(scene).signals(poses, 0, [1, 2, 3])}, light_code()["light"]
        setting = ring._light
        for _ in range(200):
            cycle, sensor = now - 4000 + rng.randrange(channel.quantum), rng.randrange(8)
            heard = [(robot, seen[robot].counts, seen[robot].shares[sensor], *track)
                     for robot, track in tracks.items() if robot in seen and seen[robot].shares[sensor]]  # fmt: skip
            receivers = channel.tau, channel.receivers.settled
            loss = setting.lost_share, setting.lost_seen, setting.lost_period
            plain = reference_light.light(heard, cycle + 5000, setting.seed, channel.delay, receivers, loss)
            checked += plain != 0
            plain += 2.0 * reference_light.gaussian(setting.seed, sensor, cycle + 5000)
            assert light(addressof(setting), sensor, cycle) == plain, f"trial {trial}"
    assert checked > 200


def test_native_sensors_equal_the_reference_to_the_bit() -> None:
    """Native sensor levels equal the reference for randomly switched emitters, surfaces, room light and noise."""
    rng, machine = random.Random(4), Machine(DSPIC30F6014A, board=partial(Epuck, seed=9))
    ir, noise = machine.board.ir, Noise(Record(0), 9)
    state, now, tau = dict.fromkeys(range(4), (0, 0, 0.0)), 0, ir.tau_seconds * machine.peripherals.fcy

    def settled(line: int, cycle: int) -> float:
        since, lit, start = state[line]
        if cycle - since > 45 * 60e-6 * 30e6:
            return float(lit)
        return lit + (start - lit) * math.exp(-max(cycle - since, 0) / tau)

    for _ in range(300):
        now += rng.choice((3, 400, 5000, 200_000))
        machine.events.now = now
        ir.set_distance(rng.randrange(8), rng.uniform(0, 110), rng.random())
        ir.set_ambient(rng.randrange(8), rng.randrange(3000, 4096))
        machine.board.noise.strength = noise.strength = rng.choice((0.0, 0.5, 1.0))
        line, lit = rng.randrange(4), rng.randrange(2)
        share = settled(line, now)
        ir._switched(line, now, 1, lit)
        state[line] = now, lit, round(share * 0xFFFF) / 0xFFFF
        for _ in range(8):
            sensor, cycle = rng.randrange(8), now + rng.randrange(6000)
            lowered = ir.reflection[sensor] * settled(sensor % 4, cycle)
            spread = max(5.0, 0.03 * lowered)
            raw = round(ir.ambient[sensor] - lowered + noise.at(8 + sensor, cycle, spread))
            assert ir._level(sensor, cycle) == min(max(raw, 0), 4095) << 4


def test_native_conversions_equal_those_in_python(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Continuous conversions of eight sensors leave the same machine state after 150 quanta, whether Python computes
    every level or almost none. A robot that blinks approaches, with noise."""
    scanner, sender = built(tmp_path, SCANNER, "scanner"), built(tmp_path, SENDER, "sender")
    scene = scene.with_values(infrared__noise_counts=2.0)
    found, asked = [], []
    for native in (False, True):
        if not native:
            monkeypatch.setattr(Infrared, "set_native_ready", lambda _ir, _is_ready: None)
        else:
            monkeypatch.undo()
        channel, count = OpticalChannel.of(scene), [0]
        ears = FirmwareController(scene, 1, 0, scanner, 0, channel)
        mouth = FirmwareController(scene, 1, 1, sender, 0, channel)
        ears.machine.runner.threshold, ears.machine.runner.wait = 1, True
        level = ears._board.ir._level_of

        def counted(*where: int, level: Callable[..., int] = level, count: list[int] = count) -> int:
            count[0] += 1
            return level(*where)

        ears._board.ir._level_of = counted  # type: ignore[misc]
        for tick in range(150):
            poses = Poses([(100.0, 150.0, UP), (125.0 - tick / 20, 150.0, -UP)], [(300.0, 20.0)])
            ears.control_step(tick, poses)
            mouth.control_step(tick, poses)
        assert ears.machine.peek("rounds") > 350
        found.append(ears.machine.snapshot())
        asked.append(count[0])
    assert found[0] == found[1]
    assert asked[1] < asked[0] / 4


def test_noise_is_gaussian_with_its_tails() -> None:
    """The shares of 300,000 noise draws beyond 1, 3 and 4 deviations are those of the normal distribution."""
    draws = [reference_light.gaussian(7, cycle % 8, cycle) for cycle in range(300_000)]
    assert statistics.fmean(draws) == pytest.approx(0, abs=0.005)
    for limit, share in ((1, 0.31731), (3, 0.0027), (4, 6.3e-5)):
        found = sum(abs(one) > limit for one in draws) / len(draws)
        assert found == pytest.approx(share, rel=0.5 if limit == 4 else 0.1)


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


def test_the_battery_discharges_linearly_and_its_pin_falls(scene: Scene) -> None:
    """epuck.md §1, §2: a full battery is low after about 3 h, and the pin BATT_LOW is 0 below 3.4 V."""
    assert volts_after(scene.battery, 0) == 4.0
    assert volts_after(scene.battery, 3600) == pytest.approx(4.0 - 0.8 / 3)
    assert volts_after(scene.battery, 1e6) == 3.0


def test_a_low_battery_shows_on_the_pin(scene: Scene, tmp_path: Path) -> None:
    """A battery that lasts one second and starts at 3.5 V pulls BATT_LOW down within half a second."""
    low = scene.with_values(battery__volts=3.45, battery__hours=0.01)
    controller = FirmwareController(low, 1, 0, built(tmp_path, SENDER, "sender"))
    pins = []
    poses = Poses([(100.0, 150.0, 0.0), (200.0, 150.0, 0.0)], [(300.0, 20.0)])
    for tick in range(4000):
        controller.control_step(tick, poses)
        if tick % 500 == 499:
            controller.reading()
            pins.append(controller.machine.peek("PORTF") >> 1 & 1)
    assert controller.machine.cycle > 3 * FCY
    assert pins[0] == 1
    assert pins[-1] == 0
