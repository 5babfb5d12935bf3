"""Rules of devices: a rule and the register's hooks leave the same record."""

from __future__ import annotations

import random

import pytest

from emu.system.rules import Cell, Rule, RuleInterpreter

from .conftest import Rig
from .test_fuzz import WORDS, act

RULED = ("TMR", "PR", "LAT", "PORT", "ADC", "U1", "U2", "SPI")


def test_every_device_with_rules_has_them_on_the_bus(rig: Rig) -> None:
    """Timers, ports and the converter have their rules on the bus."""
    named = {rig.bus.name[word] or f"{2 * word:#x}" for word, rule in enumerate(rig.bus.rules) if rule is not None}
    assert len(named) >= 5 + 5 + 7 + 7 + 18 - 4


@pytest.mark.parametrize("seed", range(4))
def test_hooks_alone_give_the_same_record_as_rules(seed: int) -> None:
    """The same random accesses with and without rules give the same record. Native pin changes are flushed before the
    comparison."""
    rigs = [Rig(), Rig()]
    rigs[1].bus.rules[:] = [None] * len(rigs[1].bus.rules)
    hot = [sfr for sfr in WORDS if sfr.name.startswith(RULED)]
    for step in range(500):
        for rig in rigs:
            draw = random.Random(f"{seed} {step}")
            if draw.random() < 0.5:
                sfr = draw.choice(hot)
                rig.write(sfr.name, draw.choice((0, 1, 40, 0xFFFF, draw.randrange(0x10000))))
                rig.at(rig.events.now + draw.choice((1, 1, 2, 50)))
            elif draw.random() < 0.4:
                rig.read(draw.choice(hot).name)
            else:
                act(rig, draw)
            rig.dev.pins.flush()
            rig.dev.deliver_uart_output()
            rig.record.u64[rig.events.deadline_index] = 0  # derived state
        one, other = (rig.record.snapshot() for rig in rigs)
        assert one == other, (step, _places(rigs[0], one, other))


def _places(rig: Rig, one: bytes, other: bytes) -> set[str]:
    return {rig.record.field_at(i) for i, (a, b) in enumerate(zip(one, other, strict=True)) if a != b}


def test_a_failed_condition_leaves_the_record_unchanged(rig: Rig) -> None:
    """A rule whose condition is false leaves the record unchanged, so that the register's hooks can handle the
    access."""

    def writes(m, place, value, lanes):
        m.require(value < 10)
        m.put(place, value)
        return lanes == 0xFFFF

    integers, place = RuleInterpreter(rig.record, rig.events), Cell(rig.address("PR1"), 16)
    rule = Rule(place, None, writes)
    assert integers.write(rule, 7, 0xFFFF)
    assert not integers.write(rule, 70, 0xFFFF)
    assert rig.peek("PR1") == 7
    assert integers.read(rule) is None
    assert "writes" in repr(rule)
