"""Effective addresses and pointer updates: indirect, modulo and bit-reversed addressing, the stack (isa.md §3).

All addresses and pointer values passed to the builder are reduced modulo 2**16.
"""

from __future__ import annotations

from .builder import Builder, Side, Size
from .fields import Operands
from .flow import Value

INDIRECT, POST_DEC, POST_INC, PRE_DEC, PRE_INC, INDEXED = range(1, 7)  # isa.md §3.1; 0 is register direct
STACK_POINTER = 15


def signed16(m: Builder, v: Value) -> Value:
    """Return a 16-bit value as a signed number."""
    return m.let((v ^ 0x8000) - 0x8000)


def advance(m: Builder, n: int, value: Value, delta: Value, side: Side) -> Value:
    """Return the pointer ``value`` of Wn plus ``delta`` bytes, wrapped in the modulo buffer if Wn is selected for it
    (isa.md §3.6)."""
    c = m.context
    moved = value + delta
    if side == "y":
        enabled, first, last = bool(c.ymod and c.ywm == n), "YMODSRT", "YMODEND"
    else:
        reversed_writes = bool(side == "dst" and c.brev and c.bwm == n)  # takes precedence over modulo, isa.md §3.7
        enabled, first, last = bool(c.xmod and c.xwm == n and not reversed_writes), "XMODSRT", "XMODEND"
    if enabled:
        start, end = m.reg(first), m.reg(last)
        length = m.let(end - start + 1)
        moved = m.let(moved)
        above = (delta > 0) & (moved > end)
        below = (delta < 0) & (moved < start)
        moved = m.select(above, moved - length, m.select(below, moved + length, moved))
    return m.let(moved & 0xFFFF)


def reverse_carry(m: Builder, value: Value, modifier: Value) -> Value:
    """Return ``value``<15:1> + ``modifier``<14:0> with reversed carry; bit 0 is kept (isa.md §3.7)."""
    total = bit_reverse16(m, value & 0xFFFE) + bit_reverse16(m, (modifier << 1) & 0xFFFE)
    return m.let(bit_reverse16(m, total & 0x7FFF) | (value & 1))


def bit_reverse16(m: Builder, v: Value) -> Value:
    """Return a 16-bit value with its bits in reversed order."""
    for width, mask in ((1, 0x5555), (2, 0x3333), (4, 0x0F0F), (8, 0x00FF)):
        v = m.let((v >> width) & mask | (v & mask) << width)
    return v


def indirect(
    m: Builder, n: int, mode: int, step: int, side: Side, index: int | None = None, reversible: bool = False
) -> tuple[Value, Value | None]:
    """Return the EA of Wn in an indirect ``mode``, and the new pointer; None if the pointer does not change.

    ``step`` is the access size in bytes, ``index`` the register Wb of [Wn+Wb]. ``reversible`` marks a word write, the
    only access to which bit-reversed addressing applies.
    """
    value = m.ptr(n, side)
    if mode == INDIRECT:
        return value, None
    if mode >= INDEXED:  # UNVERIFIED: code 7 acts as 6 (isa.md §3.1)
        assert index is not None
        return advance(m, n, value, signed16(m, m.ptr(index, side)), side), None
    c = m.context
    if reversible and mode in (POST_INC, PRE_INC) and c.brev and c.bwm == n:
        moved = reverse_carry(m, value, m.reg("XBREV"))
    else:
        moved = advance(m, n, value, step if mode in (POST_INC, PRE_INC) else -step, side)
    return (moved if mode in (PRE_DEC, PRE_INC) else value), moved


def offset_address(m: Builder, n: int, offset: int, side: Side) -> Value:
    """Return the EA of [Wn+lit].

    UNVERIFIED: modulo addressing does not apply to literal offsets (isa.md §3.6 names only [Wn+Wb]).
    """
    return m.let((m.ptr(n, side) + offset) & 0xFFFF)


def truncated(v: Value, size: Size) -> Value:
    """Return the low ``size`` bytes of a value."""
    return v & (0xFF if size == 1 else 0xFFFF)


def set_register(m: Builder, n: int, v: Value, size: Size) -> None:
    """Write Wn; with size 1 only its low byte (isa.md §2.2)."""
    if size == 1:
        m.set_wb(n, v)
    else:
        m.set_w(n, v)


def size_of(x: Operands) -> Size:
    """Return the access size in bytes that field B selects."""
    return 1 if x.B else 2


class Location:
    """Location of an operand after its address is formed. Later phases of a row ``read`` and ``write`` it.

    A direct register is read immediately, before any pointer changes, so that the operand is the old value (isa.md
    §3.4). A destination pointer is updated by the write, after all reads.
    """

    __slots__ = ("ea", "held", "m", "moved", "register", "size")

    def __init__(
        self, m: Builder, register: int, size: Size, ea: Value | None = None, moved: Value | None = None
    ) -> None:
        self.m = m
        self.register = register
        self.size = size
        self.ea = ea
        self.moved = moved
        self.held: Value = None

    def read(self) -> Value:
        """Return the operand, zero-extended."""
        return self.held if self.ea is None else self.m.load(self.ea, self.size, ptr=self.register)

    def write(self, v: Value) -> None:
        """Store the low bits of ``v``. A byte write to a direct register keeps the high byte."""
        if self.ea is None:
            set_register(self.m, self.register, v, self.size)
            return
        self.move_pointer()
        self.m.store(self.ea, v, self.size, ptr=self.register)

    def move_pointer(self) -> None:
        """Apply the ++ or -- of a destination pointer; source pointers are already updated."""
        if self.moved is not None:
            self.m.set_ptr(self.register, self.moved, "dst")


def source(m: Builder, x: Operands, size: Size, mode: int | None = None) -> Location:
    """Return the location of Ws in mode ``p``, or in ``mode`` of the 8-mode set with index Wb. Update its pointer now.

    UNVERIFIED: if the pointer points to its own data address, the new value is read.
    """
    mode = x.p if mode is None else mode
    if mode == 0:
        place = Location(m, x.s, size)
        place.held = truncated(m.w(x.s), size)
        return place
    ea, moved = indirect(m, x.s, mode, size, "src", x.w if mode >= INDEXED else None)
    if moved is not None:
        m.set_ptr(x.s, moved, "src")
    return Location(m, x.s, size, ea)


def destination(m: Builder, x: Operands, size: Size, mode: int | None = None) -> Location:
    """Return the location of Wd in mode ``q``, or in ``mode`` of the 8-mode set, for a write only.

    Call it after ``source``, so that it uses the updated source pointer.
    """
    mode = x.q if mode is None else mode
    if mode == 0:
        return Location(m, x.d, size)
    index = x.w if mode >= INDEXED else None
    return Location(m, x.d, size, *indirect(m, x.d, mode, size, "dst", index, reversible=size == 2))


def push(m: Builder, *values: Value) -> None:
    """Store words at [W15++] (isa.md §3.5)."""
    top = m.ptr(STACK_POINTER, "dst")
    m.set_ptr(STACK_POINTER, (top + 2 * len(values)) & 0xFFFF, "dst")
    for i, value in enumerate(values):
        m.store((top + 2 * i) & 0xFFFF, value, 2, ptr=STACK_POINTER)


def pop_addresses(m: Builder, count: int) -> list[Value]:
    """Lower W15 by ``count`` words. Return the addresses of the popped words, lowest first."""
    top = m.ptr(STACK_POINTER, "src")
    m.set_ptr(STACK_POINTER, (top - 2 * count) & 0xFFFF, "src")
    return [(top - 2 * (count - i)) & 0xFFFF for i in range(count)]
