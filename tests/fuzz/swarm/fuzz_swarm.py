"""Run swarms of random robots in every mode of execution and compare the results.

Usage: `python tests/fuzz/swarm/fuzz_swarm.py [--trials N] [--seconds S]`. A trial is a scene of two or three robots
with one or two random programs (`tests/arena/random_robots.py`), while the campaign sends messages to the robots and
moves them. Modes: single quanta with infrared edges in Python, lock-step in Python, compiled code with one thread and
with several. Records, poses, registers and RAM must be equal to the bit. The summary counts events of the trials; a
long campaign fails if a kind of event never occurred.
"""

from __future__ import annotations

import hashlib
import random
import subprocess
import sys
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any, Final

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from arena.infrared.channel import OpticalChannel  # noqa: E402
from arena.lockstep.scheduler import LockStep  # noqa: E402
from arena.robots.firmware_controller import FirmwareController  # noqa: E402
from arena.scene.loader import Scene, load_scene  # noqa: E402
from arena.world.physics import World  # noqa: E402
from emu.dspic30f.jit.engine import JitEngine  # noqa: E402
from tests.arena.random_robots import program  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402

STEPWISE: Final = "quantum after quantum"
QUANTA: Final = 150
"""Minimum number of quanta of a trial; most sensors make two pictures in this time."""
EXPECTED: Final = (
    "lines painted by compiled code", "lines painted by Python", "resets", "faults", "robots asleep", "robots away",
    "wheels turning", "turns of other threads", "lines heard", "changes of LEDs", "robots that measure light",
)  # fmt: skip
MANY: Final = 25
"""Number of trials after which every kind of event must have occurred."""


def assembled(folder: Path, name: str, text: str) -> Path:
    """Assemble a program and return its image."""
    source, image = folder / f"{name}.s", folder / f"{name}.elf"
    source.write_text(text)
    subprocess.run([sys.executable, "-m", "toolchain", "cc", str(source), "-o", str(image)], check=True, cwd=ROOT)
    return image


def scene_of(draw: random.Random) -> Scene:
    """Return a scene with a small arena and two or three robots, which are powered on within 14 ms."""
    count = draw.randrange(2, 4)
    values: dict[str, Any] = {
        "start__spread_tcy": 200_000, "robots__count": count, "objects__count": draw.choice((0, 5, 20)),
        "camera__sensor": draw.choice(("PO3030K", "PO6030K", "PO8030D")), "camera__sees_leds": draw.random() < 0.1,
    }  # fmt: skip
    if draw.random() < 0.3:
        values["start__off"] = ((draw.randrange(count), round(draw.uniform(0.01, 0.14), 3)),)
    if draw.random() < 0.3:
        values["start__remote"] = str(draw.randrange(10))
    if draw.random() < 0.2:
        values["light__brightness"] = draw.choice((0.3, 1.7))
    if draw.random() < 0.3:
        values["robots__wheel_noise"] = 0.2
    return load_scene("clustering").with_values(**values)


class Robot(FirmwareController):
    """Firmware controller that counts the camera lines that Python renders."""

    painted = 0

    def _pixels(self, *line: Any) -> Any:
        self.painted += 1
        return super()._pixels(*line)


