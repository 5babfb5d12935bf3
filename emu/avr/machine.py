"""One ATmega328P with an image: run, read and write its memories, give inputs, take outputs, snapshot and restore.

    machine = Atmega328p(load_avr_image("firmware.elf"))
    machine.run_until(8_000_000)        # one second at 8 MHz
    machine.peek("counter", 2)

The same image, inputs and seed give the same run, cycle by cycle.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import (
    BOOKKEEPING,
    EEPROM_BYTES,
    FLASH_BYTES,
    INPUT_ROOM,
    LOG_ROOM,
    PROGRAM_ENTRIES,
    Avr,
    Decoded,
)
from emu.avr.image import AvrImage
from emu.avr.native import native
from emu.image.symbols import STOP_FUNCTION

HZ: Final = 8_000_000
"""Clock frequency in Hz of the internal oscillator."""
HALT: Final = 2
"""Result RUN_HALT of avr_run (core/interpreter.c)."""
INPUT_PIN, INPUT_UART, INPUT_ANALOG = 0, 1, 2
"""Kinds of input (core/avr.h). An analog input has the kind INPUT_ANALOG + channel."""
BOOT_START: Final = 0x3800
"""Word address of the 4 KB boot section (fuses BOOTSZ = 00)."""
SPL, UDR0 = ADDRESSES["SPL"], ADDRESSES["UDR0"]
_CHUNK: Final = 4_000_000
"""Maximum number of cycles per native call, because a call holds the GIL."""
_FAULTS: Final = {
    1: "illegal instruction {address:#06x}",
    2: "load from {address:#06x}, behind the end of RAM at 0x8ff",
    3: "store to {address:#06x}, behind the end of RAM at 0x8ff",
    4: "stack pointer {address:#06x} is outside RAM (0x100 to 0x8ff)",
    5: "execution ran past the end of flash",
    6: "read of flash at {address:#06x}, behind its end at 0x7fff",
    7: "interrupt {vector} has no handler; the program would start again",
}
"""Text of each kind of fault (core/avr.h)."""
VECTORS: Final = (
    "RESET", "INT0", "INT1", "PCINT0", "PCINT1", "PCINT2", "WDT", "TIMER2_COMPA", "TIMER2_COMPB", "TIMER2_OVF",
    "TIMER1_CAPT", "TIMER1_COMPA", "TIMER1_COMPB", "TIMER1_OVF", "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF",
    "SPI_STC", "USART_RX", "USART_UDRE", "USART_TX", "ADC", "EE_READY", "ANALOG_COMP", "TWI", "SPM_READY",
)  # fmt: skip
"""Names of the interrupts by vector, as avr-libc's <avr/interrupt.h> writes them."""
_CALLS: Final = ((0xFE0E, 0x940E, 2), (0xF000, 0xD000, 1), (0xFFFF, 0x9509, 1))
"""Mask, match and words of CALL, RCALL and ICALL."""
_STACK_SEARCHED: Final = 64
"""Bytes of the stack in which a return address is searched."""


class Program:
    """Decoded flash. Machines with equal flash may share one."""

    def __init__(self) -> None:
        self.code: Final = (Decoded * PROGRAM_ENTRIES)()
        self.address: Final = ctypes.addressof(self.code)


@dataclass(frozen=True, slots=True)
class AvrFault:
    """A fault of the firmware: what happened, and the byte address of the instruction."""

    message: str
    pc: int
    cycle: int


@dataclass(frozen=True, slots=True)
class Change:
    """A watched register got another value at `cycle`. A byte that the UART has sent is a change of UDR0.

    A jump to address 0 is a change of RESTARTED (core/state.py).
    """

    cycle: int
    register: int
    value: int


