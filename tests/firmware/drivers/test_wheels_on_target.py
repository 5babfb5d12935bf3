"""Wheel speeds under the kernel, measured by counting motor steps."""

from __future__ import annotations

import pytest

from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.wheels import FASTEST, FCY, measure, partner, start

PERIOD_TICKS = 6192
TICK_TCY = 1536
SYS_ERROR_ARGUMENT = 5


@pytest.mark.slow
def test_every_speed_is_exact_over_a_whole_period(image: Build) -> None:
    """Every speed v makes exactly 5 v steps in 6,192 ticks of 1,536 Tcy (openswarm-original.md §5.2).

    After this period the stepper's fraction has its initial value, so that the rate is exact for any time.
    fuzz_wheels.py counts 60 s of each speed.
    """
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
    """Return the accumulated fractions of the next step, left and right, in units of 1/6192 step (motors.c)."""
    return [machine.peek(machine.address_of(name) + 2) for name in ("stepper_left", "stepper_right")]


@pytest.mark.parametrize(("left", "right"), [(129, -129), (1, -128), (64, 65)])
def test_a_minute_is_exact_to_a_step(image: Build, left: int, right: int) -> None:
    """At every speed the number of steps of one minute is exact."""
    errors = measure(start(image("wheels", TARGET_APPS)), left, right, 60)
    assert max(abs(error) for error in errors) <= 1


def handlers_error(machine: Machine) -> int:
    """Return the last error of the handler context, the first byte of the record."""
    at = machine.address_of("os_errors")
    return machine.peek(at & ~1) >> 8 * (at & 1) & 0xFF


def test_speeds_out_of_range_are_clamped_and_reported(image: Build) -> None:
    """Speeds above 1000 steps/s are clamped: the getter returns the clamped speed.

    The last error of the handler context reports the clamping.
    """
    machine = start(image("wheels", TARGET_APPS))
    assert max(abs(error) for error in measure(machine, 129, -129, 1)) <= 1
    assert handlers_error(machine) == 0
    assert max(abs(error) for error in measure(machine, 130, -32768, 5)) <= 1
    assert handlers_error(machine) == SYS_ERROR_ARGUMENT
    assert (machine.peek("left_in_force"), machine.peek("right_in_force")) == (129, 0x10000 - 129)
