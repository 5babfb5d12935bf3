"""Firmware controllers in the world (docs/experiment.md)."""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import emu
from arena.camera.appearance import COLOURS
from arena.camera.line_of_sight import WINDOW_ROWS
from arena.cli import main
from arena.commands.reaction import OK_AT_TCY, SPEED_WORDS, AlternatingPicture, reaction
from arena.robots.controller import FIRST_FRAME_TCY, LATENCY_TCY, OK_DECODED_TCY, ScriptedController, power_on_cycle
from arena.robots.epuck import SELECTOR
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import FCY, Scene, load_scene
from arena.trial.record import read_trial
from arena.trial.trial import run_trial
from arena.world.physics import World
from emu.boards.epuck.board import Epuck
from tests.arena.reference_camera import ReferenceCamera
from tests.json_schemas import path_of, problems

AT_ONCE = 8
"""Selector bit with which the project's firmware starts without the remote control."""


@pytest.fixture
def alone() -> Scene:
    """Return a scene with one robot, no wheel noise and no objects."""
    return load_scene("clustering").with_values(robots__count=1, objects__count=0, robots__wheel_noise=0.0)


@pytest.mark.parametrize(("controller", "wanted"), [("A", (64, 129, 129, 64)), ("B", (70, 127, 126, 64))])
def test_wheel_speeds_are_those_of_the_table_for_what_the_camera_shows(
    clustering_image: Path, alone: Scene, controller: str, wanted: tuple[int, ...]
) -> None:
    """The wheel speeds are those of the controller's table, in mm/s, first for an empty view and then for an object
    (epuck.md §8)."""
    scene = alone.with_values(objects__count=1, robots__thrust_n="inf")
    for place, speeds in (((20.0, 20.0), wanted[:2]), ((240.0, 150.0), wanted[2:])):
        firmware = FirmwareController(scene, 1, 0, clustering_image, SELECTOR[controller] | AT_ONCE)
        world = World.of(scene, 1, [(200, 150, 0.0)], [place])
        poses = world.poses  # the poses are constant, so the picture is too
        wheels = [firmware.control_step(tick, poses) for tick in range(400)]
        mean = np.mean(wheels[-200:], axis=0)
        assert mean * 10 / 0.128 * 0.129 == pytest.approx(speeds, rel=0.03)
        strip = np.frombuffer(firmware.reading().strip, np.uint8).reshape(20, 3).astype(int)
        red = strip[:, 0] - strip[:, 1] > 40
        half = math.asin(5 / (240 - 200 - 3.3)) if place == (240.0, 150.0) else 0.0
        assert red.sum() == pytest.approx(2 * 602 * math.tan(half) / 8, abs=1)
        assert red.tolist() == sorted(red.tolist()[:10]) + sorted(red.tolist()[10:], reverse=True)


@pytest.mark.parametrize("vignetting", [0.0, 0.3])
def test_pixels_are_the_colours_of_their_classes_with_noise(
    clustering_image: Path, alone: Scene, vignetting: float
) -> None:
    """docs/experiment-appendix.md §2: pixels are the colours of their classes plus normal noise of sd 3 in each
    channel, in rows of one class and of several."""
    scene = alone.with_values(objects__count=1, camera__vignetting=vignetting)
    firmware = FirmwareController(scene, 1, 0, clustering_image)
    poses = World.of(scene, 1, [(200, 150, 0.0)], [(240.0, 150.0)]).poses
    firmware.control_step(1000, poses)
    columns = np.arange(0, 640, 3)
    left_over = []
    for y in (0, 100, 240, 300, 470):
        classes = [ReferenceCamera(scene, poses, 0).column(int(u), (y,))[0] for u in columns]
        bright = ReferenceCamera(scene, poses, 0).lens.vignetting(y, columns, vignetting)
        left_over.append(firmware._pixels(y, columns, 0) - COLOURS[classes] * bright[:, None])
    assert np.abs(np.mean(left_over, axis=(0, 1))) == pytest.approx(0, abs=0.5)
    assert np.std(left_over, axis=(0, 1)) == pytest.approx(3.0, abs=0.3)


