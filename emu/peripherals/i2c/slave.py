"""The I2C module as slave (§11), and an external master that accesses it.

All effects occur at the ninth falling clock edge of a byte: address match, acknowledge, flags, SI2CIF.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from emu.peripherals.base import StateCell
from emu.system.device import Irq, Register
from emu.system.events import Events

_IDLE, _ADDRESS, _LOW_ADDRESS, _RECEIVING, _TRANSMITTING = range(5)
_TEN_BIT: Final = 0b11110
"""Fixed upper bits in the first byte of a 10-bit address."""


@dataclass(frozen=True, slots=True)
class I2cRegisters:
    """Registers shared by the module's master half and slave half."""

    rcv: Register
    trn: Register
    con: Register
    stat: Register
    add: Register


class I2cSlave:
    """The I2C module's slave half, which handles bytes from an external master."""

    def __init__(self, registers: I2cRegisters, line: Irq, state: StateCell, ten_bit: StateCell) -> None:
        self._r: Final = registers
        self._line: Final = line
        self._state: Final = state
        self._ten_bit: Final = ten_bit
        """Whether the 10-bit address has matched in this transaction; a repeated Start may then begin a read."""
        self.on_release: Callable[[], None] | None = None
        """Called when SCLREL is set, after which the external master may continue."""

    @property
    def is_enabled(self) -> bool:
        """Whether I2CEN is set."""
        return bool(self._r.con["I2CEN"])

    @property
    def transmits(self) -> bool:
        """Whether a master reads from this module; a write to I2CTRN then loads the byte to send."""
        return self._state.value == _TRANSMITTING

    @property
    def stretches(self) -> bool:
        """Whether the module stretches the clock, that is, holds SCL low until software sets SCLREL."""
        return self._state.value != _IDLE and not self._r.con["SCLREL"]

    def reset(self) -> None:
        """Return to the idle state, in which the module is not addressed."""
        self._state.value = _IDLE
        self._ten_bit.value = 0

    def control_written(self, old: int, _new: int) -> None:
        """Handle a write to I2CCON. A change of SCLREL from 0 to 1 releases the clock."""
        con = self._r.con
        was_released = old >> 12 & 1
        if not was_released and con["SCLREL"] and self.on_release is not None:
            self.on_release()

    # -- actions of the external master ------------------------------------------------------------------------------

    def start(self) -> None:
        """Handle a Start or repeated Start condition."""
        if self.is_enabled:
            self._state.value = _ADDRESS
            self._r.stat["S"], self._r.stat["P"] = 1, 0

    def stop(self) -> None:
        """Handle a Stop condition."""
        self.reset()
        if not self.is_enabled:
            return
        stat = self._r.stat
        stat["S"], stat["P"] = 0, 1
        stat["GCSTAT"] = stat["ADD10"] = 0

    def byte(self, value: int) -> bool:
        """Handle a byte from the master. Return whether the module acknowledges it."""
        state = self._state.value
        if state == _ADDRESS:
            return self._first_byte(value)
        if state == _LOW_ADDRESS:
            return self._second_byte(value)
        if state == _RECEIVING:
            return self._store_received(value, data=True)
        return False

    def answer(self) -> int:
        """Return the byte that the module sends. Software has loaded it and set SCLREL."""
        self._r.stat["TBF"] = 0
        return self._r.trn.value & 0xFF

    def answered(self, more: bool) -> None:
        """Handle the master's ACK (`more` is true) or NACK of a sent byte.

        After an ACK, the module stretches the clock.
        """
        self._r.stat["ACKSTAT"] = not more
        if more:
            self._r.con["SCLREL"] = 0
        else:
            self._state.value = _ADDRESS
        self._line.request()

    # -- addresses and data ------------------------------------------------------------------------------------------

    def _first_byte(self, value: int) -> bool:
        con, stat, address = self._r.con, self._r.stat, self._r.add.value
        read = value & 1
        general = bool(con["GCEN"]) and value == 0
        if con["A10M"] and not general and not con["IPMIEN"]:
            return self._ten_bit_first(value)
        if not (general or con["IPMIEN"] or value >> 1 == address & 0x7F):
            self._state.value = _IDLE
            return False
        stat["GCSTAT"] = general
        return self._addressed(value, read)

    def _ten_bit_first(self, value: int) -> bool:
        matches = value >> 3 == _TEN_BIT and value >> 1 & 3 == self._r.add.value >> 8
        if matches and value & 1 and self._ten_bit.value:
            return self._addressed(value, 1)
        self._state.value = _LOW_ADDRESS if matches and not value & 1 else _IDLE
        return matches and not value & 1

    def _second_byte(self, value: int) -> bool:
        if value != self._r.add.value & 0xFF:
            self._state.value = _IDLE
            return False
        self._ten_bit.value = 1
        self._r.stat["ADD10"] = 1
        return self._addressed(value, 0)

    def _addressed(self, value: int, read: int) -> bool:
        stat = self._r.stat
        stat["R_NOT_W"] = read
        acknowledged = self._store_received(value, data=False)
        self._state.value = _TRANSMITTING if read else _RECEIVING
        if read:
            self._r.con["SCLREL"] = 0
        return acknowledged

    def _store_received(self, value: int, data: bool) -> bool:
        """Store a byte in I2CRCV. Return False if the register is full or an overflow is pending (§11)."""
        stat = self._r.stat
        stat["D_NOT_A"] = data
        accepted = not stat["RBF"] and not stat["I2COV"]
        if accepted:
            self._r.rcv.value = value
            stat["RBF"] = 1
            if self._r.con["STREN"]:
                self._r.con["SCLREL"] = 0
        else:
            stat["I2COV"] = 1
        self._line.request()
        return accepted


