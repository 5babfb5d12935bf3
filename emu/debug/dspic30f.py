"""The dsPIC30F as the debugger knows it: W registers, a stack that grows upwards, four bytes per return address."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from emu.debug.disassembly import instruction
from emu.debug.dwarf.units import DebugInfo, debug_of
from emu.debug.unwind import REGISTERS, RETURN_BYTES, CodeAnalysis, RawFrame, Unwinder
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.facts import facts_of
from emu.dspic30f.isa.flow import Call
from emu.dspic30f.state.state import STACK_POINTER
from emu.image.model import Image

if TYPE_CHECKING:
    from emu.machine.machine import Machine

EXCEPTION_FRAME_BYTES: Final = 4
"""Number of bytes that interrupt entry pushes onto the stack."""


class Dspic30f:
    """`Processor` of a machine with an image. Raises ValueError if no image is loaded."""

    register_names: Final = tuple(f"W{number}" for number in range(REGISTERS))
    stack_pointer: Final = STACK_POINTER
    status_register: Final = "SR"
    symbol_prefix: Final = "_"
    entry_is_frame_base: Final = True
    has_native_instruments: Final = True

    def __init__(self, machine: Machine) -> None:
        if machine.image is None:
            raise ValueError("nothing is loaded")
        self._machine: Final = machine
        self._image: Final[Image] = machine.image
        self._starts: Final = [block.base for block in self._image.blocks if block.is_code]
        self._ends: Final = [block.end for block in self._image.blocks if block.is_code]
        self._unwinder: Unwinder | None = None

    @property
    def debug(self) -> DebugInfo:
        return debug_of(self._image)

    @cached_property
    def handlers(self) -> frozenset[int]:
        vectors = self._image.chip.vectors
        targets = {self._image.word(table) for vector in vectors for table in (vector.ivt, vector.aivt)}
        return frozenset(target for target in targets if target is not None)

    def is_code(self, pc: int) -> bool:
        index = bisect_right(self._starts, pc) - 1
        return index >= 0 and pc < self._ends[index]

    def register_size(self, number: int) -> int:
        return 2

    def frames(
        self, pc: int, registers: tuple[int | None, ...], function_start: Callable[[int], int | None]
    ) -> list[RawFrame]:
        if self._unwinder is None:
            analysis = CodeAnalysis(self._machine.program.word, self.is_code)
            self._unwinder = Unwinder(analysis, function_start, self.handlers)
        return self._unwinder.frames(pc, registers, self._ram_word)

    def _ram_word(self, address: int) -> int | None:
        ram = self._image.chip.data["ram"]
        return self._machine.record.u16[address >> 1] if ram.start <= address < ram.end else None

    def address_in(self, register: Callable[[int], int | None], number: int) -> int | None:
        return register(number)

    def return_address(self, pc: int) -> int | None:
        word = self._machine.program.word
        insn = decode_for_execution(word(pc), word(pc + 2))
        return pc + 2 * insn.words if insn is not None and facts_of(insn).flow is Call else None

    def instruction(self, pc: int) -> tuple[str, int] | None:
        word = self._machine.program.word
        item = instruction(self._image, pc, word(pc), word(pc + 2))
        return (item.text, len(item.words)) if item is not None else None

    def has_left(self, stack: int, entry: int) -> bool:
        return stack < entry

    def stack_at_entry(self, entry: int) -> int:
        return entry

    def stack_after_return(self, entry: int) -> int:
        return entry - RETURN_BYTES

    def stack_in_handler(self, before: int) -> int:
        return before + EXCEPTION_FRAME_BYTES

    def unreadable(self, code: bytes) -> str:
        return ""

    def write(self, address: int, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        if address < self._machine.bus.end and len(data) <= 2:
            self._machine.write(address, value, len(data))
        else:
            self._machine.poke(address, value, len(data))

    def register_groups(self) -> list[Mapping[str, Any]] | None:
        return None
