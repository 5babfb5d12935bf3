"""Motor steps compared with speeds: v mm/s are v * 1000 / 129 steps/s; speeds beyond +-129 mm/s are clamped."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

FCY = 14_745_600
FASTEST = 129


def start(path: Path) -> Machine:
    """Return a machine that runs the wheels firmware."""
    image = load_image(path)
    machine = Machine(image.chip, engine="auto", board=partial(Epuck))
    machine.load(image)
    machine.run(cycles=FCY // 50)
    return machine


def exact_steps(speed: int, seconds: float) -> float:
    """Return the exact number of steps at a speed in mm/s during some seconds; speeds beyond the limit are clamped."""
    return max(-FASTEST, min(FASTEST, speed)) * 1000 / 129 * seconds


def partner(speed: int) -> int:
    """Return an unrelated speed for the other wheel: a bijection on -129..129."""
    return (speed * 100 + 31 + FASTEST) % (2 * FASTEST + 1) - FASTEST


def measure(machine: Machine, left: int, right: int, seconds: float) -> tuple[float, float]:
    """Return (counted steps - exact steps) of a number of simulated seconds, left and right.

    Lost or illegal steps raise AssertionError.
    """
    machine.poke("wanted_left", left & 0xFFFF)
    machine.poke("wanted_right", right & 0xFFFF)
    machine.run(cycles=FCY // 50)  # the firmware reads the speeds every 10 ms
    motors = machine.board.motors
    before, start_cycle = (motors.left.steps, motors.right.steps), machine.cycle
    machine.run(cycles=round(seconds * FCY))
    after, time = (motors.left.steps, motors.right.steps), (machine.cycle - start_cycle) / FCY
    assert (motors.left.lost, motors.right.lost, motors.left.illegal, motors.right.illegal) == (0, 0, 0, 0)
    return (
        after[0] - before[0] - exact_steps(left, time),
        after[1] - before[1] - exact_steps(right, time),
    )
