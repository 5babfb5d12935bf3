"""I2C master and slave (dspic30f6014a.md §11). With BRG = 150 a bit is 151 Tcy and Tbrg is 75.5 Tcy."""

from __future__ import annotations

import pytest

from emu.peripherals.i2c.bus import I2cDevice
from emu.peripherals.i2c.slave import ExternalMaster

I2CEN, SCLREL = 0x8000, 0x1000
SEN, RSEN, PEN, RCEN, ACKEN, ACKDT = 1, 2, 4, 8, 0x10, 0x20
BASE = I2CEN | SCLREL


class Memory(I2cDevice):
    """I2C device with 256 registers that an address pointer selects, like the camera's."""

    def __init__(self):
        self.registers = bytearray(range(256))
        self.pointer = None
        self.log = []
        self.delay = 0

    def start(self, read, cycle):
        self.log.append(("start", read))
        self.fresh = not read
        return True

    def write(self, byte, cycle):
        if self.fresh:
            self.pointer, self.fresh = byte, False
        else:
            self.registers[self.pointer] = byte
        self.log.append(("write", byte))
        return True

    def read(self, cycle):
        self.pointer += 1
        return self.registers[self.pointer - 1]

    def acknowledged(self, more, cycle):
        self.log.append(("ack", more))

    def stop(self, cycle):
        self.log.append(("stop", cycle))

    def stretch(self, cycle):
        return self.delay


@pytest.fixture
def bus(rig):
    rig.write_all(I2CBRG=150, I2CCON=BASE)
    rig.at(9)
    return rig


def wait(rig, limit=10000):
    """Return the cycle of the next MI2CIF and clear the flag."""
    cycle = rig.first_cycle(lambda: rig.flag("MI2CIF"), rig.events.now + 1, rig.events.now + limit)
    rig.clear_flags()
    return cycle


def step(rig, bits):
    rig.write("I2CCON", BASE | bits)
    return wait(rig)


def send(rig, byte):
    rig.write("I2CTRN", byte)
    return wait(rig)


def test_enabling_on_a_free_bus_reads_as_a_stop(rig):
    """§11: after enabling on a free bus, P reads 1, which the e-puck's start-up code requires."""
    assert rig.field("I2CSTAT", "P") == 0
    rig.write("I2CCON", BASE)
    assert (rig.field("I2CSTAT", "P"), rig.field("I2CSTAT", "S")) == (1, 0)


def test_port_drives_the_lines_again_when_the_module_is_off(rig):
    """§11: after disabling the module, the port drives the lines; on the e-puck both latches are 0 and outputs."""
    rig.write("TRISG", 0xF3C3)
    assert rig.at(2).dev.pins.get("RG2") == 0
    rig.write("I2CCON", BASE)
    assert rig.at(4).dev.pins.get("RG2") == 1
    rig.write("I2CCON", 0)
    assert rig.at(6).dev.pins.get("RG3") == 0


def test_start_takes_two_half_bits(bus):
    """§11: a Start takes two Tbrg: written in cycle 10, it begins in 11; SDA falls in 86, SCL in 162, which completes
    it."""
    bus.at(10).write("I2CCON", BASE | SEN)
    assert bus.at(85).dev.pins.get("RG3") == 1
    assert bus.at(86).dev.pins.get("RG3") == 0
    assert not bus.at(161).flag("MI2CIF")
    assert bus.at(162).flag("MI2CIF")
    assert bus.read("I2CCON") == BASE
    assert (bus.field("I2CSTAT", "S"), bus.field("I2CSTAT", "P")) == (1, 0)


