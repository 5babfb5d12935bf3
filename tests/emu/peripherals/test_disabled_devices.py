"""Devices that are disabled and enabled, configured in an unusual order, or interrupted during operation (§9-§17)."""

from __future__ import annotations

import pytest

from emu.machine.machine import Machine
from emu.peripherals.i2c.bus import I2cDevice
from emu.peripherals.i2c.slave import ExternalMaster

from .conftest import Rig

OWNERS = {
    "OC1": ({"OC1CON": 2}, "PMD2", 0, "D"), "U1": ({"U1MODE": 0x8000, "U1STA": 0x0400}, "PMD1", 5, "F"),
    "I2C": ({"I2CCON": 0x9000}, "PMD1", 7, "G"), "SPI1": ({"SPI1CON": 0x20, "SPI1STAT": 0x8000}, "PMD1", 3, "F"),
    "DCI": ({"DCICON1": 0x8000}, "PMD1", 8, "G"), "C1": ({"C1CTRL": 0x0200}, "PMD1", 1, "F"),
}  # fmt: skip


@pytest.mark.parametrize("module", OWNERS)
def test_a_module_that_is_switched_off_gives_its_pins_back(module):
    """§6, §17: the pins of a module that is switched off follow LAT and TRIS again."""
    settings, register, bit, letter = OWNERS[module]
    rig = Rig()
    rig.write("TRIS" + letter, 0)
    for name, value in settings.items():
        rig.at(rig.events.now + 10).write(name, value)
    rig.at(100)
    port = next(port for port in rig.dev.ports.values() if port.tris.name == "TRIS" + letter)
    taken = port._owned.value
    assert taken
    rig.write(register, 1 << bit)
    for level in (0xFFFF, 0):
        rig.at(rig.events.now + 10).write("LAT" + letter, level)
        rig.at(rig.events.now + 10)
        assert rig.dev.pins.levels(port.index, rig.events.now) & taken == level & taken


@pytest.mark.parametrize("late", ["DCICON3", "TSCON", "RSCON", "DCICON1"])
def test_the_codec_port_starts_whatever_is_set_up_last(late):
    """§14: the codec port starts after the last setting, also if that is the bit clock or the slots after DCIEN."""
    settings = {"DCICON2": 0x00EF, "DCICON3": 3, "TSCON": int(late != "RSCON"), "RSCON": int(late == "RSCON")}
    rig = Rig()
    first = {**settings, late: 0} if late != "DCICON1" else settings
    for name, value in first.items():
        rig.write(name, value)
    rig.write("DCICON1", 0x8400 if late == "DCICON1" else 0x8000)
    assert not rig.at(5000).flag("DCIIF")
    rig.write(late, 0x8000 if late == "DCICON1" else settings[late])
    assert rig.at(5001 + 8 * 256).flag("DCIIF")


def test_a_codec_port_that_never_ran_gives_its_pins_back():
    """§14: a codec port without a bit clock never runs, so DCIEN = 0 ends it at once and its pins follow LAT."""
    rig = Rig()
    rig.write("DCICON1", 0x8000)
    rig.at(100).write("DCICON1", 0)
    rig.at(200)
    assert next(p for p in rig.dev.ports.values() if p.tris.name == "TRISG")._owned.value == 0


# -- UART --------------------------------------------------------------------------------------------------------------


def test_the_pin_sends_in_loopback_too():
    """§10: in loopback the transmit pin still sends; only the receive pin is disconnected."""
    rig, sent = Rig(), []
    rig.dev.uart[1].on_byte = lambda byte, _start: sent.append(byte)
    rig.write_all(U1MODE=0x8040, U1STA=0x0400)
    rig.at(5).write("U1TXREG", 0x41)
    assert rig.at(1000).read("U1RXREG") == 0x41
    assert sent == [0x41]


def test_a_break_is_heard_in_loopback():
    """§10: UTXBRK in loopback forces the line low, which is received as zeros with a framing error."""
    rig = Rig()
    rig.write_all(U1MODE=0x8040, U1STA=0x0C00)
    rig.at(5).write("U1TXREG", 0x41)
    rig.at(1000)
    assert rig.field("U1STA", "FERR") == 1
    assert rig.read("U1RXREG") == 0


