"""Measure host time per simulated second in the arena by component, and the cost of a trial.

Input: none; the script builds the clustering firmware. Output: CPU seconds of this process. For one trial with two
threads also wall seconds and the memory of all processes (PSS: shared pages are divided among their users; Linux only).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from arena.campaign.campaign import Plan, controllers_of
from arena.lockstep.scheduler import LockStep
from arena.robots.controller import Controller, ScriptedController
from arena.robots.firmware_controller import FirmwareController
from arena.robots.images import image_for
from arena.scene.loader import Scene, load_scene, scripted
from arena.trial.trial import run_trial
from arena.world.physics import World

TRIAL_S = 900
SWARMS = 100, 1000, 10_000
"""Sizes of the scripted swarms."""


class Clock:
    """Accumulated time of selected functions."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments)
            finally:
                self.seconds += time.perf_counter() - start

        return timed


def measure_components(
    scene: Scene, make: Callable[[], list[Controller]], seconds: float, warm_up: float
) -> dict[str, float]:
    """Return CPU seconds per simulated second, and the shares of physics and rendering. A second run measures the
    shares: there Python calls both, which makes them slightly too large."""
    cpu, _, _ = measure(scene, make(), seconds, warm_up, True)
    apart, physics, rendering = measure(scene, make(), seconds, warm_up, False)
    return {
        "cpu_s": cpu,
        "physics": physics / cpu,
        "rendering": rendering / cpu,
        "by_python_cpu_s": apart,
        "trial_cpu_s": TRIAL_S * cpu,
        "real_time": 1 / cpu,
    }


def measure(
    scene: Scene, controllers: list[Controller], seconds: float, warm_up: float, is_native: bool
) -> tuple[float, float, float]:
    """Return CPU seconds per simulated second: total, physics, rendering. If `is_native`, physics and rendering are
    0, because compiled code calls both."""
    world = World(scene, 1)
    physics, rendering = Clock(), Clock()
    robots = [controller for controller in controllers if isinstance(controller, FirmwareController)]
    if not is_native:
        for robot in robots:
            renderer = robot._renderer  # not `_pixels`: other robots run during its calls
            renderer.render_line = rendering.around(renderer.render_line)  # type: ignore[method-assign]
        world.step = physics.around(world.step)  # type: ignore[method-assign]
        world.run_quanta = physics.around(world.run_quanta)  # type: ignore[method-assign]
    lockstep = LockStep(world, robots, is_native=is_native) if robots else None
    sample = round(scene.clock.sample_s / world.dt)
    for tick in range(0, round((warm_up + seconds) / world.dt), sample):
        if tick <= round(warm_up / world.dt) < tick + sample:
            physics.seconds = rendering.seconds = 0.0
            start = time.process_time(), time.perf_counter()
        if lockstep is not None:
            lockstep.advance(tick + sample)
        else:
            for one in range(tick, tick + sample):
                world.step([controller.control_step(one, world.poses) for controller in controllers])
        for controller in controllers:
            controller.reading(), controller.take_lines(), controller.take_led_changes()
    cpu, wall = time.process_time() - start[0], time.perf_counter() - start[1]
    share = cpu / wall / seconds  # scales wall-clock times to CPU time, because other processes share the CPU
    return cpu / seconds, physics.seconds * share, rendering.seconds * share


def measure_swarm(count: int, seconds: float) -> float:
    """Return CPU seconds per simulated second of a scripted swarm without objects, on marks every 25 cm."""
    marks = math.ceil(math.sqrt(count))
    side = 25.0 * (marks + 1)
    scene = scripted(load_scene("clustering").with_values(
        robots__count=count, objects__count=0, arena__width_cm=side, arena__height_cm=side, marks__columns=marks,
        marks__rows=marks, marks__spacing_cm=25.0,
    ))  # fmt: skip
    controllers = [ScriptedController(scene, 1, robot, "aggregate") for robot in range(count)]
    return measure(scene, list(controllers), seconds, 0.5, True)[0]


def with_two_threads(scene: Scene, image: Path, seconds: float, warm_up: float) -> dict[str, float]:
    """Return wall seconds per simulated second of a trial with two threads, and its memory in MB."""
    plan = Plan(scene, "openswarm", "A", image, 1, warm_up + seconds, 1)
    times: list[float] = []
    with controllers_of(plan, 1) as (controllers, channel):
        run_trial(
            scene, 1, controllers, plan.seconds, lambda _: times.append(time.perf_counter()), channel=channel, threads=2
        )
        megabytes = sum(map(proportional_share, family(os.getpid()))) / 1024
    wall = (times[-1] - times[round(warm_up)]) / (len(times) - 1 - round(warm_up))
    return {"wall_s": wall, "trial_wall_s": TRIAL_S * wall, "memory_mb": megabytes}


def family(process: int) -> list[int]:
    """Return a process and its descendants."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue  # the process has ended
        children.setdefault(parent, []).append(int(stat.parent.name))
    found = [process]
    for one in found:
        found += children.get(one, [])
    return found


def proportional_share(process: int) -> int:
    """Return the memory of a process in kB, with shared pages counted proportionally (PSS)."""
    try:
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, epilog="example: python -m bench.swarm.arena --seconds 20")
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated time of each measurement (default 5)")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    scene = load_scene("clustering")
    robots = range(scene.robots.count)
    quick = scripted(scene)
    image = image_for("openswarm")
    assert image is not None
    # First, because objects of the other measurements would count as memory of this trial.
    together = with_two_threads(scene, image, options.seconds, 3.0)
    results = {
        "scripted": measure_components(
            quick, lambda: [ScriptedController(quick, 1, i, "A") for i in robots], 20 * options.seconds, 5.0
        ),
        "openswarm": measure_components(
            scene, lambda: [FirmwareController(scene, 1, i, image, 8) for i in robots], options.seconds, 3.0
        ),
    }
    swarms = {count: measure_swarm(count, options.seconds) for count in SWARMS}
    if options.json:
        print(json.dumps(results | {"openswarm, two threads": together, "swarms": swarms}))
        return 0
    for name, one in results.items():
        print(f"{name:10} {one['cpu_s'] * 1000:7.1f} ms CPU per simulated second ({one['real_time']:.1f} x real time): "
              f"physics {one['physics']:.0%}, rendering {one['rendering']:.0%}; "
              f"{one['by_python_cpu_s'] * 1000:.1f} ms if Python sees each look; "
              f"{len(robots)} robots, 15 min: {one['trial_cpu_s']:.0f} s of one core")  # fmt: skip
    for count, cpu in swarms.items():
        print(f"{count} scripted robots: {cpu:.3f} s CPU per simulated second")
    print(f"one trial by two threads: {together['wall_s'] * 1000:.1f} ms per simulated second, 15 min: "
          f"{together['trial_wall_s']:.0f} s; {together['memory_mb']:.0f} MB in all")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
