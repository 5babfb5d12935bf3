"""Infrared between robots and world: reflections, room light, a lamp, other robots' emitters; battery (epuck.md §5)."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from arena.emulated import EmulatedBrain, volts_after
from arena.ether import Ether
from arena.infrared import SIGNAL_COUNTS, SIGNAL_RANGE, ambient, signals, surfaces
from arena.scene import FCY, Scene, load_scene
from arena.world import Poses
from emu.boards.epuck.analog import reflection_at

ROOT = Path(__file__).resolve().parents[2]
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
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    return image


def test_rays_measure_from_the_body_to_walls_and_discs_with_their_reflection(scene: Scene) -> None:
    """Bearings clockwise from the front, mm; share by body and angle; nothing beyond the response table."""
    scene = scene.with_values(infrared__object_share=0.6, infrared__wall_share=0.9)
    seen = surfaces(scene, Poses([(8.7, 150.0, UP)], [(17.5, 150.0)]), 0)
    assert seen[2] == pytest.approx((10 * (8.8 - 3.7 - 5.0), 0.6))  # sensor 2 looks right, where the object is
    assert seen[5] == pytest.approx((10 * (8.7 - 3.7), 0.9))  # sensor 5 looks left, to the wall
    assert seen[0] == seen[7] == (math.inf, 0.0)


def test_an_askew_wall_reflects_by_the_cosine(scene: Scene) -> None:
    """Sensor 2 looks 90 degrees to the right; turned by 30 degrees it sees 2/sqrt(3) as far and cos 30 as much."""
    (straight, askew) = (surfaces(scene, Poses([(8.7, 150.0, a)], []), 0)[2] for a in (-UP, -UP + math.pi / 6))
    assert straight == pytest.approx((50.0, 1.0))
    assert askew.millimetres == pytest.approx(10 * (8.7 / math.cos(math.pi / 6) - 3.7))
    assert askew.share == pytest.approx(math.cos(math.pi / 6))


def test_a_lamp_lights_the_sensors_that_face_it_by_the_inverse_square(scene: Scene) -> None:
    """Raw counts fall with light, never under 0 (epuck.md §5)."""
    pose = (100.0, 150.0, 0.0)
    assert ambient(scene, pose) == [3800] * 8
    lit = ambient(scene.with_values(light__lamp_x_cm=200.0, light__lamp_y_cm=150.0, light__lamp_counts=800.0), pose)
    assert lit[0] == lit[7] == round(3800 - 800 * math.cos(math.radians(18)))
    assert lit[3] == lit[4] == 3800  # on the far side
    near = ambient(scene.with_values(light__lamp_x_cm=105.0, light__lamp_y_cm=150.0, light__lamp_counts=800.0), pose)
    assert near[0] == 0


def test_robots_that_face_each_other_see_each_others_emitters(scene: Scene) -> None:
    """Weakest at the range's end, by the inverse square nearer, nothing behind it or behind a body."""
    for gap, counts in ((SIGNAL_RANGE - 1e-6, SIGNAL_COUNTS), (12.5, 4 * SIGNAL_COUNTS), (25.5, None)):
        poses = Poses([(100.0, 150.0, UP), (107.4 + gap, 150.0, UP)], [])
        heard = {(sensor, line): power for sensor, all_ in enumerate(signals(scene, poses, 0))
                 for other, line, power in all_ if other == 1}  # fmt: skip
        if counts is None:
            assert heard == {}
        else:
            assert heard[2, 1] == pytest.approx(counts)  # my right sensor, its left emitter: sensor 5 on line 1
    hidden = Poses([(100.0, 150.0, UP), (125.0, 150.0, UP)], [(113.0, 150.0)])
    assert not any(signals(scene, hidden, 0))


def test_light_arrives_a_quantum_late_whoever_lived_first() -> None:
    """trial.py: no robot depends on the order of the others."""
    ether = Ether(2, 1000)
    ether.switch(1, 5000, 2, lit=True)
    ether.switch(1, 6500, 2, lit=False)
    assert [ether.seen(1, cycle) for cycle in (6063, 6064, 7563, 7564)] == [0, 4, 4, 0]
    for cycle in range(10_000, 900_000, 1000):
        ether.switch(1, cycle, 0, lit=bool(cycle // 1000 % 2))
    assert ether.seen(1, 900_500) == 1
    assert len(ether._cycles[1]) <= 257


def test_firmware_reads_reflections_and_another_robots_light(scene: Scene, tmp_path: Path) -> None:
    """Sensor 2 converts with its emitter off and on, beside an object, then beside a robot that blinks."""
    listener, sender = built(tmp_path, LISTENER, "listener"), built(tmp_path, SENDER, "sender")
    ether = Ether(2, scene.clock.quantum_tcy)
    ears = EmulatedBrain(scene, 1, 0, listener, 0, ether)
    mouth = EmulatedBrain(scene, 1, 1, sender, 0, ether)
    beside_object = Poses([(100.0, 150.0, UP), (300.0, 150.0, 0.0)], [(100 + 3.7 + 2.0 + 5.0, 150.0)])
    for tick in range(200):
        assert ears.think(tick, beside_object) == (0.0, 0.0)
    assert ears.machine.peek("count") > 40
    difference = ears.machine.peek("dark") - ears.machine.peek("lit")
    assert difference == pytest.approx(reflection_at(20.0) * scene.infrared.object_share, abs=2)
    assert ears.reading().infrared is not None
    assert mouth.reading().infrared is None

    beside_robot = Poses([(100.0, 150.0, UP), (100 + 7.4 + 12.5, 150.0, -UP)], [(300.0, 20.0)])
    dark = set()
    for tick in range(200, 300):
        ears.think(tick, beside_robot)
        mouth.think(tick, beside_robot)
        dark.add(ears.machine.peek("dark"))
    assert max(dark) == scene.light.ambient_counts
    assert min(dark) == pytest.approx(scene.light.ambient_counts - 4 * SIGNAL_COUNTS, abs=2)


def test_the_battery_runs_down_in_a_line_and_its_pin_falls(scene: Scene) -> None:
    """epuck.md §1, §2: full to low in about 3 h; BATT_LOW is 0 below 3.4 V."""
    assert volts_after(scene.battery, 0) == 4.0
    assert volts_after(scene.battery, 3600) == pytest.approx(4.0 - 0.8 / 3)
    assert volts_after(scene.battery, 1e6) == 3.0


def test_a_low_battery_shows_on_the_pin(scene: Scene, tmp_path: Path) -> None:
    """Half a second empties a battery that lasts a second from 3.5 V."""
    low = scene.with_values(battery__volts=3.45, battery__hours=0.01)
    brain = EmulatedBrain(low, 1, 0, built(tmp_path, SENDER, "sender"))
    pins = []
    poses = Poses([(100.0, 150.0, 0.0), (200.0, 150.0, 0.0)], [(300.0, 20.0)])
    for tick in range(4000):
        brain.think(tick, poses)
        if tick % 500 == 499:
            brain.reading()
            pins.append(brain.machine.peek("PORTF") >> 1 & 1)
    assert brain.machine.cycle > 3 * FCY
    assert pins[0] == 1
    assert pins[-1] == 0
