"""Slices of preempted threads, and the latency of a woken thread, on the emulated robot."""

from __future__ import annotations

import pytest

import emu
from emu import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, place, run_to
from tests.firmware.kernel.test_time_on_target import SLICE

SLICES, WOKEN_FIRST, ROUND_ROBIN = 9, 10, 11
"""Scene numbers of target/turns/main.c."""
SAVING = 40
"""Maximum cycles that a preemption takes from a thread's slice: saving registers, and the timer's resolution of 8."""
CLOCK = 300
"""Maximum cycles of a clock interrupt, which may delay the end of a slice."""


def scene(image: Build, number: int) -> Machine:
    machine = emu.load(image("turns", TARGET_APPS), engine="jit")
    run_to(machine, "begin")
    machine.poke("scene", number)
    return machine


@pytest.mark.slow
def test_a_preempted_thread_gets_the_rest_of_its_slice(image: Build) -> None:
    """A preempted thread gets the rest of its slice (hal_cpu.h, hal_slice_restart()).

    Equal threads change every 10 ms of their own CPU time, although a higher-priority thread interrupts them at every
    tick.
    """
    machine = scene(image, SLICES)
    resumed = turn = 0
    own: dict[int, int] = {}
    whole: list[int] = []

    def restarted(write: bool, _: int) -> None:
        nonlocal resumed
        resumed = machine.cycle if write else resumed

    def interrupted() -> bool:
        """Whether the running thread changes; the thread of higher priority runs too briefly to be sampled."""
        nonlocal turn
        thread = machine.peek("os_running")
        if thread != turn and turn:
            whole.append(own.pop(turn))
        turn = thread
        own[thread] = own.get(thread, 0) + machine.cycle - resumed
        return False

    machine.hook_sfr("TMR2", restarted)
    machine.hook_pc(place(machine, "_T2Interrupt"), interrupted)
    machine.run(cycles=FCY)
    assert machine.peek("rounds") >= 998, "ticks"
    assert 92 <= machine.peek("turns") <= 101
    assert len(whole) >= 90
    preemptions = 11
    settled = whole[1:]  # omits the system thread's initial turn
    assert all(-preemptions * SAVING <= length - SLICE <= CLOCK for length in settled), settled


def test_a_woken_thread_runs_first(image: Build) -> None:
    """With fixed priorities a woken thread runs first: Sys_Sleep(1) beside eight busy threads (openswarm.h)."""
    machine = scene(image, WOKEN_FIRST)
    machine.run(cycles=FCY)
    assert machine.peek("slept_most") == 1
    assert machine.peek("rounds") >= 998
    spins = [machine.peek(machine.address_of("spins") + 2 * i) for i in range(8)]
    assert min(spins) > 0
    assert 92 <= machine.peek("turns") <= 101, "the others keep their slices"


def test_round_robin_lets_a_woken_thread_wait_for_all(image: Build) -> None:
    """Under the default scheduler a woken thread waits for all other threads, within the bound of openswarm.h."""
    machine = scene(image, ROUND_ROBIN)
    machine.run(cycles=FCY)
    assert 89 <= machine.peek("slept_most") <= 91
