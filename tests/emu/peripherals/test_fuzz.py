"""Random accesses to every register at random times raise no exception, and snapshots lose nothing."""

from __future__ import annotations

import random

import pytest

from emu.chips.dspic30f6014a import DSPIC30F6014A, SFRS
from emu.peripherals.pins import PORTS, parse_pin
from emu.system.events import NEVER

from .conftest import Rig

CPU_END = SFRS["INTCON1"].address
WORDS = [sfr for sfr in SFRS.values() if sfr.size == 2 and sfr.address >= CPU_END and not sfr.name.startswith("IFS")]
ENABLES = [(sfr.name, bit) for sfr in WORDS for bit in (15, 0, 1, 3) if sfr.mask >> bit & 1]


def keyed(rig: Rig, draw: random.Random) -> None:
    """Write a byte of OSCCON with its key (§3), which may change the clock source and Tcy."""
    shift, lanes, keys = draw.choice(((0, 0x00FF, (0x46, 0x57)), (8, 0xFF00, (0x78, 0x9A))))
    for byte in (*keys, draw.choice((0, 1, 0x41, 0x81, 0xC1, draw.randrange(256)))):
        rig.at(rig.events.now + 1).write("OSCCON", byte << shift, lanes)


def owners(rig: Rig) -> dict[int, int]:
    """Return the pins, by port, that an enabled module may own."""
    dev = rig.dev
    pins = dict.fromkeys(dev.ports, 0)

    def add(is_on: object, *places: tuple[int, int]) -> None:
        for port, mask in places if is_on else ():
            pins[port] |= mask

    for uart in dev.uart.values():
        add(uart.is_enabled, parse_pin(uart.site.tx_pin), parse_pin(uart.site.rx_pin))
    for spi in dev.spi.values():
        add(spi.stat["SPIEN"], *spi._pins.values())
    for compare in dev.compare.values():
        add(compare.con["OCM"], (compare._port.index, compare._pin))
    for can in dev.can.values():
        add(can.ctrl["OPMODE"] in (0, 2), (can._tx_port.index, can._tx_pin))
    add(dev.i2c.con["I2CEN"], (dev.i2c.wire.port, dev.i2c.wire.sda | dev.i2c.wire.scl))
    add(dev.dci.con1["DCIEN"] or dev.dci._frame.value != NEVER, *dev.dci._pins.values())
    return pins


def contradictions(rig: Rig) -> list[str]:
    """Return contradictions between devices, or between a register and posted events."""
    dev, now, due = rig.dev, rig.events.now, rig.events.due
    pins = owners(rig)
    found = [f"{port.name}: {port._owned.value & ~pins[index]:#x} without an owner"
             for index, port in dev.ports.items() if port._owned.value & ~pins[index]]  # fmt: skip
    oscillator = dev.oscillator
    if bool(oscillator.con["OSWEN"]) != (due(oscillator._switch) != NEVER):
        found.append(f"OSWEN is {oscillator.con['OSWEN']}, the switch is due at {due(oscillator._switch)}")
    for timer in dev.timer.values():
        posted, match = due(timer._match), timer.next_cycle_at(timer.limit, now)
        if not timer.is_frozen and posted not in (now + 1, timer.closed.value):
            expected = NEVER if match == NEVER or timer._is_gated else match + 1
            if posted != expected:
                found.append(f"{timer.name} matches at {posted}, its count says {expected}")
    for compare in dev.compare.values():
        posted, change = due(compare._pin_event), compare._next_change(now) if compare.con["OCM"] else NEVER
        if not compare.is_frozen and posted not in (now + 1, change):
            found.append(f"{compare.name} changes at {posted}, its timer says {change}")
    return found


def act(rig: Rig, draw: random.Random) -> None:
    """Make one random access, pin change, byte input or power change."""
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
    elif kind < 0.946:
        keyed(rig, draw)
    elif kind < 0.948:
        rig.dev.spi[draw.choice((1, 2))].clock_word(draw.randrange(0x10000), draw.randrange(1, 40))
    elif kind < 0.949:
        rig.dev.oscillator.fail()
    elif kind < 0.9495:
        rig.dev.lvd.set_supply(draw.randrange(1000, 6000))
    elif kind < 0.95:
        rig.program.table_write(draw.choice((0x1000, 0x7FF000)) + 2 * draw.randrange(64), 7, draw.randrange(1 << 24))
    rig.at(rig.events.now + draw.choice((0, 1, 1, 2, 3, 10, 100, draw.randrange(3000))))


@pytest.mark.parametrize("seed", range(8))
def test_random_accesses_never_fail_and_keep_to_the_masks(seed):
    """Random accesses raise no exception, and the stored values are within each register's implemented bits."""
    rig, draw = Rig(fosc=0x7FE6 if seed % 2 else 0xFFE6), random.Random(seed)
    for step in range(4000):
        act(rig, draw)
        assert step % 8 or not contradictions(rig)
    for sfr in WORDS:
        assert not rig.peek(sfr.name) & ~sfr.mask, sfr.name


@pytest.mark.parametrize("seed", range(8))
def test_restored_snapshots_continue_exactly_as_the_original(seed):
    """After a restore the same actions give the same record, because all hidden state is in it."""
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
    """The lists above are not empty."""
    assert DSPIC30F6014A.name == "dsPIC30F6014A"
    assert len(WORDS) > 290