def test_byte_takes_nine_bits_and_tbf_falls_with_the_eighth(bus):
    """§11: a byte takes nine bits, 18 Tbrg = 1359 Tcy; TBF falls with the eighth, after 16 Tbrg = 1208 Tcy."""
    bus.dev.i2c.wire.attach(0x6E, Memory())
    step(bus, SEN)
    start = bus.events.now
    bus.write("I2CTRN", 0xDC)
    assert (bus.field("I2CSTAT", "TBF"), bus.field("I2CSTAT", "TRSTAT")) == (1, 1)
    bus.at(start + 1 + 1207)
    assert bus.field("I2CSTAT", "TBF") == 1
    bus.at(start + 1 + 1208)
    assert bus.field("I2CSTAT", "TBF") == 0
    assert wait(bus) == start + 1 + 1359
    assert (bus.field("I2CSTAT", "TRSTAT"), bus.field("I2CSTAT", "ACKSTAT")) == (0, 0)


def test_register_write_and_read_back(bus):
    """§11: a register can be written and read back: start, address, register, value, stop; start, address, register,
    restart, address, read, nack, stop."""
    memory = Memory()
    bus.dev.i2c.wire.attach(0x6E, memory)
    step(bus, SEN)
    for byte in (0xDC, 0x1D, 0x70):
        send(bus, byte)
    step(bus, PEN)
    assert memory.registers[0x1D] == 0x70
    assert (bus.field("I2CSTAT", "S"), bus.field("I2CSTAT", "P")) == (0, 1)
    step(bus, SEN)
    send(bus, 0xDC)
    send(bus, 0x1D)
    step(bus, RSEN)
    send(bus, 0xDD)
    begun = bus.events.now
    assert step(bus, RCEN) == begun + 1 + 1208
    assert bus.field("I2CSTAT", "RBF") == 1
    assert bus.read("I2CRCV") == 0x70
    assert bus.field("I2CSTAT", "RBF") == 0
    begun = bus.events.now
    assert step(bus, ACKEN | ACKDT) == begun + 1 + 151
    begun = bus.events.now
    assert step(bus, PEN) == begun + 1 + 226
    assert [entry for entry in memory.log if entry[0] == "ack"] == [("ack", False)]


def test_absent_device_is_not_acknowledged_and_reads_ff(bus):
    """§11, epuck.md §2: an absent device does not acknowledge and reads 0xFF, because the bus floats high."""
    step(bus, SEN)
    send(bus, 0x3D)
    assert bus.field("I2CSTAT", "ACKSTAT") == 1
    step(bus, RCEN)
    assert bus.read("I2CRCV") == 0xFF


def test_transmission_without_a_start_is_carried_out(bus):
    """§11: a transmission without a Start is executed; the e-puck library does this after its first failed attempt."""
    begun = bus.events.now
    assert send(bus, 0x55) == begun + 1 + 1359
    assert bus.field("I2CSTAT", "ACKSTAT") == 1


def test_write_during_a_sequence_is_a_write_collision(bus):
    """§11: a write to I2CTRN during a sequence is ignored and sets IWCOL, which software clears."""
    bus.write("I2CCON", BASE | SEN)
    bus.at(20).write("I2CTRN", 0x12)
    assert bus.field("I2CSTAT", "IWCOL") == 1
    assert bus.field("I2CSTAT", "TBF") == 0
    bus.write("I2CSTAT", 0)
    assert bus.field("I2CSTAT", "IWCOL") == 0


def test_requests_during_a_sequence_are_ignored(bus):
    """§11: a request is accepted only while all five low bits of I2CCON are 0."""
    bus.write("I2CCON", BASE | SEN)
    bus.at(20).write("I2CCON", BASE | SEN | PEN)
    assert bus.read("I2CCON") == BASE | SEN
    wait(bus)
    bus.at(3000)
    assert not bus.flag("MI2CIF")


def test_status_bits_of_hardware_survive_a_write_of_0(bus):
    """§11: writing I2CSTAT = 0 does not change the hardware bits S, P, TBF, RBF and ACKSTAT."""
    step(bus, SEN)
    bus.write("I2CSTAT", 0)
    assert bus.field("I2CSTAT", "S") == 1


