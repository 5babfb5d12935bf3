"""What the debugger must know of a processor and its compiler, beside the DWARF information of a program.

`Dspic30f` (dspic30f.py) and `Atmega328pProcessor` (avr/processor.py) implement it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from emu.debug.dwarf.units import DebugInfo
    from emu.debug.unwind import RawFrame


class Processor(Protocol):
    """Registers, call stacks and instructions of one machine. Code addresses are even: a program word spans two."""

    @property
    def register_names(self) -> tuple[str, ...]:
        """Names of the registers by DWARF number."""

    @property
    def stack_pointer(self) -> int:
        """DWARF number of the stack pointer."""

    @property
    def status_register(self) -> str:
        """Name of the register with the flags."""

    @property
    def symbol_prefix(self) -> str:
        """Prefix that the compiler adds to C names."""

    @property
    def entry_is_frame_base(self) -> bool:
        """Whether variables lie relative to `RawFrame.entry` and not to the DW_AT_frame_base of their function."""

    @property
    def has_native_instruments(self) -> bool:
        """Whether native code evaluates conditions and logs accesses; otherwise one data breakpoint sees changes."""

    @property
    def handlers(self) -> frozenset[int]:
        """Entry addresses of the exception handlers."""

    @property
    def debug(self) -> DebugInfo:
        """Functions, variables and types of the program."""

    def is_code(self, pc: int) -> bool:
        """Whether the program has an instruction at `pc`."""

    def register_size(self, number: int) -> int:
        """Return the size in bytes of the register with a DWARF number."""

    def frames(
        self, pc: int, registers: tuple[int | None, ...], function_start: Callable[[int], int | None]
    ) -> list[RawFrame]:
        """Return the physical frames of the call stack for a PC and register values, innermost first."""

    def address_in(self, register: Callable[[int], int | None], number: int) -> int | None:
        """Return the address in a register, whose value `register` returns; None if it is unknown."""

    def return_address(self, pc: int) -> int | None:
        """Return the address after the instruction at `pc` if it is a call, else None."""

    def instruction(self, pc: int) -> tuple[str, int] | None:
        """Return text and words of the instruction at `pc`, None if there is none."""

    def has_left(self, stack: int, entry: int) -> bool:
        """Whether the stack pointer shows that the function whose `RawFrame.entry` is `entry` has returned."""

    def stack_at_entry(self, entry: int) -> int:
        """Return the stack pointer at the first instruction of the function whose `RawFrame.entry` is `entry`."""

    def stack_after_return(self, entry: int) -> int:
        """Return the stack pointer after the return of the function whose `RawFrame.entry` is `entry`."""

    def stack_in_handler(self, before: int) -> int:
        """Return the stack pointer at the first instruction of a handler, from the one before its entry."""

    def unreadable(self, code: bytes) -> str:
        """Return why the object at a DWARF location is not in data memory; empty if it is."""

    def write(self, address: int, data: bytes) -> None:
        """Write bytes of data memory for the debugger's user. Raises ValueError for memory that cannot be written."""

    def register_groups(self) -> list[Mapping[str, Any]] | None:
        """Return the registers grouped by peripheral; None if the caller must take them from the chip's table."""


@runtime_checkable
class Debugged(Protocol):
    """A machine that brings its own processor."""

    def processor(self) -> Processor:
        """Return the processor of this machine."""
