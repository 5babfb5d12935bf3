"""The ATmega328P as the debugger knows it: byte registers, a stack that grows downwards, avr-gcc's conventions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from emu.avr.core.addresses import ADDRESSES
from emu.avr.core.state import DATA_BYTES, FLASH_BYTES, RAM_START
from emu.avr.image import DATA_SPACE, EEPROM_SPACE, AvrImage
from emu.avr.isa.codec import decode
from emu.avr.isa.text import disassemble, target
from emu.avr.machine import VECTORS, Atmega328p
from emu.debug.avr.unwind import CALLS, REGISTERS, STACK_POINTER, AvrUnwinder, pair
from emu.debug.dwarf.location import ADDR_0
from emu.debug.dwarf.units import DebugInfo

if TYPE_CHECKING:
    from emu.debug.unwind import RawFrame

VECTOR_BYTES: Final = 4
"""Bytes of flash for each interrupt's vector."""
RETURN_BYTES: Final = 2
FIRST_REGISTER: Final = 0x20
"""Data address of the first I/O register."""


class Atmega328pProcessor:
    """`Processor` of a machine with an image."""

    register_names: Final = (*(f"R{number}" for number in range(STACK_POINTER)), "SP")
    stack_pointer: Final = STACK_POINTER
    status_register: Final = "SREG"
    symbol_prefix: Final = ""
    entry_is_frame_base: Final = False
    has_native_instruments: Final = False

    def __init__(self, image: AvrImage, machine: Atmega328p) -> None:
        assert len(self.register_names) == REGISTERS
        self._image: Final = image
        self._machine: Final = machine

    @cached_property
    def debug(self) -> DebugInfo:
        return DebugInfo(dict(self._image.debug_sections))

    @cached_property
    def handlers(self) -> frozenset[int]:
        places = [VECTOR_BYTES * number for number in range(1, len(VECTORS))]
        targets = [target(self._word(place), self._word(place + 2), place) for place in places]
        return frozenset([*places, *(one for one in targets if one is not None)])

    def _word(self, pc: int) -> int:
        flash = self._machine.state.flash
        return flash[pc] | flash[pc + 1] << 8 if 0 <= pc < FLASH_BYTES - 1 else 0

    def _byte(self, address: int) -> int | None:
        return self._machine.state.data[address] if RAM_START <= address < DATA_BYTES else None

    def is_code(self, pc: int) -> bool:
        return 0 <= pc < FLASH_BYTES and not pc & 1 and self._word(pc) != 0xFFFF

    @cached_property
    def _unwinder(self) -> AvrUnwinder:
        return AvrUnwinder(dict(self._image.debug_sections), self._word, self._byte, self.is_code, self.handlers)

    def register_size(self, number: int) -> int:
        return 2 if number == STACK_POINTER else 1

    def frames(
        self, pc: int, registers: tuple[int | None, ...], function_start: Callable[[int], int | None]
    ) -> list[RawFrame]:
        return self._unwinder.frames(pc, registers, function_start)

    def address_in(self, register: Callable[[int], int | None], number: int) -> int | None:
        return pair(register, number)

    def return_address(self, pc: int) -> int | None:
        insn = decode(self._word(pc), self._word(pc + 2))
        return pc + 2 * insn.row.words if insn is not None and insn.row.mnemonic in CALLS else None

    def instruction(self, pc: int) -> tuple[str, int] | None:
        first, second = self._word(pc), self._word(pc + 2)
        insn = decode(first, second)
        if insn is None:
            return None
        text, place = disassemble(first, second, pc), target(first, second, pc)
        name = self._image.symbols.text(place) if place is not None and self._image.symbols.code(place) else None
        return (f"{text} ; {name}" if name else text, insn.row.words)

    def has_left(self, stack: int, entry: int) -> bool:
        return stack >= entry

    def stack_at_entry(self, entry: int) -> int:
        return entry - RETURN_BYTES

    def stack_after_return(self, entry: int) -> int:
        return entry

    def stack_in_handler(self, before: int) -> int:
        return before - RETURN_BYTES

    def unreadable(self, code: bytes) -> str:
        address = int.from_bytes(code[1:], "little")
        if code[:1] != bytes(ADDR_0[:1]) or len(code) != len(ADDR_0) or DATA_SPACE <= address < EEPROM_SPACE:
            return ""
        return f"in {'flash' if address < DATA_SPACE else 'the EEPROM'}, which is not shown as a variable"

    def write(self, address: int, data: bytes) -> None:
        if FIRST_REGISTER <= address < RAM_START:
            raise ValueError(f"{address:#06x} is an I/O register, which only the program can set")
        if not 0 <= address <= address + len(data) <= DATA_BYTES:
            raise ValueError(f"{address:#06x} is not in data memory, which ends at 0x08ff")
        self._machine.poke_bytes(address, data)

    def register_groups(self) -> list[Mapping[str, Any]] | None:
        parts = [
            {"name": name, "path": name, "value": f"{self._machine.peek(address):#04x}", "address": f"{address:#06x}"}
            for name, address in ADDRESSES.items()
        ]
        return [{"name": "I/O registers", "path": "peripheral I/O registers", "parts": parts}]