def test_start_on_a_line_that_is_held_low_collides(bus):
    """§11: a Start while SDA or SCL is held low sets BCL."""
    bus.dev.i2c.wire.hold(sda=True)
    bus.write("I2CCON", BASE | SEN)
    bus.at(11)
    assert bus.flag("MI2CIF")
    assert bus.field("I2CSTAT", "BCL") == 1
    assert bus.read("I2CCON") == BASE


def test_released_bit_found_low_collides(bus):
    """§11: if SDA is held low during a 1 bit, BCL is set when SCL rises. The first 1 in 0x20 is its third bit, whose
    SCL rises after 5 Tbrg = 377 Tcy."""
    step(bus, SEN)
    bus.dev.i2c.wire.hold(sda=True)
    begun = bus.events.now
    assert send(bus, 0x20) == begun + 1 + 377
    assert bus.field("I2CSTAT", "BCL") == 1
    assert bus.field("I2CSTAT", "TRSTAT") == 0


def test_stretched_clock_delays_the_byte(bus):
    """§11: clock stretching by a slave delays the byte, because the baud rate generator waits for SCL."""
    memory = Memory()
    bus.dev.i2c.wire.attach(0x6E, memory)
    step(bus, SEN)
    send(bus, 0xDC)
    memory.delay = 5000
    begun = bus.events.now
    assert send(bus, 0x01) == begun + 1 + 5000 + 1359


def test_clock_held_low_stalls_until_it_is_released(bus):
    """§11: while SCL is held low, a transfer waits; it continues in the cycle after SCL is released."""
    step(bus, SEN)
    bus.dev.i2c.wire.hold(scl=True)
    bus.write("I2CTRN", 0xDC)
    bus.at(50000)
    assert not bus.flag("MI2CIF")
    bus.dev.i2c.wire.release()
    assert wait(bus) == 50001 + 1359


def test_stuck_slave_is_clocked_free_through_the_port(rig):
    """A slave that holds SDA low releases it after nine clock pulses, which software makes on RG2 with the module
    off."""
    wire = rig.dev.i2c.wire
    wire.hold(sda=True, clocks=9)
    rig.write("LATG", 0)
    for pulse in range(9):
        assert rig.dev.pins.get("RG3") == 0
        rig.at(100 * pulse + 10).write("TRISG", 0xF3CB)
        rig.at(100 * pulse + 50).write("TRISG", 0xF3CF)
    rig.at(1000)
    assert rig.dev.pins.get("RG3") == 1


def test_unread_byte_overflows(bus):
    """§11: a byte that arrives before the last one was read is lost and sets I2COV."""
    memory = Memory()
    bus.dev.i2c.wire.attach(0x6E, memory)
    memory.pointer = 5
    step(bus, SEN)
    send(bus, 0xDD)
    step(bus, RCEN)
    step(bus, ACKEN)
    step(bus, RCEN)
    assert bus.field("I2CSTAT", "I2COV") == 1
    assert bus.read("I2CRCV") == 5


def test_odd_brg_values_round_each_edge_down(rig):
    """§11: with an odd number of half Tcy, each edge is rounded down: BRG = 4 gives Tbrg = 2.5 Tcy, so 18 Tbrg are 45
    Tcy."""
    rig.write_all(I2CBRG=4, I2CCON=BASE)
    rig.at(10).write("I2CTRN", 0)
    assert wait(rig) == 11 + 45


