"""Reverse stepping restores the complete state that the forward run had."""

from __future__ import annotations

import random
from collections import Counter
from functools import partial

import numpy as np
import pytest

import emu
from emu.boards.epuck.board import Epuck
from emu.debug.history import History
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import START
from tests.fuzz.emulator.fuzz_reverse import APPS, walk


def record_run(
    machine: emu.Machine, rng: random.Random, stretches: int
) -> tuple[History, dict[int, bytes], dict[int, int]]:
    """Record a run with input; return it with the states before single steps and the end cycle of each step."""
    history = History(machine, period=300_000)
    states: dict[int, bytes] = {}
    follows: dict[int, int] = {}
    for number in range(stretches):
        assert history.advance(machine.cycle + rng.randrange(400_000)) is None
        if number % 3 == 1:
            machine.uart[1].feed(bytes(rng.randrange(256) for _ in range(5)))
        for _ in range(rng.randrange(60)):
            cycle = machine.cycle
            states[cycle] = machine.snapshot()
            history.step()
            follows[cycle] = machine.cycle
    return history, states, follows


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["jit", "plain"])
def test_every_state_is_restored_to_the_bit(image: Build, engine: str) -> None:
    """Reverse steps restore every bit across preemption, interrupts, camera frames (I2C, pixel port) and UART input."""
    machine = emu.load(image("clustering"), engine=engine, board=partial(Epuck, selector=START))
    assert machine.board.camera is not None
    machine.board.camera.show(np.full((480, 640, 3), (200, 20, 20), np.uint8))
    rng = random.Random(20)
    history, states, follows = record_run(machine, rng, 12)
    present = machine.snapshot()
    end = machine.cycle
    for cycle in rng.sample(sorted(states), 25):
        history.seek(cycle)
        assert machine.snapshot() == states[cycle]
    for cycle in rng.sample(sorted(follows), 15):
        history.seek(follows[cycle])
        assert history.step_back()
        assert machine.cycle == cycle
        assert machine.snapshot() == states[cycle]
    history.seek(end)
    assert machine.snapshot() == present
    history.seek(history.start)
    assert not history.step_back()
    assert history.advance(end) is None
    assert machine.snapshot() == present
    assert history.size < 20 * len(history._states) * 1024 + (1 << 18)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 10, 1006])
def test_random_walks_back_restore_every_state(image: Build, seed: int) -> None:
    """Random walks of forward and reverse steps restore every state: three walks of the fuzz campaign.

    The campaign is tests/fuzz/emulator/fuzz_reverse.py. In the first walk, a reverse step crosses input that arrives
    while the CPU sleeps. In the last, a checkpoint lies between the entry of an interrupt and its first instruction.
    """
    app = list(APPS)[seed % 5 == 0]
    tally: Counter[str] = Counter()
    walk(image(app), APPS[app], seed, tally)
    assert min(tally["steps"], tally["input"]) > 0


@pytest.mark.slow
def test_back_to_a_breakpoint_and_to_the_last_write(image: Build) -> None:
    machine = emu.load(image("culprit", TARGET_APPS))
    heard: list[int] = []
    machine.run(until="main")
    history = History(machine)
    wakes: list[int] = []
    remove = machine.hook_pc("worker", lambda: wakes.append(machine.cycle))
    calls: list[int] = []
    remove_calls = machine.hook_pc("Sys_Sleep", lambda: calls.append(machine.cycle))
    machine.uart[1].listen(lambda byte, _cycle: heard.append(byte))
    history.advance(1_000_000)
    machine.poke("mistake", 9)
    history.advance(1_200_000)
    count = len(calls)
    sleep = machine.program_address("Sys_Sleep")
    for expected in reversed(calls[-5:]):
        assert history.run_back([sleep]) == sleep
        assert machine.cycle == expected
    assert len(calls) == count, "a replay must call no hook"
    history.seek(history.end)
    assert history.run_back([sleep], lambda: machine.w[0] == 5) == sleep
    assert machine.w[0] == 5
    history.seek(history.end)
    tick = machine.program_address("cpu_clock_isr")
    assert history.run_back([tick]) == tick
    after = machine.cycle
    phase = machine.address_of("clock_phase")
    found = history.last_write(phase, 2)
    assert found is not None
    assert found.cycle < after
    assert machine.pc == found.pc
    assert machine.peek("clock_phase").to_bytes(2, "little") == found.old
    machine.step()
    assert machine.peek("clock_phase").to_bytes(2, "little") == found.new != found.old
    assert machine.inspector.function_name(found.pc) == "cpu_clock_isr"
    assert history.run_back([0x17000]) is None
    assert machine.cycle == history.start
    remove()
    remove_calls()


@pytest.mark.slow
def test_the_entry_of_an_interrupt_is_a_step_of_its_own(image: Build) -> None:
    """The entry of an interrupt is one step, both forward from the instruction before it and back from the handler."""
    machine = emu.load(image("culprit", TARGET_APPS))
    machine.run(until="main")
    history = History(machine)
    vectors = machine.chip.vectors
    handlers = {machine.image.word(vector.ivt) for vector in vectors} if machine.image is not None else set()
    removals = [machine.hook_pc(handler, lambda: True) for handler in handlers if handler]
    assert history.advance(1_000_000) is not None
    for remove in removals:
        remove()
    entered = machine.cycle, machine.snapshot()
    assert machine.pc in handlers
    handler = machine.pc
    assert history.step() is None
    assert machine.pc == handler + 2
    assert history.step_back()
    assert (machine.cycle, machine.snapshot()) == entered
    assert history.step_back()
    assert machine.inspector.function_start(machine.pc) != handler
    assert history.step() is None
    assert (machine.cycle, machine.snapshot()) == entered


def test_a_change_in_the_past_makes_a_new_present(image: Build) -> None:
    machine = emu.load(image("culprit", TARGET_APPS))
    history = History(machine)
    assert history.advance(1_000_000) is None
    history.seek(500_000)
    assert history.is_past
    machine.poke("mistake", 1)
    stop = history.advance(1_000_000) or machine.stopped("limit")
    assert stop.fault is not None
    assert not history.is_past
    assert stop.fault.function == "store"
    with pytest.raises(ValueError, match="is not in the recording"):
        history.seek(1_000_001)
    history.seek(500_000)
    assert machine.peek("mistake") == 1
    history.seek(499_000)
    assert machine.peek("mistake") == 0
