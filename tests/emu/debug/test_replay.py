"""Replays of a run from an earlier state (emu/debug/replay.py)."""

from __future__ import annotations

import pytest

from emu.debug.replay import retrace
from emu.machine.machine import Machine

START = 0x200


@pytest.mark.parametrize(("word", "is_write"), [(0x780011, False), (0x780880, True)], ids=["load", "store"])
def test_the_first_instruction_of_a_replay_may_be_the_faulty_one(word: int, is_write: bool) -> None:
    """The bad access of a load is a read, although no instruction of the replay stores; that of a store is a write."""
    machine = Machine(engine="plain")
    machine.program.put(START, word)
    machine.reset("POR")
    machine.pc = START
    machine.w[1], machine.w[15] = 0x1001, 0x0800
    found = retrace(machine, machine.save_state(), 20, lambda: bool(machine.state.intcon1 & 8))
    assert found is not None
    assert (found.last, found.bad_access) == (START, (0x1001, 2, is_write))
