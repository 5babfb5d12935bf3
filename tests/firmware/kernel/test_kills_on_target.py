"""Threads killed inside driver calls: samples of the whole campaign (tests/fuzz/kernel/fuzz_kills.py)."""

from __future__ import annotations

import pytest

from emu import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kills import PAUSES, SCENES, Stage, run_to_begin, sweep

STRIDE = 331


@pytest.mark.slow
@pytest.mark.parametrize("ipl_slip", [0, 1])
@pytest.mark.parametrize("scene", range(len(SCENES)), ids=SCENES)
def test_a_thread_killed_inside_a_driver_call_leaves_the_device_to_others(
    image: Build, scene: int, ipl_slip: int
) -> None:
    """Killing a thread within a driver call leaves buses, messages and memory intact.

    No interrupt writes into memory of the ended thread.
    """
    *_, seen = sweep(image("kills", TARGET_APPS), ipl_slip, scene, STRIDE, 17 + 23 * ipl_slip)
    assert seen.boundaries >= len(PAUSES)
    assert seen.kills


@pytest.mark.slow
def test_a_write_into_a_dead_threads_memory_is_seen(image: Build) -> None:
    """The campaign detects a bus transfer that continues in the ended thread's block."""

    def spoil(machine: Machine, block: int) -> None:
        job = machine.peek("transfer")
        machine.poke(job + 6, block + 100)  # i2c_transfer.in

    stage = Stage(image("kills", TARGET_APPS))
    stage.run_to("checked")
    while stage.machine.peek("scene") != len(SCENES) - 1:
        stage.run_to("checked")
    run_to_begin(stage.machine)
    memory = stage.victim()
    stage.after_kill = spoil
    stage.machine.run(cycles=3_000)  # the transfer has started
    with pytest.raises(AssertionError, match="memory of the dead thread was written"):
        stage.kill(*memory, 4)


@pytest.mark.slow
def test_the_bus_is_busy_while_its_thread_lives(image: Build) -> None:
    """A bus is freed by the end of its owner only: a time-out does not take it from a living thread."""
    stage = Stage(image("kills", TARGET_APPS))
    machine = stage.machine
    while machine.peek("scene") != len(SCENES) - 1:
        stage.run_to("checked")
    run_to_begin(machine)
    machine.run(cycles=3_000)
    owner, size = machine.peek("i2c"), machine.peek(machine.address_of("i2c") + 2)
    assert owner
    assert size == 8 + 1 + 2
    for heard in stage.said.values():
        heard.clear()
    stage.run_to("checked")
    stage.check()
    assert machine.peek("i2c") == 0
