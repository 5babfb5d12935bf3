"""The builder contract: operations that the function ``does`` of a row may use, on plain ints or LLVM values.

A value is an exact integer, |v| < 2**62. Rows use + - * & | ^ ~ << >> (arithmetic) and the comparisons, which yield
0 or 1; never ``if``, ``and``, ``not`` on a value. Operand fields and ``context`` are static: ints at translation time.
Phases of a row: read register operands; form every effective address (source pointers move here); load; compute; move
destination pointers, store, write registers. So a builder may check all addresses before it commits any effect but
source pointers, and reads see registers as they were before the destination side acts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

from .flow import Value

Side = Literal["src", "dst", "x", "y"]  # which address generator: read, write, MAC X prefetch, MAC Y prefetch
Size = Literal[1, 2]


@dataclass(frozen=True, slots=True)
class Context:
    """Processor modes that a translation may treat as constants (isa.md §2.4, §2.5, §14.4)."""

    us: int = 0  # DSP multiply unsigned
    if_: int = 0  # DSP multiply integer
    rnd: int = 0  # conventional rounding
    satdw: int = 1  # saturate accumulator stores
    sata: int = 0
    satb: int = 0
    accsat: int = 0  # 9.31 saturation
    psv: int = 0
    xmod: int = 0  # modulo enables
    ymod: int = 0
    brev: int = 0
    xwm: int = 15  # registers selected by MODCON; 15 = none
    ywm: int = 15
    bwm: int = 15
    ovate: int = 0  # accumulator overflow trap enables
    ovbte: int = 0
    covte: int = 0


class Builder(Protocol):
    """Operations of a row. README.md of this folder defines their order."""

    context: Context
    pc: int  # program address of this instruction

    def select(self, c: Value, a: Value, b: Value) -> Value:
        """Return ``a`` if ``c`` else ``b``; both are computed."""

    def div_trunc(self, a: Value, b: Value) -> Value:
        """Quotient towards zero; 0 if ``b`` is 0."""

    def rem_trunc(self, a: Value, b: Value) -> Value:
        """Remainder with the sign of ``a``; 0 if ``b`` is 0."""

    def clz16(self, v: Value) -> Value:
        """Leading zeros of a 16-bit value; 16 for 0."""

    def ctz16(self, v: Value) -> Value:
        """Trailing zeros of a 16-bit value; 16 for 0."""

    def let(self, v: Value) -> Value:
        """Return a value that may be used more than once without being computed again."""

    def w(self, n: int) -> Value:
        """Wn as data, 0..65535."""

    def set_w(self, n: int, v: Value) -> None:
        """Write the low 16 bits of ``v`` to Wn: marks it initialised; a RAW stall source (isa.md §13.2)."""

    def set_wb(self, n: int, v: Value) -> None:
        """Write the low 8 bits of ``v`` to the low byte of Wn; a RAW stall source."""

    def ptr(self, n: int, side: Side) -> Value:
        """Wn as address pointer or pointer offset, 0..65535; an uninitialised register resets the device."""

    def set_ptr(self, n: int, v: Value, side: Side) -> None:
        """Pointer update, low 16 bits of ``v``; a RAW stall source on the ``dst`` side only."""

    def load(self, ea: Value, size: Size, side: Side = "src", ptr: int | None = None) -> Value:
        """Data read of 1 or 2 bytes. ``ptr`` is the W register that holds the address. A static int is a file
        address."""

    def store(self, ea: Value, v: Value, size: Size, ptr: int | None = None) -> None:
        """Data write of the low 8 or 16 bits of ``v``."""

    def xload(self, ea: Value, ptr: int) -> Value:
        """MAC X prefetch: a word of X data space or the PSV window; 0 from Y RAM (isa.md §1.2)."""

    def yload(self, ea: Value, ptr: int) -> Value:
        """MAC Y prefetch: a word of Y RAM; 0 from elsewhere."""

    def prog(self, address: Value) -> Value:
        """The 24-bit program word at an even 24-bit table address (isa.md §7.7)."""

    def table_write(self, address: Value, byte_mask: Value, v: Value) -> None:
        """Merge the 24-bit ``v`` under ``byte_mask`` (bit i: byte i) into the programming latch of ``address``."""

    def flag(self, name: str) -> Value:
        """An SR bit, 0 or 1: C Z OV N DC OA OB SA SB."""

    def set_flags(self, **flags: Value) -> None:
        """Change the named SR bits; OAB and SAB are updated accordingly."""

    def reg(self, name: str) -> Value:
        """A core register by name: RCOUNT TBLPAG XMODSRT XMODEND YMODSRT YMODEND XBREV, and the PUSH.S shadows
        W0S W1S W2S W3S SRS (isa.md §2.6)."""

    def set_reg(self, name: str, v: Value) -> None:
        """Write a register that ``reg`` names."""

    def acc(self, i: int) -> Value:
        """Accumulator A (0) or B (1) as a signed 40-bit value."""

    def set_acc(self, i: int, v: Value) -> None:
        """Write a signed 40-bit value to an accumulator."""

    def when(self, c: Value, fn: Callable[[], None]) -> None:
        """Run ``fn`` only if ``c`` is not 0."""

    def trap_math(self, c: Value) -> None:
        """Request a math error trap if ``c`` (isa.md §14.4)."""
