"""The builder contract: operations that a row's function ``does`` may use, on plain ints or LLVM values.

A value is an exact integer, |v| < 2**62. Rows use + - * & | ^ ~ << >> (arithmetic) and the comparisons, which yield
0 or 1; never ``if``, ``and``, ``not`` on a value. Operand fields and ``context`` are ints known at translation time.
A row has these phases:

1. read register operands;
2. form every effective address; source pointers are updated here;
3. load;
4. compute;
5. update destination pointers, store, write registers.

So a builder can check all addresses before it commits any effect except source pointers, and reads see the registers
as they were before the destination side changes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

from .flow import Value

Side = Literal["src", "dst", "x", "y"]  # address generator: read, write, X prefetch of MAC, Y prefetch of MAC
Size = Literal[1, 2]


@dataclass(frozen=True, slots=True)
class Context:
    """Processor modes that a translation may treat as constants (isa.md §2.4, §2.5, §14.4)."""

    us: int = 0  # 1: DSP multiplies are unsigned
    if_: int = 0  # 1: DSP multiplies are integer, else fractional
    rnd: int = 0  # 1: conventional rounding, else convergent
    satdw: int = 1  # 1: accumulator stores saturate
    sata: int = 0
    satb: int = 0
    accsat: int = 0  # 1: accumulators saturate in 9.31 format, else 1.31
    psv: int = 0
    xmod: int = 0  # modulo addressing enabled for X and Y
    ymod: int = 0
    brev: int = 0
    xwm: int = 15  # registers selected by MODCON; 15 means none
    ywm: int = 15
    bwm: int = 15
    ovate: int = 0  # enables of the accumulator overflow traps
    ovbte: int = 0
    covte: int = 0


class Builder(Protocol):
    """Operations of which a row of the instruction table builds its semantics. README.md defines their order."""

    context: Context
    pc: int  # program address of this instruction

    def select(self, c: Value, a: Value, b: Value) -> Value:
        """Return ``a`` if ``c`` is not 0, else ``b``; both are always computed."""

    def div_trunc(self, a: Value, b: Value) -> Value:
        """Return the quotient rounded towards zero; 0 if ``b`` is 0."""

    def rem_trunc(self, a: Value, b: Value) -> Value:
        """Return the remainder, which has the sign of ``a``; 0 if ``b`` is 0."""

    def clz16(self, v: Value) -> Value:
        """Return the number of leading zeros of a 16-bit value; 16 for 0."""

    def ctz16(self, v: Value) -> Value:
        """Return the number of trailing zeros of a 16-bit value; 16 for 0."""

    def let(self, v: Value) -> Value:
        """Return a value that can be used several times but is computed only once."""

    def w(self, n: int) -> Value:
        """Return Wn as data, 0..65535."""

    def set_w(self, n: int, v: Value) -> None:
        """Write the low 16 bits of ``v`` to Wn and mark Wn initialised. May cause a RAW stall (isa.md §13.2)."""

    def set_wb(self, n: int, v: Value) -> None:
        """Write the low 8 bits of ``v`` to the low byte of Wn. May cause a RAW stall."""

    def ptr(self, n: int, side: Side) -> Value:
        """Return Wn as address pointer or pointer offset, 0..65535. An uninitialised register resets the device."""

    def set_ptr(self, n: int, v: Value, side: Side) -> None:
        """Set the pointer Wn to the low 16 bits of ``v``. Only side ``dst`` may cause a RAW stall."""

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        """Read 1 or 2 bytes of data space.

        ``ptr`` is the W register that holds the address. A static int is a file address.
        """

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        """Write the low 8 or 16 bits of ``v`` to data space."""

    def xload(self, ea: Value, ptr: int) -> Value:
        """Return the word of a MAC X prefetch, from X data space or the PSV window; 0 from Y RAM (isa.md §1.2)."""

    def yload(self, ea: Value, ptr: int) -> Value:
        """Return the word of a MAC Y prefetch, from Y RAM; 0 from any other address."""

    def prog(self, address: Value) -> Value:
        """Return the 24-bit program word at an even 24-bit table address (isa.md §7.7)."""

    def table_write(self, address: Value, byte_mask: Value, v: Value) -> None:
        """Merge the 24-bit ``v`` into the programming latch of ``address``; bit i of ``byte_mask`` selects byte i."""

    def flag(self, name: str) -> Value:
        """Return an SR bit, 0 or 1: C Z OV N DC OA OB SA SB."""

    def set_flags(self, **flags: Value) -> None:
        """Write the named SR bits, and update OAB and SAB accordingly."""

    def reg(self, name: str) -> Value:
        """Return a core register by name.

        Names are RCOUNT TBLPAG XMODSRT XMODEND YMODSRT YMODEND XBREV, and the PUSH.S shadows W0S W1S W2S W3S SRS
        (isa.md §2.6).
        """

    def set_reg(self, name: str, v: Value) -> None:
        """Write a core register by name, as in ``reg``."""

    def acc(self, i: int) -> Value:
        """Return accumulator A (0) or B (1) as a signed 40-bit value."""

    def set_acc(self, i: int, v: Value) -> None:
        """Write a signed 40-bit value to an accumulator."""

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        """Run ``fn`` only if ``c`` is not 0."""

    def trap_math(self, c: Value) -> None:
        """Request a math error trap if ``c`` is not 0 (isa.md §14.4)."""
