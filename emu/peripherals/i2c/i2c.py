"""I2C master (§11). Times are multiples of Tbrg, half a bit: (BRG + 1) / 2 Tcy, rounded down per edge.

UNVERIFIED: the pin-filter delay of silicon (about 0.9 us per bit) is omitted, as §11 recommends. A bit is BRG + 1 Tcy.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from emu.chips.chip import I2cSite
from emu.peripherals.base import ChipContext, Peripheral
from emu.peripherals.i2c.bus import I2cBus, I2cDevice
from emu.peripherals.i2c.slave import I2cRegisters, I2cSlave
from emu.peripherals.interrupt_lines import Interrupts
from emu.peripherals.ports.ports import Port
from emu.system.events import NEVER

_NONE, _START, _RESTART, _STOP, _RECEIVE, _ACK, _SEND = range(7)
"""Operations of the master; _NONE while it is idle."""
_BITS: Final = {_START: "SEN", _RESTART: "RSEN", _STOP: "PEN", _RECEIVE: "RCEN", _ACK: "ACKEN"}
_LENGTH: Final = {_START: 2, _RESTART: 3, _STOP: 3, _RECEIVE: 16, _ACK: 2, _SEND: 18}
"""Duration of each operation in Tbrg (§11)."""
_EIGHTH_EDGE: Final = 16
_SEQUENCE: Final = 0x1F
"""Control bits that start an operation: SEN, RSEN, PEN, RCEN and ACKEN."""


class I2c(Peripheral):
    """The I2C module as master. `wire` is the bus outside the chip, `slave` the module's slave half."""

    def __init__(self, site: I2cSite, context: ChipContext, interrupts: Interrupts, ports: dict[int, Port]) -> None:
        super().__init__("i2c", context)
        self._line: Final = interrupts.line(site.master_irq)
        self.rcv, self.trn, self.brg = (self.register(name) for name in ("I2CRCV", "I2CTRN", "I2CBRG"))
        self.con, self.stat, self.add = (self.register(name) for name in ("I2CCON", "I2CSTAT", "I2CADD"))
        self.idle_bit = (self.con, "I2CSIDL")
        self._sclrel: Final = 1 << context.chip.sfrs["I2CCON"].fields["SCLREL"][0]
        self.con.written_by(self._con_written)
        self.trn.written_by(self._trn_written)
        self.rcv.read_by(self._rcv_read)
        self.wire: Final = I2cBus(context.pins, self.events, self.record, site.sda_pin, site.scl_pin)
        self._port: Final = ports[self.wire.port]
        self._operation: Final = self.cell("operation", "B")
        self._begun: Final = self.timestamp("begun", NEVER)
        """Start cycle of the current operation, after any clock stretching by a slave."""
        self._half_bit: Final = self.cell("half_bit", "H")
        """BRG + 1 as used by the current operation; it equals Tbrg in half Tcy."""
        self._byte: Final = self.cell("byte", "B")
        self._collides: Final = self.cell("collides", "B")
        """1 + the time in Tbrg after the start at which the operation will end in a bus collision; 0 if it will not."""
        self._ack: Final = self.cell("ack", "B")
        self._address_next: Final = self.cell("address_next", "B")
        self._selected: Final = self.cell("selected", "B")
        """1 + address of the slave in the current transaction; 0 if there is none."""
        self._reading: Final = self.cell("reading", "B")
        self._owns: Final = self.cell("owns", "B")
        """Whether a transaction is open, that is, between Start and Stop. SCL then idles low."""
        self._stalled: Final = self.cell("stalled", "B")
        self._step: Final = self.slot("step", self._due)
        context.pins.watch(site.scl_pin, self._scl_changed)
        registers = I2cRegisters(self.rcv, self.trn, self.con, self.stat, self.add)
        self.slave: Final = I2cSlave(
            registers, interrupts.line(site.slave_irq), self.cell("slave.state", "B"), self.cell("slave.ten_bit", "B")
        )

    # -- lines -------------------------------------------------------------------------------------------------------

    def _edge(self, count: int) -> int:
        """Return the cycle that is `count` Tbrg after the start of the operation."""
        return self._begun.value + count * self._half_bit.value // 2

    def _device(self) -> I2cDevice | None:
        selected = self._selected.value
        return self.wire.devices.get(selected - 1) if selected else None

    def bits(self, cycle: int) -> int:
        """Return the levels of SDA and SCL while the module is on."""
        outside = self.context.pins.level[self.wire.port]
        scl, sda = self._own_levels(cycle)
        return outside & ((self.wire.scl if scl else 0) | (self.wire.sda if sda else 0))

    def _own_levels(self, cycle: int) -> tuple[int, int]:
        """Return the levels (SCL, SDA) driven by the master; 1 means released."""
        operation = self._operation.value
        if operation == _NONE or self._stalled.value or cycle < self._begun.value:
            return (0, 1) if self._owns.value else (1, 1)
        passed = ((cycle - self._begun.value) * 2 + 1) // self._half_bit.value  # inverse of `_edge`
        if operation == _START:
            return (1, int(passed < 1))
        if operation == _RESTART:
            return (int(passed >= 1), int(passed < 2))
        if operation == _STOP:
            return (int(passed >= 1), int(passed >= 2))
        bit = min(passed // 2, 8)
        if operation == _ACK:
            return (passed & 1, self.con["ACKDT"])
        wire = self._byte.value << 1 | 1 - self._ack.value
        return (passed & 1, wire >> 8 - bit & 1)

    def rises(self, mask: int, after: int, until: int) -> int:
        """Report no rising edges, because no other device is clocked by these pins."""
        return 0

    def nth_rise(self, mask: int, after: int, count: int) -> int:
        """Report no rising edges, because no other device is clocked by these pins."""
        return NEVER

    def constant_until(self, cycle: int) -> int:
        """Return NEVER between operations, when the lines are constant; during one, `cycle` (no guarantee)."""
        return NEVER if self._operation.value == _NONE or self._stalled.value else cycle

    def changes(self, after: int, until: int) -> Iterable[tuple[int, int, int]]:
        """Return no edges, because the operations log them."""
        return ()

    def restored(self) -> None:
        """Attach the waveform to the pins if the module is on, otherwise detach it."""
        if self.con["I2CEN"]:
            self.context.pins.attach(self.wire.port, self.wire.sda | self.wire.scl, self)
        else:
            self.context.pins.detach(self.wire.port, self)

    # -- operations --------------------------------------------------------------------------------------------------

    def _con_written(self, old: int, new: int, _lanes: int) -> None:
        enable = 1 << self.context.chip.sfrs["I2CCON"].fields["I2CEN"][0]
        # UNVERIFIED: software can clear SCLREL only while STREN is set; §11 does not say when it may.
        if old & ~new & self._sclrel and not self.con["STREN"]:
            new |= self._sclrel
            self.con.value = new
        if (old ^ new) & enable:
            self._enabled(bool(new & enable))
        busy = self._operation.value != _NONE
        wanted = new & _SEQUENCE
        if not new & enable:
            self.con.value = new & ~_SEQUENCE
        elif busy:  # requests during a running operation are ignored (§11)
            self.con.value = new & ~_SEQUENCE | old & _SEQUENCE
        elif wanted:
            operation = next(op for op, name in _BITS.items() if self.con[name])
            self.con.value = new & ~_SEQUENCE
            self.con[_BITS[operation]] = 1
            self._begin(operation)
        self.slave.control_written(old, new)

    def _enabled(self, on: bool) -> None:
        """Handle a change of I2CEN: take or return the pins.

        If both lines are high, this counts as a Stop (§11; e-puck firmware needs it).
        """
        lines = self.wire.sda | self.wire.scl
        self._abort()
        self.slave.reset()
        for flag in ("S", "P", "TBF", "TRSTAT"):
            self.stat[flag] = 0
        if on:
            self._port.claim(lines, drive=False, level=0)
            self.stat["P"] = self.wire.sda_high and self.wire.scl_high
        else:
            self._port.release(lines)
        self.restored()

    def _invalidate_pins(self) -> None:
        self.context.pins.invalidate(self.wire.port)

    def _abort(self) -> None:
        self._operation.value = _NONE
        self._invalidate_pins()
        self._owns.value = self._stalled.value = 0
        self._begun.value = NEVER
        self.events.cancel(self._step)
        self._deselect()

    def _trn_written(self, _old: int, new: int, lanes: int) -> None:
        if not self.con["I2CEN"] or not lanes & 0xFF:
            return
        if self.slave.transmits:
            self.stat["TBF"] = 1
            return
        if self._operation.value != _NONE:
            self.stat["IWCOL"] = 1
            return
        self.stat["TBF"] = self.stat["TRSTAT"] = 1
        self._byte.value = new & 0xFF
        self._begin(_SEND)

    def _begin(self, operation: int) -> None:
        """Start an operation in the next cycle. A line that is held low from outside may end it immediately."""
        lines = self.wire
        self._invalidate_pins()
        self._operation.value = operation
        self._half_bit.value = self.brg.value + 1
        self._collides.value = 0
        if operation == _START and not (lines.sda_high and lines.scl_high):
            self._collision()
            return
        if not lines.scl_high:  # SCL is held low from outside
            self._stalled.value = 1
            return
        self._run(self.now + 1)

    def _run(self, cycle: int) -> None:
        device = self._device()
        if device is not None and self._operation.value in (_SEND, _RECEIVE):
            cycle += device.stretch(cycle)
        self._begun.value = cycle
        stuck = not self.wire.sda_high
        self._collides.value = self._first_collision() if stuck else 0
        self._ack.value = 0
        if self._operation.value == _RECEIVE and not self._collides.value:
            self._byte.value = 0 if stuck else self._read_from_slave(cycle)
        end = _EIGHTH_EDGE if self._operation.value == _SEND else _LENGTH[self._operation.value]
        end = self._collides.value - 1 if self._collides.value else end
        self.events.set(self._step, self._edge(end))
        self._log_edges(0, end)

    def _first_collision(self) -> int:
        """Return 1 + the Tbrg at which the module releases SDA but reads it low; 0 if this does not happen (§11)."""
        operation = self._operation.value
        if operation == _SEND:
            ones = [bit for bit in range(8) if self._byte.value >> 7 - bit & 1]
            return 1 + 2 * ones[0] + 1 if ones else 0
        if operation == _ACK:
            return 2 if self.con["ACKDT"] else 0
        return {_RESTART: 2, _STOP: 4}.get(operation, 0)

    def _read_from_slave(self, cycle: int) -> int:
        """Return the next byte from the addressed slave; 0xFF if no slave is addressed."""
        device = self._device()
        return device.read(cycle) & 0xFF if device is not None and self._reading.value else 0xFF

    def _deliver_byte(self, cycle: int) -> bool:
        """Deliver a complete byte to the addressed slave. Return whether the slave acknowledges it."""
        byte = self._byte.value
        if self._address_next.value:
            self._address_next.value = 0
            device = self.wire.devices.get(byte >> 1)
            if device is None or not device.start(bool(byte & 1), cycle):
                return False
            self._selected.value = 1 + (byte >> 1)
            self._reading.value = byte & 1
            return True
        device = self._device()
        return device is not None and not self._reading.value and device.write(byte, cycle)

    def _due(self, due: int) -> None:
        operation = self._operation.value
        if self._collides.value:
            self._collision()
        elif operation == _SEND and self.stat["TBF"]:
            self.stat["TBF"] = 0  # at the eighth falling edge; the operation ends at the ninth
            self._ack.value = not self.wire.sda_high or self._deliver_byte(due)
            self.events.set(self._step, self._edge(_LENGTH[_SEND]))
            self._log_edges(_EIGHTH_EDGE, _LENGTH[_SEND])
        else:
            self._finish(operation, due)

    def _finish(self, operation: int, due: int) -> None:
        self._operation.value = _NONE
        self._invalidate_pins()
        if operation in _BITS:
            self.con[_BITS[operation]] = 0
        if operation in (_START, _RESTART):
            self._deselect(due)
            self.stat["S"], self.stat["P"] = 1, 0
            self._address_next.value = self._owns.value = 1
        elif operation == _STOP:
            self._deselect(due)
            self.stat["S"], self.stat["P"] = 0, 1
            self._owns.value = 0
        elif operation == _SEND:
            self.stat["ACKSTAT"] = 1 - self._ack.value
            self.stat["TRSTAT"] = 0
            self.wire.pulses(9)
        elif operation == _RECEIVE:
            self._received(self._byte.value)
            self.wire.pulses(8)
        else:
            device = self._device()
            if device is not None:
                device.acknowledged(not self.con["ACKDT"], due)
            self.wire.pulses(1)
        self._line.request()

    def _received(self, byte: int) -> None:
        if self.stat["RBF"]:
            self.stat["I2COV"] = 1
            return
        self.rcv.value = byte
        self.stat["RBF"] = 1

    def _rcv_read(self) -> int:
        self.stat["RBF"] = 0
        return self.rcv.value

    def _deselect(self, cycle: int | None = None) -> None:
        device = self._device()
        self._selected.value = self._reading.value = self._address_next.value = 0
        if device is not None:
            device.stop(self.now if cycle is None else cycle)

    def _collision(self) -> None:
        """Handle a bus collision: set BCL and MI2CIF, release the lines, abort the operation (§11)."""
        operation = self._operation.value
        self._abort()
        if operation in _BITS:
            self.con[_BITS[operation]] = 0
        self.stat["TBF"] = self.stat["TRSTAT"] = 0
        self.stat["BCL"] = 1
        self._line.request()

    def _scl_changed(self, cycle: int, _changed: int, levels: int) -> None:
        """Continue a stalled operation after SCL is released."""
        if levels & self.wire.scl and self._stalled.value and not self.is_frozen:
            self._stalled.value = 0
            self._invalidate_pins()
            self._run(cycle + 1)

    def _log_edges(self, first: int, end: int) -> None:
        """Write the operation's edges, from Tbrg `first` on, to the log of pin changes."""
        pins, port, both = self.context.pins, self.wire.port, self.wire.sda | self.wire.scl
        if pins.edges is None:
            return
        for count in range(first, end):
            cycle = self._edge(count)
            pins.log_level(cycle, port, both, self.bits(cycle))

    # -- power and reset ---------------------------------------------------------------------------------------------

    def thaw(self, cycle: int) -> None:
        """Resume the clock. SCL may have been released while it was stopped."""
        super().thaw(cycle)
        self._scl_changed(cycle, 0, self.wire.scl if self.wire.scl_high else 0)

    def release_pins(self) -> None:
        """Release SDA and SCL to LAT and TRIS."""
        self._port.release(self.wire.sda | self.wire.scl)

    def reset(self, power_on: bool) -> None:
        """Reset to off. The port has already released the lines."""
        self._abort()
        self.slave.reset()
        self.restored()
