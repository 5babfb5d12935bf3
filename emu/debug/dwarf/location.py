"""DWARF location expressions: location of a variable and access to its bytes (DWARF 2 §2.4, some later operations).

Inputs: an expression and a `View` of registers and memory. Output: pieces through which the bytes are read or written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

LIT0, REG0, BREG0 = 0x30, 0x50, 0x70
FBREG: Final = 0x91
ADDR_0: Final = (0x03, 0, 0, 0, 0)
"""DWARF expression for address 0."""
REGISTERS: Final = 32
"""Number of registers that have their own DWARF operations."""
_BINARY: Final[dict[int, Callable[[int, int], int]]] = {
    0x22: lambda a, b: a + b,  # plus
    0x1C: lambda a, b: a - b,  # minus
    0x1E: lambda a, b: a * b,  # mul
    0x1A: lambda a, b: a & b,  # and
    0x21: lambda a, b: a | b,  # or
    0x27: lambda a, b: a ^ b,  # xor
    0x24: lambda a, b: a << (b & 63),  # shl
    0x25: lambda a, b: (a & 0xFFFFFFFF) >> (b & 63),  # shr
    0x26: lambda a, b: a >> (b & 63),  # shra
}
_FIXED: Final = {
    0x03: (4, False),  # addr
    0x08: (1, False),
    0x09: (1, True),
    0x0A: (2, False),
    0x0B: (2, True),
    0x0C: (4, False),
    0x0D: (4, True),
}
"""Size in bytes and signedness of constant operands, by operation."""


class View(Protocol):
    """Registers and memory as visible from one frame of a call stack."""

    def register_size(self, number: int) -> int:
        """Return the size of a register in bytes: 2 for W registers and stack pointers, 1 for others of an AVR."""

    def register_name(self, number: int) -> str:
        """Return the name of the register with a DWARF number."""

    def register(self, number: int) -> int | None:
        """Return the value of a register by its DWARF number, None if it is unknown in this frame."""

    def address_in(self, number: int) -> int | None:
        """Return the address that a register holds, on an AVR with the next register; None if it is unknown."""

    def set_register(self, number: int, value: int) -> None:
        """Set a register. Raises ValueError if this frame does not permit it."""

    def memory(self, address: int, size: int) -> bytes:
        """Return bytes of data space without side effects. Raises ValueError for unimplemented addresses."""

    def set_memory(self, address: int, data: bytes) -> None:
        """Write bytes of data space. Raises ValueError for addresses that cannot be written."""


class Unavailable(Exception):
    """The value is not available. The text gives the reason."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Part of a variable: in memory, in a register, or a known value. Size 0 means the rest of the variable."""

    kind: str
    """Kind of location: "memory", "register", "value", or "gone" for a part that was optimised out."""
    at: int
    size: int = 0
    data: bytes = b""
    skip: int = 0
    """1 if the part begins in the upper byte of its register, else 0."""


def pieces_of(code: bytes, view: View, frame_base: Callable[[], int]) -> tuple[Piece, ...]:
    """Return the pieces that a location expression describes. Raises Unavailable."""
    return _Evaluation(code, view, frame_base).run()


def address_of(pieces: tuple[Piece, ...]) -> int | None:
    """Return the data address of an object that lies entirely in memory, else None."""
    return pieces[0].at if len(pieces) == 1 and pieces[0].kind == "memory" else None


def read(pieces: tuple[Piece, ...], size: int, view: View) -> bytes:
    """Read `size` bytes from the pieces. Raises Unavailable."""
    data = b""
    for piece in pieces:
        wanted = piece.size or size - len(data)
        if piece.kind == "gone":
            raise Unavailable("partly optimised out" if len(pieces) > 1 else "optimised out")
        if piece.kind == "value":
            data += piece.data[:wanted].ljust(wanted, b"\0")
        elif piece.kind == "memory":
            try:
                data += view.memory(piece.at, wanted)
            except ValueError as error:
                raise Unavailable(str(error)) from None
        else:
            data += _registers(piece.at, piece.skip + wanted, view)[piece.skip :]
    return data[:size]


def _registers(number: int, size: int, view: View) -> bytes:
    """Return `size` bytes from a register and the following ones."""
    data = b""
    while len(data) < size:
        value = view.register(number)
        if value is None:
            raise Unavailable(f"{view.register_name(number)} of this frame is not known")
        data += value.to_bytes(view.register_size(number), "little")
        number += 1
    return data[:size]


