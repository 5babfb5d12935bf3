"""Steps against speeds: v mm/s are v * 1000 / 129 steps/s; beyond +-129 they are clamped."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

FCY = 14_745_600
FASTEST = 129


def start(path: Path) -> Machine:
    """The wheels firmware, running."""
    image = load_image(path)
    machine = Machine(image.chip, engine="auto", board=partial(Epuck))
    machine.load(image)
    machine.run(cycles=FCY // 50)
    return machine


def exact_steps(speed: int, seconds: float) -> float:
    """Steps that a speed in mm/s makes."""
    return max(-FASTEST, min(FASTEST, speed)) * 1000 / 129 * seconds


def partner(speed: int) -> int:
    """A speed for the other wheel that is unrelated to this one's, one to one over -129..129."""
    return (speed * 100 + 31 + FASTEST) % (2 * FASTEST + 1) - FASTEST


def measure(machine: Machine, left: int, right: int, seconds: float) -> tuple[float, float]:
    """Steps made in so many simulated seconds less the exact number, left and right. Fails on lost or illegal steps."""
    machine.poke("wanted_left", left & 0xFFFF)
    machine.poke("wanted_right", right & 0xFFFF)
    machine.run(cycles=FCY // 50)  # the firmware looks every 10 ms
    motors = machine.board.motors
    before, start_cycle = (motors.left.steps, motors.right.steps), machine.cycle
    machine.run(cycles=round(seconds * FCY))
    after, time = (motors.left.steps, motors.right.steps), (machine.cycle - start_cycle) / FCY
    assert (motors.left.lost, motors.right.lost, motors.left.illegal, motors.right.illegal) == (0, 0, 0, 0)
    return (
        after[0] - before[0] - exact_steps(left, time),
        after[1] - before[1] - exact_steps(right, time),
    )
