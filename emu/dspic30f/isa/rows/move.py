"""Moves, exchange, extension and table access (isa.md §5.5, §7.7)."""

from __future__ import annotations

from functools import partial

from emu.dspic30f.isa.addressing import (
    Location,
    destination,
    indirect,
    offset_address,
    set_register,
    size_of,
    source,
    truncated,
)
from emu.dspic30f.isa.alu import set_nz, test
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import Value
from emu.dspic30f.isa.forms import WREG, f_only, f_to_wreg
from emu.dspic30f.isa.row import Does, Row

mov = partial(Row, psv_class="mov")
mvd = partial(mov, cycles=2, repeat_ok=False)  # register pairs begin at even registers
tbr = partial(Row, cycles=2, constraints="p>=1")
tbw = partial(Row, cycles=2, constraints="q>=1")


def wreg_to_f(m: Builder, x: Operands) -> None:
    m.store(x.f, m.w(WREG), size_of(x))


def f_to_wnd(m: Builder, x: Operands) -> None:
    m.set_w(x.d, m.load(x.f, 2))


def wns_to_f(m: Builder, x: Operands) -> None:
    m.store(x.f, m.w(x.s), 2)


def literal_byte(m: Builder, x: Operands) -> None:
    m.set_wb(x.d, x.k)


def literal_word(m: Builder, x: Operands) -> None:
    m.set_w(x.d, x.k)


def load_with_offset(m: Builder, x: Operands) -> None:
    size = size_of(x)
    set_register(m, x.d, m.load(offset_address(m, x.s, x.o * size, "src"), size, ptr=x.s), size)


def store_with_offset(m: Builder, x: Operands) -> None:
    size = size_of(x)
    v = m.w(x.s)
    m.store(offset_address(m, x.d, x.o * size, "dst"), v, size, ptr=x.d)


def move(m: Builder, x: Operands) -> None:
    size = size_of(x)
    operand = source(m, x, size, mode=x.g)
    result = destination(m, x, size, mode=x.h)
    result.write(operand.read())


def load_pair(m: Builder, x: Operands) -> None:
    """Wnd+1:Wnd <- Ws+1:Ws, or two words of memory, the low one at the lower address (isa.md §7.4)."""
    if x.p:
        ea, moved = indirect(m, x.s, x.p, 4, "src")
        if moved is not None:
            m.set_ptr(x.s, moved, "src")
        low, high = m.load(ea, 2, ptr=x.s), m.load((ea + 2) & 0xFFFF, 2, ptr=x.s)
    else:
        low, high = m.w(x.s), m.w(x.s + 1)
    m.set_w(x.d, low)
    m.set_w(x.d + 1, high)


def store_pair(m: Builder, x: Operands) -> None:
    low, high = m.w(x.s), m.w(x.s + 1)
    ea, moved = indirect(m, x.d, x.q, 4, "dst")
    if moved is not None:
        m.set_ptr(x.d, moved, "dst")
    m.store(ea, low, 2, ptr=x.d)
    m.store((ea + 2) & 0xFFFF, high, 2, ptr=x.d)


def exchange(m: Builder, x: Operands) -> None:
    a, b = m.w(x.s), m.w(x.d)
    m.set_w(x.s, b)
    m.set_w(x.d, a)


def swap(m: Builder, x: Operands) -> None:
    """Exchange the bytes of Wn; in byte mode the nibbles of its low byte."""
    half, size = (4, size_of(x)) if x.B else (8, size_of(x))
    v = truncated(m.w(x.s), size)
    set_register(m, x.s, v >> half | v << half, size)


def sign_extend(m: Builder, x: Operands) -> None:
    v = m.let((source(m, x, 1).read() ^ 0x80) - 0x80 & 0xFFFF)
    m.set_flags(C=v >> 15 ^ 1)
    m.set_w(x.d, set_nz(m, 2, v))


def zero_extend(m: Builder, x: Operands) -> None:
    m.set_flags(C=1)
    m.set_w(x.d, set_nz(m, 2, m.let(source(m, x, 1).read())))


def table_address(m: Builder, ea: Value) -> Value:
    """Return an even program address. UNVERIFIED: word mode ignores EA<0> (isa.md §7.7)."""
    return m.reg("TBLPAG") << 16 | ea & 0xFFFE


def table_pointer(location: Location) -> Value:
    """Return the address of a table instruction from its operand's location.

    A destination pointer is updated after all reads.
    """
    assert location.ea is not None, "a table pointer is never register direct"
    location.move_pointer()
    return location.ea