def write(pieces: tuple[Piece, ...], data: bytes, view: View) -> None:
    """Write `data` to the pieces. Raises Unavailable, ValueError."""
    for piece in pieces:
        part, data = data[: piece.size or None], data[piece.size or len(data) :]
        if piece.kind == "memory":
            view.set_memory(piece.at, part)
        elif piece.kind == "register":
            if piece.skip:  # the lower byte keeps its value
                part = _registers(piece.at, 1, view) + part
            width = view.register_size(piece.at)
            for index in range(0, len(part), width):
                number = piece.at + index // width
                old = view.register(number)
                if old is None:
                    raise Unavailable(f"{view.register_name(number)} of this frame is not known")
                word = part[index : index + width]
                view.set_register(number, int.from_bytes(word, "little") | (old & 0xFF00 if len(word) == 1 else 0))
        else:
            raise Unavailable("it has a value but no place")


class _Evaluation:
    """One execution of the DWARF stack machine."""

    def __init__(self, code: bytes, view: View, frame_base: Callable[[], int]) -> None:
        self.code: Final = code
        self.view: Final = view
        self.frame_base: Final = frame_base
        self.at = 0
        self.stack: list[int] = []
        self.pieces: list[Piece] = []
        self.simple: Piece | None = None

    def run(self) -> tuple[Piece, ...]:
        while self.at < len(self.code):
            operation = self.code[self.at]
            self.at += 1
            self._do(operation)
        if self.simple is not None or self.stack:
            self.pieces.append(self._part(0))
        if not self.pieces:
            raise Unavailable("optimised out")
        return tuple(self.pieces)

    def _part(self, size: int) -> Piece:
        """Return the piece described by the operations since the previous piece."""
        if self.simple is not None:
            part, self.simple = self.simple, None
            return Piece(part.kind, part.at, size, part.data)
        if not self.stack:
            return Piece("gone", 0, size)
        return Piece("memory", self.stack.pop() & 0xFFFF, size)

    def _do(self, operation: int) -> None:
        stack = self.stack
        if operation in _FIXED:
            size, signed = _FIXED[operation]
            stack.append(int.from_bytes(self.code[self.at : self.at + size], "little", signed=signed))
            self.at += size
        elif LIT0 <= operation < LIT0 + REGISTERS:
            stack.append(operation - LIT0)
        elif REG0 <= operation < REG0 + REGISTERS:
            self.simple = Piece("register", operation - REG0)
        elif BREG0 <= operation < BREG0 + REGISTERS:
            stack.append(self._based(operation - BREG0))
        elif operation in _BINARY:
            b, a = stack.pop(), stack.pop()
            stack.append(_BINARY[operation](a, b))
        else:
            self._special(operation)

    def _special(self, operation: int) -> None:
        stack = self.stack
        match operation:
            case 0x23:  # plus_uconst
                stack.append(stack.pop() + self._leb(False))
            case 0x10 | 0x11:  # constu, consts
                stack.append(self._leb(operation == 0x11))
            case 0x90:  # regx
                self.simple = Piece("register", self._leb(False))
            case 0x92:  # bregx
                stack.append(self._based(self._leb(False)))
            case 0x91:  # fbreg
                stack.append(self.frame_base() + self._leb(True))
            case 0x9C:  # call_frame_cfa
                stack.append(self.frame_base())
            case 0x06:  # deref
                stack.append(int.from_bytes(self.view.memory(stack.pop() & 0xFFFF, 2), "little"))
            case 0x1F:  # neg
                stack.append(-stack.pop())
            case 0x20:  # not
                stack.append(~stack.pop())
            case 0x12:  # dup
                stack.append(stack[-1])
            case 0x13:  # drop
                stack.pop()
            case 0x16:  # swap
                stack[-1], stack[-2] = stack[-2], stack[-1]
            case 0x96:  # nop
                pass
            case 0x9F:  # stack_value
                self.simple = Piece("value", 0, data=(stack.pop() & (1 << 64) - 1).to_bytes(8, "little"))
            case 0x9E:  # implicit_value
                size = self._leb(False)
                self.simple = Piece("value", 0, data=self.code[self.at : self.at + size])
                self.at += size
            case 0x93:  # piece
                size = self._leb(False)
                self.pieces.append(self._part(size))
            case _:
                raise Unavailable(f"its place needs DWARF operation {operation:#04x}")

    def _based(self, number: int) -> int:
        offset = self._leb(True)
        value = self.view.address_in(number)
        if value is None:
            raise Unavailable(f"{self.view.register_name(number)} of this frame is not known")
        return value + offset

    def _leb(self, signed: bool) -> int:
        value = shift = 0
        while True:
            byte = self.code[self.at]
            self.at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                return value - (1 << shift) if signed and byte & 0x40 else value
