"""Demand lock-step: the record equals that of a run that synchronises all robots after every quantum."""

from __future__ import annotations

import gc
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from threading import enumerate as enumerate_threads
from typing import Any

import pytest

import arena
from arena.infrared.channel import OpticalChannel
from arena.lockstep.scheduler import LockStep
from arena.robots.controller import Controller, LedChange, Reading, SerialLine
from arena.robots.firmware_controller import FirmwareController
from arena.scene.loader import Scene, load_scene
from arena.trial.trial import run_trial
from arena.world.physics import World
from arena.world.poses import Poses
from emu.boards.epuck.camera.scan import LINE_PIXELS
from emu.dspic30f.jit.engine import JitEngine
from tests.arena.robot_programs import BEGIN
from tests.watchdog import HANG


class Stepwise:
    """Controller that is no `RunAheadRobot`, so it takes the poses of every quantum."""

    def __init__(self, controller: FirmwareController) -> None:
        self._controller = controller

    def control_step(self, tick: int, poses: Poses) -> tuple[float, float]:
        return self._controller.control_step(tick, poses)

    def reading(self) -> Reading:
        return self._controller.reading()

    def take_lines(self) -> list[SerialLine]:
        return self._controller.take_lines()

    def take_led_changes(self) -> list[LedChange]:
        return self._controller.take_led_changes()

    def take_messages(self) -> list[SerialLine]:
        return self._controller.take_messages()

    def feed_uart(self, data: bytes) -> None:
        self._controller.feed_uart(data)

    def close(self) -> None:
        self._controller.close()


def trial(scene: Scene, seed: int, image: Path, selector: int, seconds: float, ahead: bool) -> dict[str, list[Any]]:
    channel = OpticalChannel(scene.robots.count, scene.clock.quantum_tcy)
    robots = [FirmwareController(scene, seed, i, image, selector, channel) for i in range(scene.robots.count)]
    controllers: list[Controller] = list(robots) if ahead else [Stepwise(robot) for robot in robots]
    result = run_trial(scene, seed, controllers, seconds, channel=channel)
    return result.rows.columns | {"faults": result.faults}


@pytest.mark.slow
@pytest.mark.parametrize(("image", "seed", "selector"), [
    ("clustering_image", 3, 0), ("clustering_image", 4, 1), ("talking_image", 5, 0),
])  # fmt: skip
def test_records_equal_those_of_single_quanta(
    image: str, seed: int, selector: int, request: pytest.FixtureRequest
) -> None:
    """Records equal those of single quanta for three robots that see each other, and for robots that send lines."""
    scene = load_scene("clustering").with_values(robots__count=3, objects__count=8)
    path = request.getfixturevalue(image)
    ahead, stepwise = (trial(scene, seed, path, selector, 2.0, how) for how in (True, False))
    assert ahead == stepwise
    assert image != "clustering_image" or any(ahead["r0_left"])


def test_robots_run_ahead(clustering_image: Path) -> None:
    """A robot is more than 20 quanta ahead of the world when it first reads its camera; otherwise the test above
    would compare nothing."""
    scene = load_scene("clustering").with_values(robots__count=2)
    robots = [FirmwareController(scene, 1, i, clustering_image, 8) for i in range(2)]
    world = World(scene, 1)
    gaps: list[int] = []
    lockstep = LockStep(world, robots)

    def poses_at(tick: int) -> tuple[Poses, Poses]:
        gaps.append(tick - world.ticks)
        return lockstep.poses_at(tick)

    for robot in robots:
        robot.use_poses(poses_at)
    lockstep.advance(400)
    assert world.ticks == 400
    assert max(gaps) > 20


def samples(
    image: Path, is_native: bool, seconds: float = 3.0, count: int = 3, threads: int = 1
) -> tuple[list[Any], int, int]:
    """Return readings and poses twice a second; for the last second also the numbers of lines rendered and of
    instructions interpreted by Python."""
    scene = load_scene("clustering").with_values(robots__count=count, objects__count=8)
    robots = [FirmwareController(scene, 5, i, image, 0) for i in range(count)]
    painted = interpreted = 0
    found: list[Any] = []
    for robot in robots:
        assert isinstance(robot.machine.runner, JitEngine)
        robot.machine.runner.wait = True
        camera, paint = robot.machine.board.camera, robot._pixels

        def counted(*line: Any, paint: Any = paint) -> Any:
            nonlocal painted
            painted += 1
            return paint(*line)

        camera.show_pixels(counted, has_native_source=True)
    world = World(scene, 5)
    lockstep = LockStep(world, robots, is_native=is_native, threads=threads)
    for moment in range(500, round(seconds * 1000) + 1, 500):
        if moment == round(seconds * 1000) - 500:
            painted, interpreted = 0, sum(robot.machine.runner.counts.interpreted for robot in robots)
        wheels = lockstep.advance(moment)
        readings = [(robot.reading(), robot.take_lines(), robot.take_led_changes()) for robot in robots]
        found.append((wheels, readings, world.poses.values.tolist()))
    assert (lockstep.scheduler.worker_runs > 0) == (threads > 1)
    return found, painted, sum(robot.machine.runner.counts.interpreted for robot in robots) - interpreted


def test_native_code_renders_and_probes_as_python_does(clustering_image: Path) -> None:
    """Camera lines, ends of quanta and CPU probes are equal with and without native code, and Python runs only if a
    device needs it."""
    native, painted, interpreted = samples(clustering_image, True)
    plain, seen, _ = samples(clustering_image, False)
    assert native == plain
    assert any(reading.load for reading, _, _ in native[-1][1])
    assert any(reading.strip for reading, _, _ in native[-1][1])
    assert seen > 200
    assert painted == 0
    assert interpreted < 40


