"""Every interrupt source of the chip, raised by its own device on its own pins (dspic30f6014a.md §5.2, §6.1).

The other files test one device of a kind thoroughly. Here every instance has its own pins, registers and flag.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.machine.machine import Machine
from emu.peripherals.i2c.slave import ExternalMaster
from tests.emu.peripherals.conftest import Rig
from tests.emu.peripherals.serial.test_can import configure, load

TON = 0x8000
SOURCES = {source.name: irq for irq, source in DSPIC30F6014A.interrupts.items()}


def external(number: int, pin: str) -> Callable[[Rig], None]:
    def cause(rig: Rig) -> None:
        rig.at(10).dev.pins.set(pin, 1)

    return cause


def capture(number: int) -> Callable[[Rig], None]:
    """Capture by IC1-IC8 on RD8-RD15 (§8) with timer 2 at 1:1: an edge in cycle 100 captures 101."""

    def cause(rig: Rig) -> None:
        rig.write("T2CON", TON)
        rig.write(f"IC{number}CON", 0x80 | 3)
        rig.at(100).dev.pins.set(f"RD{7 + number}", 1)
        rig.at(110)
        assert rig.read(f"IC{number}BUF") == 101

    return cause


def compare(number: int) -> Callable[[Rig], None]:
    """Compare by OC1-OC8 on RD0-RD7 (§9): the pin is high from the match with OCxR on."""

    def cause(rig: Rig) -> None:
        rig.write("T3CON", TON)
        rig.write(f"OC{number}R", 50)
        rig.write(f"OC{number}CON", 8 | 1)
        assert rig.at(51).dev.pins.get(f"RD{number - 1}") == 0
        assert rig.at(60).dev.pins.get(f"RD{number - 1}") == 1

    return cause


def timer(number: int) -> Callable[[Rig], None]:
    """Match of a timer (§7)."""

    def cause(rig: Rig) -> None:
        rig.write(f"PR{number}", 20)
        rig.write(f"T{number}CON", TON)
        rig.at(40)

    return cause


def received(number: int) -> Callable[[Rig], None]:
    """Character received by a UART (§10.2)."""

    def cause(rig: Rig) -> None:
        rig.write(f"U{number}BRG", 7)
        rig.write(f"U{number}MODE", TON)
        rig.dev.uart[number].feed(b"A")
        rig.at(2000)
        assert rig.read(f"U{number}RXREG") == 0x41

    return cause


def sent(number: int) -> Callable[[Rig], None]:
    """Character sent by a UART (§10.1); the flag also rises when the transmitter is first enabled."""

    def cause(rig: Rig) -> None:
        rig.write(f"U{number}MODE", TON)
        rig.write(f"U{number}STA", 0x0400)
        rig.at(10)

    return cause


def serial_port(number: int) -> Callable[[Rig], None]:
    """Word exchanged by an SPI port (§12)."""

    def cause(rig: Rig) -> None:
        rig.write(f"SPI{number}CON", 0x003A)
        rig.write(f"SPI{number}STAT", TON)
        rig.at(10).write(f"SPI{number}BUF", 0x5A)
        rig.at(100)

    return cause


def can_bus(number: int) -> Callable[[Rig], None]:
    """Frame received in loopback by a CAN module (§15)."""

    def cause(rig: Rig) -> None:
        configure(rig, can=number)
        rig.write(f"C{number}INTE", 1)
        load(rig, 0, 0x123, b"\1\2", can=number)
        rig.at(rig.events.now + 4000)
        assert rig.read(f"C{number}RX0B1") == 0x0201

    return cause


def converter(rig: Rig) -> None:
    """Conversion of the ADC (§13)."""
    rig.write_all(ADCON3=0x0109, ADCON1=TON | 0x00E4)
    rig.at(200)


def memory(rig: Rig) -> None:
    """Erase of an EEPROM word (§16)."""
    rig.write_all(NVMADRU=0x7F, NVMADR=0xF000)
    rig.at(10).write("NVMKEY", 0x55)
    rig.at(11).write("NVMKEY", 0xAA)
    rig.at(12).write("NVMCON", 0xC044)
    rig.at(40_000)


def bus_master(rig: Rig) -> None:
    """Start condition of the I2C master (§11)."""
    rig.write_all(I2CBRG=10, I2CCON=0x9000)
    rig.at(5).write("I2CCON", 0x9001)
    rig.at(40)


def bus_slave(rig: Rig) -> None:
    """Address match of the I2C slave (§11)."""
    rig.write_all(I2CADD=0x42, I2CCON=0x9000)
    ExternalMaster(rig.dev.i2c.slave, rig.events).transfer([0x84])
    rig.at(5_000)


def change_notice(rig: Rig) -> None:
    """Change notification on CN0, which is RC14 (§6.2)."""
    rig.write("CNEN1", 1)
    rig.at(10).dev.pins.set("RC14", 1)
    rig.at(13)


def codec(rig: Rig) -> None:
    """Frames of the codec interface (§14)."""
    rig.write_all(DCICON2=0x00EF, DCICON3=3, TSCON=1, DCICON1=TON)
    rig.at(5_000)


def supply(rig: Rig) -> None:
    """Low supply voltage (§17)."""
    rig.write("RCON", 0x1503)
    rig.at(400)
    rig.dev.lvd.set_supply(2000)
    rig.at(402)


EXTERNAL = {"INT0": "RF6", "INT1": "RA12", "INT2": "RA13", "INT3": "RA14", "INT4": "RA15"}
CAUSES: dict[str, Callable[[Rig], None]] = {
    **{name: external(int(name[-1]), pin) for name, pin in EXTERNAL.items()},
    **{f"IC{n}": capture(n) for n in range(1, 9)}, **{f"OC{n}": compare(n) for n in range(1, 9)},
    **{f"T{n}": timer(n) for n in range(1, 6)}, **{f"U{n}RX": received(n) for n in (1, 2)},
    **{f"U{n}TX": sent(n) for n in (1, 2)}, **{f"SPI{n}": serial_port(n) for n in (1, 2)},
    **{f"C{n}": can_bus(n) for n in (1, 2)}, "ADC": converter, "NVM": memory, "MI2C": bus_master, "SI2C": bus_slave,
    "CN": change_notice, "DCI": codec, "LVD": supply,
}  # fmt: skip


def flags(rig: Rig) -> set[str]:
    sources = DSPIC30F6014A.interrupts.values()
    return {source.name for source in sources if rig.peek(source.flag[0]) >> source.flag[1] & 1}


def test_every_source_of_the_chip_is_here():
    assert set(CAUSES) == set(SOURCES)


@pytest.mark.parametrize("name", sorted(SOURCES, key=SOURCES.__getitem__))
def test_device_raises_its_own_flag_and_no_other(rig, name):
    """§5.2: a device raises its own interrupt flag and no other. T2 and T3 may run as time bases, but have no match
    here."""
    rig.dev.pins.set("RF2", 1)
    rig.dev.pins.set("RF4", 1)
    for pin in EXTERNAL.values():
        rig.dev.pins.set(pin, 0)
    rig.clear_flags()
    CAUSES[name](rig)
    rig.at(rig.events.now + 5)
    assert flags(rig) == {name}


@pytest.mark.parametrize("alternate", [False, True])
@pytest.mark.parametrize("name", sorted(SOURCES, key=SOURCES.__getitem__))
def test_flag_leads_through_its_own_vector(name, alternate):
    """§5: an interrupt uses the vector at 0x14 + 2 irq, with ALTIVT at 0x94 + 2 irq, and the enable and priority bits
    of its source."""
    machine = Machine(engine="plain")
    source, irq = DSPIC30F6014A.interrupts[SOURCES[name]], SOURCES[name]
    for address in range(0x100, 0x110, 2):
        machine.program.put_flash(address, [0])
    machine.program.put_flash(0, [0x040100, 0])  # goto 0x100
    base = (0x94 if alternate else 0x14) + 2 * irq
    for vector in range(0x04, 0xFE, 2):
        machine.program.put_flash(vector, [0x000200])
    machine.program.put_flash(base, [0x000300])
    machine.run(cycles=4)
    machine.write("INTCON2", 0x8000 if alternate else 0)
    group, shift = source.priority
    machine.write(group, machine.peek(group) & ~(7 << shift) | 3 << shift)
    machine.poke(source.enable[0], 1 << source.enable[1])
    machine.write(source.flag[0], 1 << source.flag[1])
    for _ in range(4):
        if machine.pc == 0x300:
            break
        machine.step()
        machine.service_boundary(machine.cycle + 1)
    assert machine.pc == 0x300
    assert machine.state.ipl == 3
