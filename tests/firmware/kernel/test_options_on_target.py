"""The kernel's options on the emulated robot: mutex, quota, join, cleanup, services."""

from __future__ import annotations

import random

import pytest

import emu
from emu import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, INT1IF, run_to
from tests.fuzz.seeds import base_seed

MUTEX, NO_MUTEX, LATEST, NO_LATEST, ENDS, INTERRUPTS = range(6)
"""Scene numbers of target/options/main.c."""


def scene(image: Build, number: int, seconds: float) -> Machine:
    machine = emu.load(image("options", TARGET_APPS), engine="jit")
    run_to(machine, "begin")
    machine.poke("scene", number)
    assert machine.run(cycles=int(seconds * FCY)).reason == "limit"
    return machine


@pytest.mark.slow
def test_a_ceiling_bounds_priority_inversion(image: Build) -> None:
    """With a mutex a high-priority thread waits at most for one 12 ms section of a low-priority thread.

    With a flag instead of the mutex it waits for the 2,000 ms of the middle thread (openswarm_mutex.h).
    """
    machine = scene(image, MUTEX, 0.1)
    assert machine.peek("done") == 1
    assert machine.peek("waited_ms") <= 12
    machine = scene(image, NO_MUTEX, 2.5)
    assert machine.peek("done") == 1
    assert machine.peek("waited_ms") >= 2000


@pytest.mark.slow
def test_the_latest_value_keeps_a_slow_handler_within_its_bounds(image: Build) -> None:
    """A quota of the latest value bounds the queue of a slow handler (openswarm_quota.h).

    The handler takes 1.5 ms for an event that is sent every ms; a thread runs every 10 ms.
    """
    machine = scene(image, LATEST, 2)
    assert machine.peek("commands") >= 195
    assert machine.peek("ticks") >= 1000
    statistics = machine.address_of("os_statistics")
    assert machine.peek(statistics + 4) == 0, "events lost"
    machine = scene(image, NO_LATEST, 2)
    assert machine.peek("commands") < 100
    assert machine.peek(statistics + 4) > 0


def test_ends_are_seen_waited_for_and_cleaned_up(image: Build) -> None:
    """Join, cleanup and service scenes pass their own checks (openswarm_join.h, openswarm_cleanup.h,
    openswarm_service.h)."""
    machine = scene(image, ENDS, 0.6)
    assert machine.peek("done") == 1
    assert machine.peek("zombies") == 1
    assert machine.peek("joined") == 3
    assert machine.peek("cleaned") == 3
    assert machine.peek("service_starts") == 3


def test_an_interrupt_may_call_no_option_and_breaks_none(image: Build) -> None:
    """Option calls from an interrupt are refused at random instants within locks, joins, thread ends and limited
    sends."""
    machine = emu.load(image("options", TARGET_APPS), engine="jit")
    run_to(machine, "begin")
    machine.poke("scene", INTERRUPTS)
    machine.run(cycles=100_000)
    machine.write("IEC1", machine.peek("IEC1") | INT1IF)
    instants = random.Random(base_seed())
    for _ in range(600):
        machine.write("IFS1", machine.peek("IFS1") | INT1IF)
        assert machine.run(cycles=instants.randrange(3_000, 9_000)).reason == "limit"
    assert machine.peek("wrong") == 0
    assert machine.peek("interrupts") == 600
    assert machine.peek("rounds") > 100
    assert machine.peek("joined") > 10
    assert machine.peek("cleaned") in (machine.peek("joined"), machine.peek("joined") + 1)
    assert 0 < machine.peek("ticks") <= 600