class Trial:
    """Random trial, determined by `seed`, so that every run is the same."""

    def __init__(self, seed: int, folder: Path) -> None:
        draw = random.Random(seed)
        self.seed: Final = seed
        self.scene: Final = scene_of(draw)
        sensor, count = self.scene.camera.sensor, self.scene.robots.count
        images = [assembled(folder, f"{seed}_{n}", program(draw, sensor)) for n in range(draw.randrange(1, 3))]
        self._images: Final = [draw.choice(images) for _ in range(count)]
        self._selectors: Final = [draw.randrange(16) for _ in range(count)]
        self._waits: Final = draw.random() < 0.5
        """Whether every robot waits until its code is translated; otherwise native code starts at a random time."""
        self.threads: Final = draw.choice((2, 5))
        moment, moments = 0, []
        while moment < QUANTA:
            moment += draw.choice((1, 2, 13, 40))
            moments.append((moment, draw.randrange(6), draw.randrange(count), draw.random()))
        self._moments: Final = moments
        self.quanta: Final = moment

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes of execution to compare; the first one is the reference."""
        return STEPWISE, "Python", "1 thread", f"{self.threads} threads"

    def run(self, mode: str, tally: Counter[str]) -> list[list[Any]]:
        """Run the trial in one mode and return the states at the chosen times."""
        scene, channel, world = self.scene, OpticalChannel.of(self.scene), World(self.scene, self.seed)
        several = enumerate(zip(self._images, self._selectors, strict=True))
        robots = [Robot(scene, self.seed, number, image, selector, channel) for number, (image, selector) in several]
        for robot in robots:
            if mode == STEPWISE:
                robot.machine.board.ir.emit_in_python()
            assert isinstance(robot.machine.runner, JitEngine)
            robot.machine.runner.wait = self._waits
        lockstep = None
        if mode != STEPWISE:
            threads = int(mode.split()[0]) if "thread" in mode else 1
            lockstep = LockStep(world, robots, channel, is_native=mode != "Python", threads=threads)
        wheels: list[tuple[float, float]] = []
        seen = []
        for until, what, who, where in self._moments:
            if lockstep is not None:
                wheels = lockstep.advance(until)
            while world.ticks < until:
                wheels = [robot.control_step(world.ticks, world.poses) for robot in robots]
                world.step(wheels)
            tally["wheels turning"] += sum(map(any, wheels))
            seen.append([until, wheels, *map(partial(state_of, until, tally), robots), world.poses.values.tolist()])
            if what == 0:
                robots[who].feed_uart(b"hello\n")
            elif what == 1:
                width, height = scene.arena.width_cm, scene.arena.height_cm
                world.move(world.robots[who], 10 + where * (width - 20), height / 2, 6 * where)
            if lockstep is not None:
                lockstep.refresh_poses()
        tally["interpreted"] += sum(robot.machine.runner.counts.interpreted for robot in robots)
        tally["Tcy"] += sum(robot.machine.cycle for robot in robots)
        tally["resets"] += sum(cycle > 0 for robot in robots for cycle, _ in robot.machine.resets)
        tally["faults"] += sum(robot.has_stopped for robot in robots)
        tally["robots away"] += sum(scene.off_tick(number) < self.quanta for number in range(len(robots)))
        tally[f"painted, {mode}"] += sum(robot.painted for robot in robots)
        if lockstep is not None:
            tally["turns of other threads"] += lockstep.scheduler.worker_runs
        return seen


def state_of(until: int, tally: Counter[str], robot: FirmwareController) -> list[Any]:
    """Return the state of a robot between two quanta; inspecting it must not change the run."""
    machine = robot.machine
    machine.peripherals.adc.catch_up(machine.cycle)
    tally["robots asleep"] += machine.is_asleep
    seen = [machine.cycle, machine.pc, hashlib.sha256(machine.record.bytes[:0x2800]).hexdigest()]
    if until % 2:
        reading, lines, lights = robot.reading(), robot.take_lines(), robot.take_led_changes()
        tally["lines heard"] += len(lines)
        tally["changes of LEDs"] += len(lights)
        tally["robots that measure light"] += reading.infrared is not None
        seen += [reading, lines, lights]
    return seen


def check(trial: Trial, tally: Counter[str]) -> str | None:
    """Run a trial in all modes. Return the first difference, or None."""
    expected: list[list[Any]] = []
    painted = Counter[str]()
    for mode in trial.modes:
        own = Counter[str]()
        found = trial.run(mode, own)
        painted[mode] = own.pop(f"painted, {mode}")
        tally.update(own)
        expected = expected or found
        for one, other in zip(expected, found, strict=True):
            if one != other:
                parts = [place for place, (a, b) in enumerate(zip(one, other, strict=True)) if a != b]
                return f"{mode}: by quantum {one[0]} parts {parts} differ: {one[parts[0]]} | {other[parts[0]]}"
    if painted["Python"] != painted[STEPWISE]:
        return f"{painted[STEPWISE]} lines painted quantum after quantum, in lock-step {painted['Python']}"
    for mode in trial.modes:
        tally["lines painted by Python"] += painted[mode]
        tally["lines painted by compiled code"] += painted[STEPWISE] - painted[mode]
    return None


def main() -> int:
    campaign = Campaign(parser(__doc__), "trials", 30, "trials")
    campaign.parse()
    tally = Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        for seed in campaign:
            if found := check(Trial(seed, Path(folder)), tally):
                return campaign.failed(found)
    missing = [what for what in EXPECTED if not tally[what]]
    if missing and campaign.done >= MANY:
        return campaign.failed(f"{campaign.done} trials without {', '.join(missing)}")
    counts = ", ".join(f"{tally[what]} {what}" for what in EXPECTED)
    share = 1e6 * tally["interpreted"] / tally["Tcy"]
    return campaign.ended(f"no difference; {counts}; {share:.0f} instructions in a million Tcy were Python's")


if __name__ == "__main__":
    sys.exit(main())