@pytest.mark.parametrize(("before", "after"), [(7, 0), (0, 7), (3, 3)])
def test_the_rate_changes_in_the_middle_of_a_character(before, after):
    """§10: writing BRG during a character restarts the baud counter: the current bit lasts one more bit time, then
    the others follow at the new rate."""
    rig = Rig()
    rig.write_all(U1BRG=before, U1MODE=0x8000, U1STA=0x0400)
    rig.at(5).write("U1TXREG", 0x35)
    old, new = 16 * (before + 1), 16 * (after + 1)
    start = rig.first_cycle(lambda: not rig.dev.pins.get("RF3"), 6, 300)
    bits = [0, *(0x35 >> bit & 1 for bit in range(8)), 1]
    changed = start + 3 * old + 5  # in the third data bit
    rig.at(changed).write("U1BRG", after)
    for index in range(3, 10):
        middle = changed + 1 + (index - 3) * new + new // 2
        assert rig.at(middle).dev.pins.get("RF3") == bits[index], index
    assert rig.at(changed + 7 * new).field("U1STA", "TRMT") == 0
    assert rig.at(changed + 1 + 7 * new).field("U1STA", "TRMT") == 1
    assert rig.at(changed + 2000).dev.pins.get("RF3") == 1


def test_nothing_is_lost_in_loopback_when_the_rate_rises_in_the_middle():
    """§10: if the rate rises during a character in loopback, no byte is lost, because the receiver samples the
    transmitter's own bits."""
    rig = Rig()
    rig.write_all(U1BRG=7, U1MODE=0x8040, U1STA=0x0400)
    for byte in (0x11, 0x22, 0x33):
        rig.write("U1TXREG", byte)
    rig.at(400).write("U1BRG", 0)
    rig.at(5000)
    assert [rig.read("U1RXREG") for _ in range(3)] == [0x11, 0x22, 0x33]


# -- I2C ---------------------------------------------------------------------------------------------------------------


class Notes(I2cDevice):
    """An I2C device that records what it receives."""

    def __init__(self) -> None:
        self.bytes: list[int] = []

    def write(self, byte: int, cycle: int) -> bool:
        self.bytes.append(byte)
        return True


@pytest.mark.parametrize(("cut", "heard"), [(1200, []), (1359, [0x12])])
@pytest.mark.parametrize("off", ["I2CCON", "PMD1"])
def test_a_byte_that_is_cut_off_does_not_reach_the_slave(cut, heard, off):
    """§11: a slave receives a byte at its eighth clock (8 x 151 Tcy), so a byte that is cut off before does not reach
    it."""
    rig, slave = Rig(), Notes()
    rig.dev.i2c.wire.attach(0x6E, slave)
    rig.write_all(I2CBRG=150, I2CCON=0x9000)
    rig.at(5).write("I2CCON", 0x9001)
    rig.at(1000).write("I2CTRN", 0xDC)
    rig.at(3000).write("I2CTRN", 0x12)
    rig.at(3000 + cut).write(off, 0 if off == "I2CCON" else 1 << 7)
    rig.at(9000)
    assert slave.bytes == heard


def test_the_high_byte_of_i2ctrn_sends_nothing(rig):
    """§11, §18: a write of the high byte of I2CTRN, which has no function, starts no transfer."""
    rig.write("I2CCON", 0x9000)
    rig.at(5).write("I2CTRN", 0x1200, 0xFF00)
    assert rig.field("I2CSTAT", "TBF") == 0


def test_software_releases_the_clock_but_holds_it_only_with_stren(rig):
    """§11: software may set SCLREL at any time, but may clear it only if STREN = 1."""
    rig.write("I2CCON", 0x8000)
    assert rig.read("I2CCON") == 0x9000
    rig.write("I2CCON", 0x8040)
    assert rig.read("I2CCON") == 0x8040


