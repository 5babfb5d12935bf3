"""Stack and frame instructions (isa.md §5.8, §7.4, §2.6)."""

from __future__ import annotations

from emu.dspic30f.isa.addressing import STACK_POINTER, pop_addresses
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.row import Row

FRAME_POINTER = 14
SHADOWED = range(4)  # W0-W3
SHADOWED_FLAGS = ("C", "Z", "OV", "N")  # SR<3:0>, in bit order; DC is SR<8>
DC_BIT = 8


def push_f(m: Builder, x: Operands) -> None:
    top = m.ptr(STACK_POINTER, "dst")
    v = m.load(x.f, 2)
    m.set_ptr(STACK_POINTER, (top + 2) & 0xFFFF, "dst")
    m.store(top, v, 2, ptr=STACK_POINTER)


def pop_f(m: Builder, x: Operands) -> None:
    (top,) = pop_addresses(m, 1)
    m.store(x.f, m.load(top, 2, ptr=STACK_POINTER), 2)


def link(m: Builder, x: Operands) -> None:
    """Push W14, set it to the address after the pushed word, and add k to W15 without wrapping (isa.md §10.4)."""
    top = m.ptr(STACK_POINTER, "dst")
    old = m.w(FRAME_POINTER)
    m.set_ptr(STACK_POINTER, (top + 2 + x.k) & 0xFFFF, "dst")
    m.store(top, old, 2, ptr=STACK_POINTER)
    m.set_w(FRAME_POINTER, top + 2)


def unlink(m: Builder, x: Operands) -> None:
    """W15 <- W14, pop W14. UNVERIFIED: W14 is the pointer, so a preceding write of W14 stalls (isa.md §13.2)."""
    top = m.let((m.ptr(FRAME_POINTER, "src") - 2) & 0xFFFF)
    m.set_ptr(STACK_POINTER, top, "src")
    m.set_w(FRAME_POINTER, m.load(top, 2, ptr=STACK_POINTER))


def push_shadow(m: Builder, x: Operands) -> None:
    for n in SHADOWED:
        m.set_reg(f"W{n}S", m.w(n))
    flags = m.flag("DC") << DC_BIT
    for i, name in enumerate(SHADOWED_FLAGS):
        flags = flags | m.flag(name) << i
    m.set_reg("SRS", flags)


def pop_shadow(m: Builder, x: Operands) -> None:
    """Restore W0-W3 and flags. UNVERIFIED: this counts as a word write that initialises W0-W3 (isa.md §2.2)."""
    flags = m.let(m.reg("SRS"))
    for n in SHADOWED:
        m.set_w(n, m.reg(f"W{n}S"))
    m.set_flags(DC=flags >> DC_BIT & 1, **{name: flags >> i & 1 for i, name in enumerate(SHADOWED_FLAGS)})


# fmt: off
ROWS = (
    Row(201, "LNK #lit14", "1111 1010 00kk kkkk kkkk kkk0", "",            link, repeat_ok=False),
    Row(202, "ULNK",       "1111 1010 1000 0000 0000 0000", "",            unlink, repeat_ok=False),
    Row(203, "PUSH f",     "1111 1000 ffff ffff ffff fff0", "",            push_f, psv_class="mov"),
    Row(204, "POP f",      "1111 1001 ffff ffff ffff fff0", "",            pop_f),
    Row(205, "PUSH.S",     "1111 1110 1010 0000 0000 0000", "",            push_shadow),
    Row(206, "POP.S",      "1111 1110 1000 0000 0000 0000", "DC N OV Z C", pop_shadow),
)
# fmt: on