class Atmega328p:
    """A microcontroller at its reset vector. `program`: decoded image to share, of a machine with the same image.

    `seed` selects the noise of analog inputs, any integer.
    """

    def __init__(self, image: AvrImage, *, seed: int = 1, program: Program | None = None) -> None:
        self.image: Final = image
        self.state: Final = Avr()
        self._address: Final = ctypes.addressof(self.state)
        self._native: Final = native()
        self._run: Final = self._native["avr_run"]
        ctypes.memmove(self.state.flash, image.flash, FLASH_BYTES)
        ctypes.memset(self.state.eeprom, 0xFF, EEPROM_BYTES)
        for address, octet in image.eeprom.items():
            self.state.eeprom[address] = octet
        self.state.boot_start = BOOT_START
        self.state.avcc_uv = self.state.aref_uv = 3_300_000
        self.state.random = (seed * 2_654_435_761 & 0xFFFF_FFFF) or 1
        end = image.symbols.find("_end")
        self.state.data_end = end.address - 1 if end is not None and end.space == "data" else 0
        stop = image.symbols.find(STOP_FUNCTION)
        self._kernel_stop: Final = range(stop.address // 2, (stop.address + stop.size) // 2) if stop else range(0)
        """Word addresses of the kernel's function for a fatal stop."""
        self.changes: Final[list[Change]] = []
        """Outputs since the caller cleared the list."""
        self._native["avr_power_on"](self._address)
        self.program = program or self._decoded()

    def _decoded(self) -> Program:
        program = Program()
        self._native["avr_decode"](self._address, program.address, 0, FLASH_BYTES // 2 - 1)
        return program

    def run_until(self, cycle: int) -> str:
        """Run up to a cycle. Return "limit", "fault", or "halt" if nothing can wake the CPU before that.

        The last instruction may end a few cycles later.
        """
        while True:
            goal = min(cycle, self.state.cycle + _CHUNK)
            result = self._run(self._address, self.program.address, goal)
            if self.attend() is not None:
                return "fault"
            if result == HALT:
                return "halt"
            if self.state.cycle >= cycle:
                return "limit"

    def attend(self) -> AvrFault | None:
        """Take the outputs of native code into `changes`, decode changed flash, and return the fault, if any."""
        if self.state.log_count:
            self._take_log()
        if self.state.program_changed:
            self.state.program_changed = 0
            self.program = self._decoded()
        return self.fault

    def step(self) -> str:
        """Execute one instruction or enter an interrupt. Return as `run_until`."""
        return self.run_until(self.state.cycle + 1)

    def _take_log(self) -> None:
        state = self.state
        count = min(state.log_count, LOG_ROOM)
        self.changes.extend(map(Change, state.log_cycle[:count], state.log_register[:count], state.log_value[:count]))
        state.log_count = 0

    @property
    def cycle(self) -> int:
        """Return the CPU cycles since power-on."""
        return self.state.cycle

    @property
    def pc(self) -> int:
        """Return the byte address of the next instruction."""
        return 2 * self.state.pc

    @property
    def sp(self) -> int:
        """Return the stack pointer, which points to the next free byte."""
        return self.state.data[SPL] | self.state.data[SPL + 1] << 8

    @property
    def fault(self) -> AvrFault | None:
        """Return the fault that stopped the machine; a fatal stop of the kernel is one."""
        state = self.state
        if not state.fault:
            if state.halted and state.pc in self._kernel_stop:
                return AvrFault("the kernel stopped the system", 2 * state.pc, state.halted_at)
            return None
        address = state.fault_address
        text = _FAULTS[state.fault].format(address=address, vector=VECTORS[address % len(VECTORS)])
        return AvrFault(text, 2 * state.fault_pc, state.cycle)

    @property
    def stack_overflow(self) -> tuple[int, int] | None:
        """Return byte address and cycle of the first instruction by which the stack grew into the program's variables.

        None if that has not happened, or if the image does not define where they end (symbol `_end`).
        """
        state = self.state
        return (2 * state.overflow_pc, state.overflow_at) if state.overflow_at else None

    def caller(self) -> int | None:
        """Return the byte address of the call whose return address is uppermost on the stack, None if there is none.

        A number on the stack that looks like a return address can be mistaken for one.
        """
        stack = self.peek_bytes(self.sp + 1, _STACK_SEARCHED)
        for high, low in pairwise(stack):
            after = high << 8 | low
            for mask, match, words in _CALLS:
                at = 2 * (after - words)
                if 0 <= at < FLASH_BYTES and int.from_bytes(self.state.flash[at : at + 2], "little") & mask == match:
                    return at
        return None

    def watch(self, registers: Iterable[int]) -> None:
        """Report changes of I/O registers (data addresses) in `changes`."""
        for register in registers:
            self.state.watched[register] = 1

    def _resolved(self, place: str | int) -> int:
        if isinstance(place, int):
            return place
        symbol = self.image.symbols.find(place)
        if symbol is None or symbol.space != "data":
            raise KeyError(f"the image has no variable {place!r}")
        return symbol.address

    def peek(self, place: str | int, size: int = 1) -> int:
        """Return a little-endian number of data memory, by address or variable. Raises KeyError."""
        return int.from_bytes(self.peek_bytes(place, size), "little")

    def peek_bytes(self, place: str | int, count: int) -> bytes:
        """Return bytes of data memory as they are stored, without the effects of a read. Raises KeyError."""
        address = self._resolved(place)
        return bytes(self.state.data[address : address + count])

    def poke_bytes(self, place: str | int, octets: bytes) -> None:
        """Write bytes of data memory, without the effects of a write. Raises KeyError."""
        address = self._resolved(place)
        self.state.data[address : address + len(octets)] = list(octets)
        # Discard the repetition that the interpreter found in a wait loop: the written data may end the loop.
        self.state.tracing = self.state.round = self.state.resting = self.state.counts_until = 0

    def write_eeprom(self, address: int, octets: bytes) -> None:
        """Write bytes of the EEPROM. Raises ValueError if they are not within its 1,024 bytes."""
        if not 0 <= address <= EEPROM_BYTES - len(octets):
            raise ValueError(f"{len(octets)} bytes at {address:#x} are not in the EEPROM")
        self.state.eeprom[address : address + len(octets)] = list(octets)

    def give_input(self, cycle: int, kind: int, value: int) -> None:
        """Give an input as native code takes it (core/avr.h), from a cycle on. Raises ValueError if too many wait."""
        if self._native["avr_input"](self._address, cycle, kind, value):
            raise ValueError("too many inputs wait for their cycle")

    def set_pins(self, cycle: int, port: int, driven: int, levels: int) -> None:
        """Drive pins of port 0 (B), 1 (C) or 2 (D) from a cycle on; bits of `driven` that are 0 float."""
        self.give_input(cycle, INPUT_PIN, port << 16 | driven << 8 | levels)

    def set_analog(self, cycle: int, channel: int, microvolts: int) -> None:
        """Set the voltage of ADC channel 0 to 7, the temperature sensor (8), AIN0 (9) or AIN1 (10) from a cycle on."""
        self.give_input(cycle, INPUT_ANALOG + channel, microvolts)

    def receive(self, cycle: int, octet: int) -> None:
        """Let the UART receive a byte whose frame ends at a cycle."""
        self.give_input(cycle, INPUT_UART, octet)

    def apply_due(self) -> None:
        """Apply the events of devices that are due, which the next run would do first."""
        self._native["avr_apply_due"](self._address)

    def snapshot(self) -> bytes:
        """Return the whole state."""
        return bytes(self.state)

    def comparable_state(self) -> bytes:
        """Return the whole state without the interpreter's bookkeeping: equal for machines that behave equally."""
        state = Avr.from_buffer_copy(self.state)
        for name in BOOKKEEPING:
            field = getattr(Avr, name)
            ctypes.memset(ctypes.addressof(state) + field.offset, 0, field.size)
        waiting = [(one + state.input_first) % INPUT_ROOM for one in range(state.input_count)]
        for name in ("input_cycle", "input_kind", "input_value"):
            ring = getattr(state, name)
            ring[:] = [ring[one] for one in waiting] + [0] * (INPUT_ROOM - len(waiting))
        state.input_first = 0
        return bytes(state)

    def restore(self, snapshot: bytes) -> None:
        """Return to the state of a snapshot of this machine. Raises ValueError for other bytes."""
        if len(snapshot) != ctypes.sizeof(Avr):
            raise ValueError("these bytes are no snapshot of an ATmega328P")
        flash = bytes(self.state.flash)
        ctypes.memmove(self._address, snapshot, len(snapshot))
        if bytes(self.state.flash) != flash:
            self.program = self._decoded()