@pytest.mark.parametrize("off", [{}, {"I2CCON": 0x9000, "PMD1": 1 << 7}])
def test_a_slave_that_is_off_does_not_answer(rig, off):
    """§11: a slave that is off does not acknowledge its address."""
    rig.write("I2CADD", 0x2A)
    for name, value in off.items():
        rig.write(name, value)
    master = ExternalMaster(rig.dev.i2c.slave, rig.events)
    transfer = master.transfer([0x54, 1])
    rig.at(20_000)
    assert not any(transfer.acknowledged)
    assert not rig.flag("SI2CIF")
    assert rig.read("I2CSTAT") == 0


# -- supply ------------------------------------------------------------------------------------------------------------


def test_a_threshold_above_the_supply_is_noticed(rig):
    """§17: a supply of 3 V is above the threshold of LVDL = 1 and below that of LVDL = 14, which sets the flag."""
    rig.write("RCON", 0x1103)
    rig.at(1000).dev.lvd.set_supply(3000)
    assert rig.at(1001).flag("LVDIF") == 0
    rig.write("RCON", 0x1E03)
    assert rig.at(1002).flag("LVDIF") == 1


# -- settings without a model ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "what"),
    [
        ([("SPI2CON", 0x4020), ("SPI2CON", 0x4000)], "SPI2CON.FRMEN"),
        ([("U1MODE", 0x0400), ("U1MODE", 0x8400)], "U1MODE.ALTIO"),
        ([("DCICON1", 0x8400)], "DCICON1.CSCKD"),
        ([("DCICON1", 0x8003)], "DCICON1.COFSM"),
        ([("C2CTRL", 0x8480)], "C2CTRL.CANCAP"),
        ([("C1INTE", 0x0040)], "C1INTE.WAKIE"),
        ([("SPI2CON", 0x0020), ("U2MODE", 0xFFFF), ("DCICON1", 0x8001), ("C1INTE", 0x00BF)], None),
    ],
)
def test_settings_without_a_model_are_reported_once(rig, settings, what):
    """A setting that requests an unmodelled function is reported."""
    notes = []
    rig.bus.note = notes.append
    for name, value in settings:
        rig.at(rig.events.now + 5).write(name, value)
    assert [text.split(":")[0] for text in notes] == ([what] if what else [])


def test_the_crystal_of_timer_one_is_reported(rig):
    """§3: LPOSCEN, which turns on timer 1's crystal and is written with the key, is reported as not modelled."""
    notes = []
    rig.bus.note = notes.append
    for byte in (0x46, 0x57, 0x02):
        rig.at(rig.events.now + 1).write("OSCCON", byte, 0x00FF)
    assert len(notes) == 1
    assert notes[0].startswith("OSCCON.LPOSCEN")


@pytest.mark.parametrize(("begin", "end"), [(0, 1), (1, 2), (0, 2), (1, 3), (2, 3)])
def test_a_listener_and_a_switch_do_not_lose_each_other(begin, end):
    """§17: PMD1 disables timer 1 (step 1) and enables it (step 2) while a register listener is added and removed;
    neither change is lost."""
    machine = Machine(engine="plain")
    machine.reset("POR")
    bus, at = machine.bus, machine.chip.sfrs
    heard, remove = [], None
    for step, off in enumerate((0, 1, 0, 0)):
        bus.write(at["PMD1"].address, off << 11)
        if step == begin:
            remove = machine.hook_sfr("T1CON", lambda is_write, word: heard.append((is_write, word)))
        if step == end:
            remove()
        count = len(heard)
        bus.write(at["T1CON"].address, 0x8000)
        assert bus.read(at["T1CON"].address) == (0 if off else 0x8000)
        expected = [(True, 0 if off else 0x8000), (False, 0 if off else 0x8000)] if begin <= step < end else []
        assert heard[count:] == expected
        machine.events.now += 50
        assert bus.read(at["TMR1"].address) == (0 if off else 49)
        bus.write(at["T1CON"].address, 0)
        bus.write(at["TMR1"].address, 0)
