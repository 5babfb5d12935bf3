"""Random accesses to every register at random times: no device fails, nothing is lost in a snapshot."""

from __future__ import annotations

import random

import pytest

from emu.chips.dspic30f6014a import DSPIC30F6014A, SFRS
from emu.peripherals.pins import PORTS

from .conftest import Rig

CPU_END = SFRS["INTCON1"].address
WORDS = [sfr for sfr in SFRS.values() if sfr.size == 2 and sfr.address >= CPU_END and not sfr.name.startswith("IFS")]
ENABLES = [(sfr.name, bit) for sfr in WORDS for bit in (15, 0, 1, 3) if sfr.mask >> bit & 1]


def act(rig: Rig, draw: random.Random) -> None:
    """One random access, pin change, byte or power change."""
    kind = draw.random()
    if kind < 0.55:
        sfr = draw.choice(WORDS)
        value = draw.choice((draw.randrange(0x10000), 1 << draw.randrange(16), 0, 0xFFFF, draw.randrange(64)))
        rig.write(sfr.name, value, draw.choice((0xFFFF, 0xFFFF, 0x00FF, 0xFF00)))
    elif kind < 0.65:
        name, bit = draw.choice(ENABLES)
        rig.write(name, rig.read(name) ^ 1 << bit)
    elif kind < 0.8:
        rig.read(draw.choice(WORDS).name)
    elif kind < 0.9:
        rig.dev.pins.set_port(draw.randrange(len(PORTS)), 1 << draw.randrange(16), draw.choice((0, 0xFFFF)))
    elif kind < 0.93:
        rig.dev.uart[draw.choice((1, 2))].feed([draw.randrange(256)], draw.choice((None, rig.events.now + 50)))
    elif kind < 0.94:
        rig.dev.sleep(draw.choice((1, 2)), rig.events.now)
        rig.at(rig.events.now + draw.randrange(2000))
        rig.dev.wake(rig.events.now)
    elif kind < 0.945:
        rig.dev.reset(draw.choice(("EXTR", "SWR", "WDTO", "BOR", "POR")))
    elif kind < 0.95:
        rig.program.table_write(draw.choice((0x1000, 0x7FF000)) + 2 * draw.randrange(64), 7, draw.randrange(1 << 24))
    rig.at(rig.events.now + draw.choice((0, 1, 1, 2, 3, 10, 100, draw.randrange(3000))))


@pytest.mark.parametrize("seed", range(8))
def test_random_accesses_never_fail_and_keep_to_the_masks(seed):
    """What is stored stays inside each register's implemented bits."""
    rig, draw = Rig(fosc=0x7FE6 if seed % 2 else 0xFFE6), random.Random(seed)
    for _ in range(4000):
        act(rig, draw)
    for sfr in WORDS:
        assert not rig.peek(sfr.name) & ~sfr.mask, sfr.name


@pytest.mark.parametrize("seed", range(8))
def test_restored_snapshots_continue_exactly_as_the_original(seed):
    """Hidden state is in the record: the same actions after a restore give the same record."""
    rig, draw = Rig(), random.Random(100 + seed)
    for _ in range(600):
        act(rig, draw)
    state = rig.record.snapshot()
    later = []
    for _ in range(2):
        rig.record.restore(state)
        rig.dev.restored()
        draw = random.Random(200 + seed)
        for _ in range(600):
            act(rig, draw)
        later.append(rig.record.snapshot())
    differing = [rig.record.field_at(i) for i, (a, b) in enumerate(zip(*later, strict=True)) if a != b]
    assert differing == []


def test_chip_of_the_fuzz_is_the_one_under_test():
    """The lists above are not empty by accident."""
    assert DSPIC30F6014A.name == "dsPIC30F6014A"
    assert len(WORDS) > 290
