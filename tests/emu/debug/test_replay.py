"""Replays of a run from an earlier state (emu/debug/replay.py)."""

from __future__ import annotations

import pytest

from emu.debug.history import History
from emu.debug.replay import retrace
from emu.machine.machine import Machine

START = 0x200


@pytest.mark.parametrize(("word", "is_write"), [(0x780011, False), (0x780880, True)], ids=["load", "store"])
def test_the_first_instruction_of_a_replay_may_be_the_faulty_one(word: int, is_write: bool) -> None:
    """The bad access of a load is a read, that of a store a write, also in a replay of this instruction alone."""
    machine = Machine(engine="plain")
    machine.program.put(START, word)
    machine.reset("POR")
    machine.pc = START
    machine.w[1], machine.w[15] = 0x1001, 0x0800
    found = retrace(machine, machine.save_state(), 20, lambda: bool(machine.state.intcon1 & 8))
    assert found is not None
    assert (found.last, found.bad_access) == (START, (0x1001, 2, is_write))


def test_replayed_resets_are_no_loop_of_resets() -> None:
    """Resets count once, however often they are replayed; otherwise a replay would end as a loop of resets."""

    def machine() -> Machine:
        made = Machine(engine="plain")
        made.program.put(0, 0x040000 | START)  # GOTO, then 40 NOPs, then RESET
        for address in [2, *range(START, START + 80, 2)]:
            made.program.put(address, 0)
        made.program.put(START + 80, 0xFE0000)
        made.reset("POR")
        return made

    expected = machine().run(cycles=10_000)
    assert "reset loop" in expected.detail
    history = History(machine())
    middle = expected.cycle - 60
    assert history.advance(middle) is None
    history.seek(1)
    assert history.advance(middle) is None
    assert history.machine.cycle == middle
    stop = history.advance(10_000)
    assert stop is not None
    assert (stop.reason, stop.cycle, stop.detail) == (expected.reason, expected.cycle, expected.detail)


@pytest.mark.parametrize("register", ["ADCBUF0", "ADCON1", "PORTF"])
def test_a_look_at_a_register_in_the_past_keeps_the_recording(register: str) -> None:
    """Reading the ADC or a TX pin computes its value, which must not count as a change of the machine."""
    machine = Machine(engine="plain")
    machine.program.put(0, 0x37FFFF)  # bra to itself
    machine.reset("POR")
    machine.write("ADCON3", 0x0102)
    machine.write("ADCON2", 0x003C)  # an interrupt after 16 results, which come every 23 Tcy
    machine.write("ADCON1", 0x80E4)
    machine.write("U1MODE", 0x8000)
    machine.write("U1STA", 0x0400)
    history = History(machine)
    history.advance(1000)
    expected = machine.snapshot()
    for cycle in range(100, 300, 10):
        history.seek(cycle)
        state = machine.snapshot()
        machine.peek(register)
        assert machine.snapshot() == state
        history.step()
        assert history.end == 1000
    history.seek(1000)
    assert machine.snapshot() == expected