@pytest.mark.slow
def test_the_threads_that_run_robots_do_not_show(clustering_image: Path) -> None:
    """The number of threads, also if larger than the number of cores, does not affect the results."""
    alone, *_ = samples(clustering_image, True, 2.0, 7)
    for threads in (2, 5):
        found, painted, _ = samples(clustering_image, True, 2.0, 7, threads)
        assert found == alone
        assert painted == 0


def test_threads_end_with_their_scheduler(clustering_image: Path) -> None:
    before = set(enumerate_threads())
    scene = load_scene("clustering").with_values(robots__count=3)
    robots = [FirmwareController(scene, 1, i, clustering_image, 8) for i in range(3)]
    lockstep = LockStep(World(scene, 1), robots, threads=3)
    lockstep.advance(50)
    workers = set(enumerate_threads()) - before
    assert len(workers) == 2
    for robot in robots:
        robot.close()
    del lockstep, robots, robot
    gc.collect()
    for worker in workers:
        worker.join(HANG)
        assert not worker.is_alive()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no sanitizers here (Debian package gcc)")
@pytest.mark.parametrize("sanitizer", ["thread", "address,undefined"])
def test_rounds_have_no_race(sanitizer: str, tmp_path: Path) -> None:
    """The thread sanitizer finds no race in rounds with workers that start late, block, or are stopped."""
    source, program = Path(arena.__path__[0]) / "lockstep" / "lockstep.c", tmp_path / "race"
    command = ["gcc", "-g", "-O1", "-std=c11", "-Wall", "-Wextra", "-Werror", f"-fsanitize={sanitizer}", "-include"]
    command += [str(source), str(Path(__file__).with_name("race.c")), "-o", str(program), "-lpthread"]
    subprocess.run(command, check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


LOOKING = f"""{BEGIN}
1:      mov     PORTD, w0
        bra     1b
"""


def write(robot: FirmwareController, register: int, value: int) -> None:
    """Write a camera register as the I2C bus does."""
    machine = robot.machine
    machine.board.camera.start(False, machine.cycle)
    machine.board.camera.write(register, machine.cycle)
    machine.board.camera.write(value, machine.cycle)


def test_the_noise_is_long_enough_for_the_widest_line(assembled: Callable[[str], Path]) -> None:
    """A line of the widest window, 1024 columns, can begin at any noise value without exceeding the array of noise."""
    scene = load_scene("clustering").with_values(robots__count=1, camera__sensor="PO3030K")
    robot = FirmwareController(scene, 5, 0, assembled(LOOKING), 0)
    LockStep(World(scene, 5), [robot]).advance(200)
    for register, value in ((0x04, 8), (0x08, 0), (0x09, 0), (0x0C, 7), (0x0D, 255)):
        write(robot, register, value)
    width = robot.machine.board.camera.frame().shape[1]
    assert width == LINE_PIXELS
    assert len(robot._noise) >= 2**14 - 1 + 3 * width


@pytest.mark.parametrize("off_s", [0.0, 0.1, 60.0], ids=["never on", "no more", "on"])
def test_the_camera_of_a_robot_without_power_shows_the_current_world(
    off_s: float, assembled: Callable[[str], Path]
) -> None:
    """The camera of a robot without power shows the current world to an observer, although the robot's own time does
    not advance."""
    scene = load_scene("clustering").with_values(
        robots__count=1, objects__count=1, robots__wheel_noise=0.0, start__off=[[0, off_s]]
    )
    world = World.of(scene, 1, [(200, 150, 0.0)], [(20, 20)])
    robot = FirmwareController(scene, 1, 0, assembled(LOOKING), 0)
    lockstep = LockStep(world, [robot])
    reds = []
    for ticks, place in ((2000, (240, 150)), (2200, (20, 20)), (2400, (240, 150))):
        lockstep.advance(ticks)
        world.move(world.objects[0], *place)
        lockstep.refresh_poses()
        lockstep.advance(ticks + 2)
        frame = robot.machine.board.camera.frame().astype(int)
        reds.append((frame[:, :, 0] - frame[:, :, 1] > 40).mean())
    assert reds[1] < 0.001 < 0.02 < min(reds[0], reds[2])


def test_the_strip_is_the_last_line_before_the_window_changes(assembled: Callable[[str], Path]) -> None:
    """The recorded rows are read in two frames, some of them again in the third; none of them is in the new window."""
    image = assembled(LOOKING)
    scene = load_scene("clustering").with_values(robots__count=1, camera__sensor="PO3030K")
    strips = []
    for is_native in (True, False):
        robot = FirmwareController(scene, 5, 0, image, 0)
        assert isinstance(robot.machine.runner, JitEngine)
        robot.machine.runner.wait = True
        lockstep, camera = LockStep(World(scene, 5), [robot], is_native=is_native), robot.machine.board.camera
        lockstep.advance(200)
        write(robot, 0x1D, 0)  # fastest pixel clock: a row lasts 1704 Tcy, a quantum 14,746
        lockstep.advance(500)
        camera.align(robot.machine.cycle + 1000, line=226)
        lockstep.advance(501)
        strips.append(robot.reading().strip)
        lockstep.advance(700)
        camera.align(robot.machine.cycle + 1000, line=230)
        lockstep.advance(701)
        write(robot, 0x0F, 100)  # last row of the window, with 1 as upper byte
        write(robot, 0x0E, 0)
        lockstep.advance(900)
        strips.append(robot.reading().strip)
    assert strips[:2] == strips[2:]
    assert all(strips)
    assert strips[0] != strips[1]
