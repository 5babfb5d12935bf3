"""Worst-case cycles of allocation: random histories of the heap on the emulated robot, timed by the robot's timer."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import emu
from emu import Machine
from tests.firmware.conftest import FIRMWARE, TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import place

HEADER = (FIRMWARE / "openswarm" / "include" / "openswarm.h").read_text()
RANGES = ("send", "start", "send_refused", "start_refused", "kill")
"""Measured calls in the application's result, in the order of its fields; they follow two counts of calls."""
TIMER = 6
"""Tcy that a measurement adds to a call: the call itself and reading the timer."""
LENGTHS = (1, 3, 5, 8)
"""Values of `bursts`: they allow bursts of up to 1, 4, 16 and 128 messages.

With short bursts many threads start and end; long bursts create many messages.
"""
PATIENCE = 20_000_000_000


PROMISE = re.compile(r"no \| (?:\d+, or )?(\d+) \+.*?at most (\d+) more while memory is short", re.DOTALL)
"""Pattern of a contract line: cycles of a call, `A + ...` or `Z, or A + ...`, and the addition for a full heap."""


def bound(call: str) -> int:
    """Return the header's maximum Tcy of a call with parameters 0."""
    start = HEADER.index(f" {call}(")
    base, more = PROMISE.search(HEADER[HEADER.rindex("/* MTH", 0, start) : start]).groups()
    return int(base) + int(more)


class Histories:
    """Runs histories of the application `heap`, each from the same initial state."""

    def __init__(self, path: Path) -> None:
        self.machine: Machine = emu.load(path, engine="jit")
        self.machine.hook_pc(place(self.machine, "history_begins"), lambda: True)
        self.machine.hook_pc(place(self.machine, "history_ended"), lambda: True)
        self._to("history_begins")
        self._start = self.machine.snapshot()
        self.sends = self.starts = 0
        self.worst = dict.fromkeys(RANGES, 0)
        """Maximum Tcy of each call, without the measurement."""

    def run(self, seed: int, steps: int) -> None:
        """Run one history. A call that exceeds the header's bound raises AssertionError."""
        machine = self.machine
        machine.restore(self._start)
        machine.poke(machine.address_of("seed"), seed % 0xFFFF + 1)
        machine.poke(machine.address_of("steps"), steps)
        machine.poke(machine.address_of("bursts"), LENGTHS[seed % len(LENGTHS)])
        machine.step()
        self._to("history_ended")
        result = machine.address_of("result")
        words = [machine.peek(result + 2 * index) for index in range(4 + 2 * len(RANGES))]
        self.sends += words[0] | words[1] << 16
        self.starts += words[2] | words[3] << 16
        for name, most in zip(RANGES, words[5::2], strict=True):
            self.worst[name] = max(self.worst[name], most - TIMER)
        for name, call in (("send", "Sys_Send_Event"), ("start", "Sys_Start_Process")):
            took = self.worst[name]
            assert took <= bound(call), f"{call} took {took} Tcy, not {bound(call)} at most"

    def _to(self, name: str) -> None:
        stop = self.machine.run(cycles=PATIENCE)
        assert (stop.reason, stop.pc) == ("breakpoint", place(self.machine, name)), stop

    def __str__(self) -> str:
        worst = ", ".join(f"{name} {most:,}" for name, most in self.worst.items())
        return f"{self.sends:,} sends, {self.starts:,} starts; Tcy at most: {worst}"


@pytest.mark.slow
def test_allocation_is_bounded_in_every_history(image: Build) -> None:
    """Sys_Send_Event and Sys_Start_Process stay within the headers' bounds in every history.

    tests/fuzz/kernel/fuzz_heap.py runs a million calls.
    """
    histories = Histories(image("heap", TARGET_APPS))
    for seed in range(8):
        histories.run(seed, 3_000)
    assert histories.sends > 20_000
    assert histories.starts > 1_000
    assert histories.worst["send"] > 300, "memory was short in some of them"
    assert histories.worst["start"] > 800
