"""The ADC in native code: the same record as in the interpreter, for any setting and any stop."""

from __future__ import annotations

import random
from functools import partial

import pytest

from emu.api import Machine
from emu.boards.epuck.board import Epuck
from emu.image.loader import load_image

SETTLED = 3_000
"""Tcy after which the program has read its variables."""


def machine_with(image, engine: str, settings: dict[str, int]) -> Machine:
    machine = Machine(image.chip, engine=engine, board=partial(Epuck, seed=5))
    if engine == "jit":
        machine.runner.threshold, machine.runner.wait = 1, True
    machine.load(image)
    machine.run(until=image.symbols.find("main").address, cycles=SETTLED)
    for name, value in settings.items():
        machine.poke(name, value)
    return machine


def random_settings(generator: random.Random) -> dict[str, int]:
    """Return random converter settings: mostly plain scans, sometimes arbitrary values."""
    if generator.random() < 0.25:
        con1, con2 = generator.randrange(0x10000) & 0x03E6, generator.randrange(0x10000) & 0xE43F
    else:
        con1, con2 = 0x00E4, 0x0400 | generator.randrange(16) << 2 | generator.randrange(2) << 1
    return {
        "con1": con1,
        "con2": con2,
        "con3": generator.choice((0, 1, 2, 5, 31)) << 8 | generator.choice((3, 10, 19, 23, 39, 63)),
        "chs": generator.choice((0, 2, 9, 0x0907)),
        "cssl": generator.choice((0x001C, 0x111C, 0x00FC, 0x8000, 0xFFFF, 0, generator.randrange(0x10000))),
        "ways": generator.randrange(32),
    }


@pytest.mark.parametrize("seed", range(6))
def test_engines_agree_in_any_setting(program, seed):
    """Engines agree (engines.md §4.3) for any converter setting.

    Cases: odd half Tcy, scan sequences that do not divide the results per interrupt, settling emitters, levels that
    change between runs, ADCON1 read during conversions, Idle.
    """
    generator = random.Random(seed)
    image, settings = load_image(program("convert.c")), random_settings(generator)
    one, other = (machine_with(image, engine, settings) for engine in ("plain", "jit"))
    for number in range(12):
        cycles = generator.randrange(1, 6_000)
        for machine in (one, other):
            machine.run(cycles=cycles)
            if number % 4 == 3:
                machine.board.ir.set_distance(number % 8, 10 * number)
                machine.board.noise.strength = float(number == 7)
        assert one.cycle == other.cycle
        first, second = one.snapshot(), other.snapshot()
        name = one.record.field_at
        assert [name(place) for place in range(len(first)) if first[place] != second[place]] == [], settings


def test_a_scan_at_the_vendors_rate_needs_no_python(program):
    """epuck.md §5: a scan of three microphones every 450 Tcy, with ADON cleared and set in each interrupt, stays in
    native code."""
    machine = machine_with(load_image(program("convert.c")), "jit", {"con2": 0x0408, "con3": 0x0113, "ways": 19})
    machine.run(cycles=100_000)
    before, rounds = machine.runner.counts.interpreted, machine.peek("rounds")
    machine.run(cycles=500_000)
    assert machine.peek("rounds") - rounds > 900
    assert machine.runner.counts.interpreted - before < 10
    assert [machine.peek(machine.address_of("seen") + 2 * i) for i in range(2)] == [2048, 2048]


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_one_late_interrupt_does_not_shift_the_channels_for_good(program, engine):
    """dspic30f6014a.md §13: the scan restarts after every interrupt, so one late interrupt does not shift the
    channels for good. Interrupt 5 comes when three of five results are there; two rounds later the channels are right
    again."""
    image = load_image(program("late.c"))
    machine = Machine(image.chip, engine=engine)
    machine.load(image)
    for channel in range(16):
        machine.peripherals.adc.set_input(channel, 100 * channel << 4)
    machine.run(cycles=70_000)
    assert machine.peek("rounds") >= 24
    at = machine.address_of("seen")
    rows = [[machine.peek(at + 10 * row + 2 * place) for place in range(5)] for row in range(24)]
    three, five = [200, 300, 400], [900, 1000, 1100, 1200, 1300]
    assert rows[2:5] == [three + five[3:], five, three + five[3:]]
    assert rows[7:24] == [five if row % 2 else three + five[3:] for row in range(7, 24)]