@pytest.mark.parametrize("brg", [1, 2, 3, 4, 13, 72, 73, 149, 150, 367, 510, 511])
def test_clock_pulses_last_exactly_brg_plus_one_tcy(rig, brg):
    """§11: on the SCL pin, the n-th of nine clock pulses falls n (BRG + 1) Tcy after the beginning. It rises half a
    bit earlier, rounded down, so the bus frequency is exact."""
    rig.write_all(I2CBRG=brg, I2CCON=BASE)
    rig.at(5).write("I2CCON", BASE | SEN)
    wait(rig)
    start = rig.events.now + 1
    rig.write("I2CTRN", 0x5A)
    rises, falls, level = [], [], 0
    for cycle in range(start, start + 9 * (brg + 1) + 1):
        before, level = level, rig.at(cycle).dev.pins.get("RG2")
        if level != before:
            (rises if level else falls).append(cycle)
    assert falls == [start + n * (brg + 1) for n in range(1, 10)]
    assert rises == [start + (2 * n + 1) * (brg + 1) // 2 for n in range(9)]


def test_every_setting_sends_a_byte_in_nine_bits(rig):
    """§11: for all 512 values of BRG, a byte takes exactly nine bits."""
    for brg in range(512):
        rig.write_all(I2CBRG=brg, I2CCON=BASE)
        rig.at(rig.events.now + 1).write("I2CTRN", 0)
        start = rig.events.now + 1
        assert not rig.at(start + 9 * (brg + 1) - 1).flag("MI2CIF"), brg
        assert rig.at(start + 9 * (brg + 1)).flag("MI2CIF"), brg
        rig.clear_flags()
        rig.write("I2CCON", 0)


def test_waveform_shows_clock_and_data_of_a_byte(bus):
    """§11: the waveform of a byte has the MSB first, and SDA is stable while SCL is high."""
    step(bus, SEN)
    start = bus.events.now + 1
    bus.write("I2CTRN", 0xA5)
    seen = []
    for bit in range(9):
        bus.at(start + 151 * bit + 100)
        assert bus.dev.pins.get("RG2") == 1
        seen.append(bus.dev.pins.get("RG3"))
        bus.at(start + 151 * bit + 151 - 1)
    assert seen == [1, 0, 1, 0, 0, 1, 0, 1, 1]


def test_disabling_in_the_middle_forgets_the_operation(bus):
    """§11: disabling the module during an operation discards the operation."""
    bus.write("I2CCON", BASE | SEN)
    bus.at(50).write("I2CCON", 0)
    bus.at(1000)
    assert not bus.flag("MI2CIF")
    assert bus.read("I2CCON") == 0x1000


# -- slave ------------------------------------------------------------------------------------------------------------


def run_slave(rig, service, cycles=60000, every=50):
    for cycle in range(rig.events.now + every, rig.events.now + cycles, every):
        rig.at(cycle)
        if rig.flag("SI2CIF"):
            rig.clear_flags()
            service()


@pytest.fixture
def slave(rig):
    rig.write_all(I2CADD=0x42, I2CCON=BASE)
    return rig


def test_slave_receives_address_and_data(slave):
    """§11: the slave raises SI2CIF at each ninth clock; D_A distinguishes address and data."""
    seen = []
    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    result = master.transfer([0x84, 0x11, 0x22])
    run_slave(slave, lambda: seen.append((slave.field("I2CSTAT", "D_NOT_A"), slave.read("I2CRCV"))))
    assert seen == [(0, 0x84), (1, 0x11), (1, 0x22)]
    assert result.acknowledged == [True, True, True]
    assert slave.field("I2CSTAT", "P") == 1


def test_slave_ignores_other_addresses(slave):
    """§11: the slave ignores other addresses."""
    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    result = master.transfer([0x86, 0x11])
    run_slave(slave, lambda: pytest.fail("not addressed"))
    assert result.acknowledged == [False, False]


def test_slave_refuses_a_byte_while_its_register_is_full(slave):
    """§11: while its receive register is full, the slave does not acknowledge a byte and sets I2COV."""
    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    result = master.transfer([0x84, 0x11])
    run_slave(slave, lambda: None)
    assert result.acknowledged == [True, False]
    assert slave.field("I2CSTAT", "I2COV") == 1


def test_slave_sends_and_stretches_until_it_is_ready(slave):
    """§11: the slave stretches the clock (SCLREL = 0) after a read address and after each acknowledged byte, until
    its data are ready."""
    answers = iter((0x99, 0x77))

    def service():
        assert slave.field("I2CSTAT", "R_NOT_W") == 1
        slave.read("I2CRCV")
        value = next(answers, None)
        if value is not None:
            slave.write("I2CTRN", value)
            slave.write("I2CCON", BASE)

    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    result = master.transfer([], [0x85], 2)
    run_slave(slave, service)
    assert result.received == [0x99, 0x77]
    assert result.done


def test_slave_answers_the_general_call_only_with_gcen(slave):
    """§11: the slave answers the general call only with GCEN, and then sets GCSTAT."""
    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    assert not any(master.transfer([0x00]).acknowledged)
    slave.at(5000).write("I2CCON", BASE | 0x80)
    result = master.transfer([0x00])
    flags = []
    run_slave(slave, lambda: flags.append(slave.field("I2CSTAT", "GCSTAT")))
    assert result.acknowledged == [True]
    assert flags == [1]


def test_slave_matches_ten_bit_addresses(slave):
    """§11: with A10M the slave matches ten-bit addresses and sets ADD10."""
    slave.write("I2CADD", 0x2A5)
    slave.write("I2CCON", BASE | 0x400)
    master = ExternalMaster(slave.dev.i2c.slave, slave.events)
    result = master.transfer([0b11110100, 0xA5, 0x33])
    seen = []
    run_slave(slave, lambda: seen.append((slave.read("I2CRCV"), slave.field("I2CSTAT", "ADD10"))))
    assert result.acknowledged == [True, True, True]
    assert seen == [(0xA5, 1), (0x33, 1)]


def sniff(rig, cycles):
    """Return what a logic analyser on RG2 and RG3 decodes: S, P and (byte, acknowledged)."""
    seen, bits = [], []
    pins = rig.dev.pins
    before = pins.get("RG2"), pins.get("RG3")
    end = rig.events.now + cycles
    while rig.events.now < end:
        rig.at(rig.events.now + 3)
        scl, sda = pins.get("RG2"), pins.get("RG3")
        if before[0] and scl and sda != before[1]:
            seen.append("P" if sda else "S")
            bits = []
        elif scl and not before[0]:
            bits.append(sda)
            if len(bits) == 9:
                seen.append((int("".join(map(str, bits[:8])), 2), not bits[8]))
                bits = []
        before = scl, sda
        step = rig.pending and rig.pending[0]
        if step and rig.flag("MI2CIF"):
            rig.clear_flags()
            name, value = rig.pending.pop(0)
            rig.write(name, value)
    return seen


def test_a_logic_analyser_decodes_the_transaction_from_the_pins(bus):
    """§11: the pins show a transaction with start, address, register, repeated start, address, data with NACK, stop;
    the slave stretches each byte."""
    memory = Memory()
    memory.delay = 700
    bus.dev.i2c.wire.attach(0x6E, memory)
    bus.pending = [
        ("I2CTRN", 0xDC), ("I2CTRN", 0x5A), ("I2CCON", BASE | RSEN), ("I2CTRN", 0xDD), ("I2CCON", BASE | RCEN),
        ("I2CCON", BASE | ACKEN | ACKDT), ("I2CCON", BASE | PEN),
    ]  # fmt: skip
    bus.write("I2CCON", BASE | SEN)
    assert sniff(bus, 15_000) == ["S", (0xDC, True), (0x5A, True), "S", (0xDD, True), (0x5A, False), "P"]


def test_a_logic_analyser_sees_the_missing_acknowledge(bus):
    """§11: the pins show the missing acknowledge of address 0x3C, which no device has."""
    bus.pending = [("I2CTRN", 0x3C), ("I2CCON", BASE | PEN)]
    bus.write("I2CCON", BASE | SEN)
    assert sniff(bus, 5_000) == ["S", (0x3C, False), "P"]
