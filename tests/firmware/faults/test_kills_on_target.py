"""Threads killed inside driver calls: samples of the whole campaign (tests/fuzz/kernel/fuzz_kills.py)."""

from __future__ import annotations

import pytest

from emu import Machine
from tests.cases import check_all
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kills import PAUSES, SCENES, Stage, begin_scene, sweep
from tests.fuzz.seeds import base_seed

STRIDE = 499
SHORTEST = 40
"""Each scene has more boundaries than this."""


@pytest.mark.slow
@pytest.mark.parametrize("ipl_slip", [0, 1])
def test_a_thread_killed_inside_a_driver_call_leaves_the_device_to_others(image: Build, ipl_slip: int) -> None:
    """Killing a thread within a driver call leaves buses, messages and memory intact.

    No interrupt writes into memory of the ended thread. Each scene runs without or with IPL slip, from a first
    boundary that the commit determines.
    """
    stage = Stage(image("kills", TARGET_APPS), ipl_slip)

    def check(scene: int) -> None:
        *_, seen = sweep(stage, scene, STRIDE, base_seed() % SHORTEST)
        assert seen.boundaries >= len(PAUSES)
        assert seen.kills

    check_all(check, range((base_seed() + ipl_slip) % 2, len(SCENES), 2))


@pytest.fixture
def stage(image: Build) -> Stage:
    """Return the firmware after one round of its scenes."""
    return Stage(image("kills", TARGET_APPS))


@pytest.mark.slow
def test_a_write_into_a_dead_threads_memory_is_seen(stage: Stage) -> None:
    """The campaign detects a bus transfer that continues in the ended thread's block."""

    def spoil(machine: Machine, block: int) -> None:
        job = machine.peek("transfer")
        machine.poke(job + 6, block + 100)  # i2c_transfer.in

    memory = begin_scene(stage, 0)
    stage.after_kill = spoil
    stage.machine.run(cycles=3_000)  # the transfer has started
    with pytest.raises(AssertionError, match="memory of the dead thread was written"):
        stage.kill(*memory, 4)


@pytest.mark.slow
def test_the_bus_is_busy_while_its_thread_lives(stage: Stage) -> None:
    """A bus is freed by the end of its owner only: a time-out does not take it from a living thread."""
    machine = stage.machine
    begin_scene(stage, 0)
    machine.run(cycles=3_000)
    owner, size = machine.peek("i2c"), machine.peek(machine.address_of("i2c") + 2)
    assert owner
    assert size == 8 + 1 + 2
    for heard in stage.said.values():
        heard.clear()
    stage.run_to("checked")
    stage.check()
    assert machine.peek("i2c") == 0
