"""A sample of tests/fuzz/emulator/fuzz_register_access.py.

Engines agree, every kind of access is made, and a difference is found.
"""

from __future__ import annotations

from itertools import product

import pytest

from emu.machine.machine import Machine

from .access_census import ACCESS_MODES, modes_of
from .device_drills import registers_of
from .device_programs import CHIPS
from .drill_runs import Tally, check, crew_of

REAL, MADE_UP = CHIPS


@pytest.mark.parametrize(("seed", "chip"), [(1, REAL), (2, REAL), (3, MADE_UP)])
def test_engines_agree_on_drills(seed: int, chip: str) -> None:
    """engines.md §4: engines have the same state in the same cycle after register accesses in all modes, also in the
    cycle of an event."""
    tally = Tally()
    assert check(seed, CHIPS[chip], tally, drills=14, rounds=8) is None
    assert tally.programs > 0.9 * 14 * 8


FLOORS = {"address": 0.37, "pointer": 0.90, "REPEAT": 0.52, "DO": 0.50, "handler": 0.78, "event": 0.62}
"""Required shares of accessed registers by mode of access: a tenth below the minimum measured over sizes, reads and
writes."""


@pytest.mark.slow
def test_a_sample_of_drills_reaches_most_registers() -> None:
    """A sample accesses the required share of all registers in each mode, by reads and writes of bytes and words."""
    tally = Tally()
    for seed in range(100, 116):
        assert check(seed, CHIPS[REAL], tally, engines=("plain",), rounds=8) is None
    made, registers = modes_of(tally.accesses), registers_of(REAL)
    for mode, size, write in product(ACCESS_MODES, (1, 2), (False, True)):
        missed = [sfr.name for sfr in registers if not made[REAL, sfr.address, write, size, mode]]
        assert 1 - len(missed) / len(registers) >= FLOORS[mode], (mode, size, write, missed)


def late(machine: Machine) -> None:
    """Delay events that are due in the cycle of an access until after the access."""
    events = machine.core.events
    arrive = events.arrive
    events.arrive = lambda cycle: arrive(cycle - 1)  # type: ignore[method-assign]


def narrow(machine: Machine) -> None:
    """Drop the upper bit of byte writes to registers."""
    bus = machine.bus
    write = bus.write
    bus.write = lambda address, value, lanes=0xFFFF: write(address, value & (lanes >> 1 | 0x80), lanes)  # type: ignore[method-assign]


@pytest.mark.parametrize("defect", [late, narrow])
def test_a_defect_of_one_machine_is_found(defect) -> None:
    """A defect in one machine is found and reported with its drill."""
    crew_of.cache_clear()
    seeds = iter(range(200, 206))
    try:
        assert check(next(seeds), CHIPS[REAL], drills=1, rounds=1, engines=("plain", "plain")) is None
        for robot in (False, True):
            for slip in (0, 1):
                defect(crew_of(REAL, robot, slip, ("plain", "plain")).machines[1])
        found = [check(seed, CHIPS[REAL], engines=("plain", "plain"), rounds=6) for seed in seeds]
        assert any(text and "plain differs" in text for text in found)
    finally:
        crew_of.cache_clear()