def test_the_scripted_sensor_has_first_frame_and_latency_of_the_firmware(clustering_image: Path, alone: Scene) -> None:
    """docs/experiment-appendix.md §2: the scripted sensor has the times measured on the firmware: the first frame
    within 0.2 ms, the latency, which depends on the kernel, within 0.25 ms."""
    firmware = FirmwareController(alone, 1, 0, clustering_image, SELECTOR["A"] | AT_ONCE)
    world = World(alone, 1)
    rows: dict[int, int] = {}
    camera = firmware.machine.board.camera
    pixels = firmware._pixels

    def watched(y: int, columns: object, cycle: int) -> object:
        rows.setdefault(y, cycle)
        return pixels(y, columns, cycle)  # type: ignore[arg-type]

    camera.show_pixels(watched)
    tick = 0
    while not firmware.machine.peek("stepper_left"):
        firmware.control_step(tick, world.poses)
        tick += 1
        assert tick < 1000
    middle = (WINDOW_ROWS[0] + WINDOW_ROWS[-1]) // 2
    assert rows[middle] == pytest.approx(FIRST_FRAME_TCY, abs=FCY // 5_000)
    seen = firmware.machine.cycle  # before the end of the quantum with the change
    margin = FCY // 4_000
    assert seen - alone.clock.quantum_tcy - margin <= FIRST_FRAME_TCY + LATENCY_TCY <= seen + margin


def test_the_remote_controls_ok_starts_all_robots_together(clustering_image: Path) -> None:
    """experiment-contract.md §4: firmware and scripted robots decode the OK key at the same cycle of the trial and do
    not move before it."""
    scene = load_scene("clustering").with_values(robots__count=2, objects__count=0)
    controllers = [FirmwareController(scene, 1, robot, clustering_image, SELECTOR["A"]) for robot in range(2)]
    started: list[int] = []
    for robot, firmware in enumerate(controllers):
        on_at = power_on_cycle(scene, 1, robot)
        firmware.machine.board.leds.listen(lambda _name, _lit, cycle, on_at=on_at: started.append(on_at + cycle))
    scripts = [ScriptedController(scene, 1, robot, "A") for robot in range(2)]
    poses = World(scene, 1).poses
    for tick in range(1200):
        emulated = [firmware.control_step(tick, poses) for firmware in controllers]
        scripted = [firmware.control_step(tick, poses) for firmware in scripts]
        if (tick + 1) * scene.clock.quantum_tcy < OK_AT_TCY + OK_DECODED_TCY:
            assert emulated == scripted == [(0.0, 0.0)] * 2
    assert started == pytest.approx([OK_AT_TCY + OK_DECODED_TCY] * 2, abs=FCY // 10_000)
    assert min(sum(speeds) for speeds in emulated + scripted) > 10


def test_scripted_and_emulated_robots_start_on_equal_paths(clustering_image: Path) -> None:
    """Robots of one seed are within 5 mm 2 s after OK, and within 30 mm after 5 s."""
    scene = load_scene("clustering")
    paths = []
    for scripted in (False, True):
        controllers = [
            ScriptedController(scene, 1, robot, "A")
            if scripted
            else FirmwareController(scene, 1, robot, clustering_image, 0)
            for robot in range(5)
        ]
        rows = run_trial(scene, 1, controllers, 6).rows.columns
        paths.append(np.array([[rows[f"r{i}_x"], rows[f"r{i}_y"]] for i in range(5)]))
    apart = np.hypot(*(paths[0] - paths[1]).transpose(1, 0, 2)).max(axis=0)
    assert apart[2] == 0.0
    assert apart[6] < 0.5
    assert apart[12] < 3.0
    assert np.abs(paths[0][:, :, -1] - paths[0][:, :, 0]).max() > 5


def test_motor_steps_give_the_distance_travelled(clustering_image: Path, alone: Scene) -> None:
    """epuck.md §3: the distance equals 0.128 mm per motor step, summed over a circle in quanta of 1 ms."""
    firmware = FirmwareController(alone, 1, 0, clustering_image, AT_ONCE)
    world = World.of(alone, 1, [(200, 150, 0.0)], [])
    path = 0.0
    for tick in range(3000):
        before = world.poses.robots[0]
        world.step([firmware.control_step(tick, world.poses)])
        path += math.dist(before[:2], world.poses.robots[0][:2])
    motors = firmware.machine.board.motors
    assert path == pytest.approx((motors.left.steps + motors.right.steps) / 2 * 0.0128, rel=0.01)


def test_a_trial_continues_after_the_firmware_of_a_robot_trapped(
    talking_image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """If a robot's firmware traps, the trial continues and ends with exit status 1. The fault has robot, time and
    reason; lines and LED changes before it are in the record."""
    out = tmp_path / "out"
    status = main(["run", "clustering", "--brain", str(talking_image), "--robots", "2", "--trials", "1", "--minutes",
                   "0.05", "--jobs", "1", "--out", str(out)])  # fmt: skip
    assert status == 1
    assert (out / "firmware.elf").read_bytes() == talking_image.read_bytes()  # the folder keeps the firmware
    trial = read_trial(out / "trial-0001.parquet")
    assert trial.times[-1] == pytest.approx(3.0, abs=0.01)
    assert [fault[0] for fault in trial.about["faults"]] == [0, 1]
    scene = load_scene("clustering")
    for robot, seconds, why in trial.about["faults"]:
        assert 1 + power_on_cycle(scene, 1, robot) / FCY <= seconds <= 2 + power_on_cycle(scene, 1, robot) / FCY
        assert why.startswith("stopped: fault at 0x")
    lines = [(line["robot"], line["text"]) for row in trial.columns["log"] for line in row]
    assert sorted(lines) == [(0, "hi"), (1, "hi")]
    assert trial.columns["r0_leds"][1] == 1
    lit, dark = (change for row in trial.columns["lights"] for change in row if change["robot"] == 0)
    assert (lit["leds"], dark["leds"]) == (1, 0)  # the trap resets the chip
    assert 0 < lit["cycle"] - power_on_cycle(scene, 1, 0) < 10_000
    assert dark["cycle"] - lit["cycle"] == pytest.approx(FCY, abs=1000)
    assert trial.columns["r0_strip"][1] == b""
    assert trial.columns["r0_infrared"][1] is None
    assert trial.columns["r0_load"][1] > 0.9
    error = " ".join(capsys.readouterr().err.split())
    assert "robot 0 stopped" in error
    assert "robot 1 stopped" in error


@pytest.mark.slow
@pytest.mark.parametrize(("image", "seconds"), [("talking_image", 1.2), ("clustering_image", 2.0)])
def test_emulated_trials_are_the_same_for_one_and_two_workers(
    image: str, seconds: float, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Files of a run with one worker and of a second run with two are equal."""
    for name, jobs in (("1", 1), ("2", 2)):
        main(["run", "clustering", "--brain", str(request.getfixturevalue(image)), "--robots", "2", "--trials", "2",
              "--minutes", str(seconds / 60), "--jobs", str(jobs), "--out", str(tmp_path / name)])  # fmt: skip
    files = [{p.name: p.read_bytes() for p in (tmp_path / name).glob("*.parquet")} for name in ("1", "2")]
    assert len(files[0]) == 2
    assert files[0] == files[1]


def test_the_light_of_the_scene_scales_the_picture(talking_image: Path, alone: Scene) -> None:
    """Half the light gives half the values, before the automatic exposure has adapted (epuck.md §7.6)."""
    pictures = []
    for brightness in (1.0, 0.5):
        firmware = FirmwareController(alone.with_values(light__brightness=brightness), 1, 0, talking_image)
        poses = World.of(alone, 1, [(200, 150, 0.0)], []).poses
        firmware._begin_quantum(0, poses, poses)
        pictures.append(firmware.machine.board.camera.frame(cycle=0).astype(int))
    lit, dim = (picture[:, :, 0].mean() for picture in pictures)
    assert dim == pytest.approx(lit / 2, rel=0.1)


@pytest.mark.slow
def test_reaction_finds_the_latency_and_no_missed_frame(clustering_image: Path) -> None:
    """experiment-contract.md §4: `arena reaction` gives the reaction times found by polling the wheels, within the
    polling period of 5 us, and no missed frame."""
    found = reaction(clustering_image, SPEED_WORDS["openswarm"], 0, 10, 1)
    assert problems(path_of("arena", "reaction"), {"openswarm": found}) == []
    assert found["frames_missed"] == 0
    assert found["changes"] in (9, 10)
    assert 50 < found["min_us"] <= found["median_us"] <= found["p99_us"] <= found["max_us"] < 1000

    show = AlternatingPicture(1)
    machine = emu.load(clustering_image, board=partial(Epuck, camera="PO6030K", selector=0, seed=1))
    machine.board.remote.press("ok", cycle=OK_AT_TCY)
    machine.board.camera.show_pixels(show.pixels)
    machine.run_until(2 * OK_AT_TCY)
    waits, before = [], machine.peek("stepper_left")
    while len(waits) < 5:
        machine.run_until(machine.cycle + 10)
        if machine.peek("stepper_left") != before:
            before = machine.peek("stepper_left")
            waits.append((machine.cycle - show.lines[-1]) / FCY * 1e6)
    assert found["min_us"] - 6 <= min(waits) <= max(waits) <= found["max_us"] + 6


def test_reaction_refuses_firmware_without_the_word_or_without_wheels(
    talking_image: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`arena reaction` ends with exit status 2 if the firmware lacks the sensor variable, which the message names, or
    stops."""
    assert main(["reaction", "--brain", str(talking_image)]) == 2
    assert "name the word that holds" in capsys.readouterr().err
    assert main(["reaction", "--brain", str(talking_image), "--word", "nothing"]) == 2
    assert "cannot read the word 'nothing'" in capsys.readouterr().err
    assert main(["reaction", "--brain", str(talking_image), "--word", "PORTD"]) == 2
    assert "the firmware stopped: fault" in capsys.readouterr().err


@pytest.mark.parametrize("end", [1 << 10, 294_912, 3 << 30])
def test_probe_times_equal_the_draws_of_the_generator(clustering_image: Path, alone: Scene, end: int) -> None:
    """Native draws of probe times equal the generator's, also for a bound at which the method rejects a third of the
    draws."""
    firmware = FirmwareController(alone, 1, 0, clustering_image)
    twin = np.random.default_rng()
    twin.bit_generator.state = firmware._rng.bit_generator.state
    assert [firmware._random_below(end) for _ in range(2000)] == [int(twin.integers(end)) for _ in range(2000)]
