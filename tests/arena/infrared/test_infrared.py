"""Infrared sensors in the world: light of the room, of lamps and of other robots, noise; the battery (epuck.md §5)."""

from __future__ import annotations

import math
import random
import statistics
import subprocess
import sys
from collections.abc import Callable
from ctypes import addressof
from functools import partial
from pathlib import Path

import pytest

from arena.infrared.channel import OpticalChannel, light_code
from arena.infrared.propagation import Optics, amplitude, brightest
from arena.infrared.ring import InfraredRing, ambient
from arena.robots.firmware_controller import FirmwareController, volts_after
from arena.scene.loader import FCY, Scene, SceneError, load_scene
from arena.world.poses import Poses
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
        ring.begin_quantum(poses, poses)
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
    """A robot whose battery becomes empty stops and turns its LEDs off. The record contains no fault of the robot."""
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
        ring.begin_quantum(poses, poses)
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
        prepare = ears._board.ir._prepare

        def counted(cycle: int, prepare: Callable[[int], None] = prepare, count: list[int] = count) -> None:
            count[0] += 1
            prepare(cycle)

        ears._board.ir._prepare = counted
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