@dataclass
class Transfer:
    """Result of an external master's transfer: acknowledge bits, bytes read, and whether the transfer has ended."""

    acknowledged: list[bool] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    done: bool = False


class ExternalMaster:
    """External master on the bus, for tests and for extension boards that poll the dsPIC.

    Snapshots do not contain its state.
    """

    def __init__(self, slave: I2cSlave, events: Events, bit_tcy: int = 151) -> None:
        self._slave: Final = slave
        self._events: Final = events
        self._bit: Final = bit_tcy
        self._slot: Final = events.slot("i2c.external", self._due)
        self._script: Final[list[Callable[[], bool]]] = []
        self._transfer = Transfer()
        slave.on_release = self._resume

    def transfer(self, first: list[int], read_first: list[int] | None = None, count: int = 0) -> Transfer:
        """Start a transfer and return its result object.

        The master sends `first`. With `read_first`, it repeats the Start, sends `read_first` and reads `count` bytes.
        Then it sends Stop.
        """
        self._transfer = result = Transfer()
        self._script.clear()
        self._script.append(self._start)
        self._script.extend(partial(self._send, byte) for byte in first)
        if read_first is not None:
            self._script.append(self._start)
            self._script.extend(partial(self._send, byte) for byte in read_first)
            self._script.extend(partial(self._read, index == count - 1) for index in range(count))
        self._script.append(self._stop)
        self._events.set(self._slot, self._events.now + 1)
        return result

    def _due(self, due: int) -> None:
        if self._slave.stretches:
            return  # `_resume` continues the transfer when the slave releases the clock
        if self._script:
            takes_bits = self._script.pop(0)()
            if self._script or not self._transfer.done:
                self._events.set(self._slot, due + self._bit * (9 if takes_bits else 1))

    def _resume(self) -> None:
        if self._script:
            self._events.set(self._slot, self._events.now + 1 + 9 * self._bit)

    def _start(self) -> bool:
        self._slave.start()
        return True

    def _send(self, byte: int) -> bool:
        self._transfer.acknowledged.append(self._slave.byte(byte))
        return len(self._script) > 1

    def _read(self, last: bool) -> bool:
        self._transfer.received.append(self._slave.answer())
        self._slave.answered(more=not last)
        return not last

    def _stop(self) -> bool:
        self._slave.stop()
        self._transfer.done = True
        return False
