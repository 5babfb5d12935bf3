"""Entries of a call stack, and the registers and memory as visible from one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from emu.debug.dwarf.units import Scope
from emu.debug.processor import Processor
from emu.debug.unwind import RawFrame
from emu.image.lines import SourceLine

if TYPE_CHECKING:
    from emu.machine.machine import Machine


@dataclass(frozen=True, slots=True)
class Frame:
    """One entry of a call stack; lists begin with the innermost. An inlined function has its own entry."""

    pc: int
    """Address of the frame's next instruction; for a caller, the return address."""
    function: str
    """Name of the C or assembly function; its address if it has no name."""
    line: SourceLine | None
    kind: str
    """How the frame was entered: "call", "interrupt" (any exception) or "inlined"."""
    scopes: tuple[Scope, ...]
    """Nested scopes of this entry that contain `pc`, outermost first. Empty without debug information."""
    raw: RawFrame
    at: int
    """Address for the lookup of variables: `pc`, or for a caller an address inside its call instruction."""

    def __str__(self) -> str:
        where = f" ({self.line})" if self.line is not None else ""
        return f"{self.function}{where} at {self.pc:#08x}" + (f" [{self.kind}]" if self.kind != "call" else "")

    def __repr__(self) -> str:
        return f"<Frame {str(self)[:180]}>"


class FrameView:
    """`location.View` of one frame: the registers saved in it and the current memory."""

    def __init__(self, machine: Machine, processor: Processor, frame: Frame | None) -> None:
        self._machine: Final = machine
        self._processor: Final = processor
        self.frame: Final = frame
        top = self._processor.stack_pointer
        self._is_innermost: Final = frame is None or (
            frame.raw.pc == self._machine.pc and frame.raw.registers[top] == self._machine.w[top]
        )

    @property
    def pc(self) -> int:
        """Address for the lookup of variables. For a caller's frame it is inside the call instruction."""
        return self._machine.pc if self.frame is None else self.frame.at

    def register_size(self, number: int) -> int:
        """Return the size of a register in bytes."""
        return self._processor.register_size(number)

    def register_name(self, number: int) -> str:
        """Return the name of the register with a DWARF number."""
        names = self._processor.register_names
        return names[number] if number < len(names) else f"register {number}"

    def register(self, number: int) -> int | None:
        """Return the value of a register, None if it is unknown in this frame."""
        if number >= len(self._processor.register_names):
            return None
        if self.frame is None or self._is_innermost:
            return self._machine.w[number]
        return self.frame.raw.registers[number]

    def address_in(self, number: int) -> int | None:
        """Return the address that a register holds, None if it is unknown in this frame."""
        return self._processor.address_in(self.register, number)

    def set_register(self, number: int, value: int) -> None:
        """Set a register of the innermost frame. Raises ValueError for another frame."""
        if not self._is_innermost:
            raise ValueError("only registers of the innermost frame can be changed")
        self._machine.w[number] = value

    def memory(self, address: int, size: int) -> bytes:
        """Return bytes of data space. Raises ValueError."""
        return self._machine.peek_bytes(address, size)

    def set_memory(self, address: int, data: bytes) -> None:
        """Write bytes of data space; peripheral registers react as to an instruction. Raises ValueError."""
        self._processor.write(address, data)
