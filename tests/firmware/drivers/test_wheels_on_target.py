"""Wheel speeds under the kernel, counted in steps."""

from __future__ import annotations

import pytest

from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.wheels import FASTEST, FCY, measure, partner, start

PERIOD_TICKS = 6192
TICK_TCY = 1536
SYS_ERROR_ARGUMENT = 5


def test_every_speed_is_exact_over_a_whole_period(image: Build) -> None:
    """openswarm-original.md §5.2: the stepper's fraction comes back to where it was after 6,192
    ticks of 1,536 Tcy, which make 5 v steps; what holds for one period holds for any time. fuzz_wheels.py counts
    60 s of each."""
    machine = start(image("wheels", TARGET_APPS))
    for speed in range(-FASTEST, FASTEST + 1, 7):
        machine.poke("wanted_left", speed & 0xFFFF)
        machine.poke("wanted_right", partner(speed) & 0xFFFF)
        machine.run(cycles=FCY // 50)
        motors = machine.board.motors
        before = motors.left.steps, motors.right.steps, *fractions(machine)
        machine.run_until(machine.cycle + PERIOD_TICKS * TICK_TCY)
        after = motors.left.steps, motors.right.steps, *fractions(machine)
        moved = [now - then for now, then in zip(after, before, strict=True)]
        assert moved == [5 * speed, 5 * partner(speed), 0, 0], speed


def fractions(machine) -> list[int]:
    """Of a step that is due, in 1/6192, left and right (motors.c)."""
    return [machine.peek(machine.address_of(name) + 2) for name in ("stepper_left", "stepper_right")]


@pytest.mark.parametrize(("left", "right"), [(129, -129), (1, -128), (64, 65)])
def test_a_minute_is_exact_to_a_step(image: Build, left: int, right: int) -> None:
    """Step rates are exact at every speed."""
    errors = measure(start(image("wheels", TARGET_APPS)), left, right, 60)
    assert max(abs(error) for error in errors) <= 1


def handlers_error(machine: Machine) -> int:
    """The last error of all handlers, a byte."""
    at = machine.address_of("error_of_handlers")
    return machine.peek(at & ~1) >> 8 * (at & 1) & 0xFF


def test_speeds_out_of_range_are_clamped_and_reported(image: Build) -> None:
    """1000 steps/s is the most; the handlers' last error says that a speed was beyond, the
    getter which one is in force."""
    machine = start(image("wheels", TARGET_APPS))
    assert max(abs(error) for error in measure(machine, 129, -129, 1)) <= 1
    assert handlers_error(machine) == 0
    assert max(abs(error) for error in measure(machine, 130, -32768, 5)) <= 1
    assert handlers_error(machine) == SYS_ERROR_ARGUMENT
    assert (machine.peek("left_in_force"), machine.peek("right_in_force")) == (129, 0x10000 - 129)