def table_read(low: int) -> Does:
    """Return the function for Wd <- bits of the program word at TBLPAG:[Ws], from bit ``low`` on.

    In byte mode, an odd address selects the next byte.
    """

    def does(m: Builder, x: Operands) -> None:
        size = size_of(x)
        ea = table_pointer(source(m, x, size))
        result = destination(m, x, size)
        word = m.prog(table_address(m, ea)) >> low
        result.write(word >> 8 * (ea & 1) if x.B else word)

    return does


def table_write_low(m: Builder, x: Operands) -> None:
    """Latch<15:0>, or in byte mode one of its bytes, <- Ws."""
    size = size_of(x)
    operand, result = source(m, x, size), destination(m, x, size)
    v, ea = operand.read(), table_pointer(result)
    odd = ea & 1
    if x.B:
        m.table_write(table_address(m, ea), 1 << odd, v << 8 * odd)
    else:
        m.table_write(table_address(m, ea), 0b011, v)


def table_write_high(m: Builder, x: Operands) -> None:
    """Latch<23:16> <- Ws<7:0>. In byte mode, an odd address has no effect."""
    size = size_of(x)
    operand, result = source(m, x, size), destination(m, x, size)
    v, ea = operand.read() & 0xFF, table_pointer(result)
    m.table_write(table_address(m, ea), (ea & 1 ^ 1) << 2 if x.B else 0b100, v << 16)


# fmt: off
ROWS = (
    Row(169, "MOV{.B} f",                "1011 1111 1B1f ffff ffff ffff", "N Z", f_only(test)),
    Row(170, "MOV{.B} f, WREG",          "1011 1111 1B0f ffff ffff ffff", "N Z", f_to_wreg(test)),
    Row(171, "MOV{.B} WREG, f",          "1011 0111 1B1f ffff ffff ffff", "",   wreg_to_f),
    mov(172, "MOV{.W} f, Wnd",           "1000 0fff ffff ffff ffff dddd", "",   f_to_wnd),
    Row(173, "MOV{.W} Wns, f",           "1000 1fff ffff ffff ffff ssss", "",   wns_to_f),
    Row(174, "MOV.B #lit8, Wnd",         "1011 0011 1100 kkkk kkkk dddd", "",   literal_byte),
    Row(175, "MOV{.W} #lit16, Wnd",      "0010 kkkk kkkk kkkk kkkk dddd", "",   literal_word),
    mov(176, "MOV{.B} [Ws+Slit10], Wnd", "1001 0ooo oBoo oddd dooo ssss", "",   load_with_offset),
    Row(177, "MOV{.B} Wns, [Wd+Slit10]", "1001 1ooo oBoo oddd dooo ssss", "",     store_with_offset),
    mov(178, "MOV{.B} Ws, Wd",           "0111 1www wBhh hddd dggg ssss", "",     move),
    mvd(179, "MOV.D Ws, Wnd",            "1011 1110 0000 0ddd 0ppp ssss", "",     load_pair, constraints="p=0: s even"),
    mvd(180, "MOV.D Wns, Wd",            "1011 1110 10qq qddd d000 sss0", "",     store_pair, constraints="q>=1"),
    Row(181, "EXCH Wns, Wnd",            "1111 1101 0000 0ddd d000 ssss", "",     exchange),
    Row(182, "SWAP{.B} Wn",              "1111 1101 1B00 0000 0000 ssss", "",     swap),
    Row(183, "SE Ws, Wnd",               "1111 1011 0000 0ddd dppp ssss", "N Z C", sign_extend),
    Row(184, "ZE Ws, Wnd",               "1111 1011 1000 0ddd dppp ssss", "N Z C", zero_extend),
    tbr(211, "TBLRDL{.B} [Ws], Wd",      "1011 1010 0Bqq qddd dppp ssss", "",     table_read(0)),
    tbr(212, "TBLRDH{.B} [Ws], Wd",      "1011 1010 1Bqq qddd dppp ssss", "",     table_read(16)),
    tbw(213, "TBLWTL{.B} Ws, [Wd]",      "1011 1011 0Bqq qddd dppp ssss", "",     table_write_low),
    tbw(214, "TBLWTH{.B} Ws, [Wd]",      "1011 1011 1Bqq qddd dppp ssss", "",     table_write_high),
)
# fmt: on
