"""Branches, calls, returns, skips, REPEAT and DO (isa.md §5.7, §7). None of them may follow REPEAT.

The cycles are those without a taken branch or skip; the sequencer adds the rest (isa.md §13.1).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from operator import eq, gt, lt, ne
from typing import TypeAlias

from emu.dspic30f.isa.addressing import pop_addresses, push, set_register, signed16, size_of, source
from emu.dspic30f.isa.builder import Builder
from emu.dspic30f.isa.fields import Operands
from emu.dspic30f.isa.flow import PC_MASK, Branch, Call, Do, Goto, Repeat, Return, Skip, Value
from emu.dspic30f.isa.row import Does, Row

Condition: TypeAlias = Callable[[Builder], Value]

row = partial(Row, repeat_ok=False)
two = partial(row, cycles=2)
far = partial(two, word2="0000 0000 0000 0000 0nnn nnnn")
do_ = partial(two, word2="0000 0000 nnnn nnnn nnnn nnnn")
ret = partial(row, cycles=3)


def skip_if(relation: Callable[[Value, Value], Value]) -> Does:
    """Return the function of CPSxx: skip by a signed comparison of Wb with Wn."""

    def does(m: Builder, x: Operands) -> Skip:
        top = 0x80 if x.B else 0x8000  # inverting the sign bit converts signed order to unsigned order
        mask = 2 * top - 1
        return Skip(relation((m.w(x.w) ^ top) & mask, (m.w(x.s) ^ top) & mask))

    return does


def skip_f_bit(wanted: int) -> Does:
    """Return the function of BTSS, BTSC for a bit of a file register."""

    def does(m: Builder, x: Operands) -> Skip:
        return Skip((m.load(x.f, 1) >> x.b & 1) == wanted)

    return does


def skip_bit(wanted: int) -> Does:
    """Return the function of BTSS, BTSC for a bit of Ws."""

    def does(m: Builder, x: Operands) -> Skip:
        return Skip((source(m, x, 2).read() >> x.b & 1) == wanted)

    return does


def bit(name: str) -> Condition:
    """Return a condition that tests an SR bit."""
    return lambda m: m.flag(name)


def less(m: Builder) -> Value:
    return m.flag("N") ^ m.flag("OV")


def less_or_equal(m: Builder) -> Value:
    return m.flag("Z") | less(m)


def less_or_equal_unsigned(m: Builder) -> Value:
    return m.flag("C") ^ 1 | m.flag("Z")


def relative(m: Builder, words: Value) -> Value:
    """Return the target of a branch by ``words`` from the next instruction (isa.md §7.1)."""
    return (m.pc + 2 + 2 * words) & PC_MASK


def branch_if(condition: Condition, wanted: int = 1) -> Does:
    """Return the function of a conditional branch. It is taken if the condition equals ``wanted`` (isa.md §7.2)."""

    def does(m: Builder, x: Operands) -> Branch:
        return Branch(condition(m) == wanted, relative(m, x.n))

    return does


def branch(m: Builder, x: Operands) -> Goto:
    return Goto(relative(m, x.n))


def branch_register(m: Builder, x: Operands) -> Goto:
    return Goto(relative(m, signed16(m, m.w(x.s))))


def goto(m: Builder, x: Operands) -> Goto:
    return Goto(x.n)


def goto_register(m: Builder, x: Operands) -> Goto:
    return Goto(m.w(x.s) & 0xFFFE)


def push_return(m: Builder, words: int) -> None:
    """Push the address after this instruction, which has ``words`` words (isa.md §7.4)."""
    after = (m.pc + 2 * words) & PC_MASK
    push(m, after & 0xFFFF, after >> 16)


def call(m: Builder, x: Operands) -> Call:
    push_return(m, 2)
    return Call(x.n)


def call_register(m: Builder, x: Operands) -> Call:
    target = m.let(m.w(x.s) & 0xFFFE)
    push_return(m, 1)
    return Call(target)


def relative_call(m: Builder, x: Operands) -> Call:
    push_return(m, 1)
    return Call(relative(m, x.n))


def relative_call_register(m: Builder, x: Operands) -> Call:
    target = m.let(relative(m, signed16(m, m.w(x.s))))
    push_return(m, 1)
    return Call(target)


def pop_return(m: Builder) -> tuple[Value, Value]:
    """Pop a program address. Return the address and the whole upper word."""
    low, high = pop_addresses(m, 2)
    upper, lower = m.let(m.load(high, 2, ptr=15)), m.load(low, 2, ptr=15)
    return m.let((upper & 0x7F) << 16 | lower & 0xFFFE), upper


def return_(m: Builder, x: Operands) -> Return:
    return Return("return", pop_return(m)[0])


def return_from_interrupt(m: Builder, x: Operands) -> Return:
    target, upper = pop_return(m)
    return Return("retfie", target, srl=upper >> 8, ipl3=upper >> 7 & 1)


def return_literal(m: Builder, x: Operands) -> Return:
    target = pop_return(m)[0]
    set_register(m, x.d, x.k, size_of(x))
    return Return("retlw", target)


def repeat_literal(m: Builder, x: Operands) -> Repeat:
    return Repeat(x.k)


def repeat_register(m: Builder, x: Operands) -> Repeat:
    return Repeat(m.w(x.s) & 0x3FFF)


def do_end(m: Builder, x: Operands) -> int:
    """Return the address of the loop's last instruction (isa.md §7.6)."""
    return m.pc + 4 + 2 * x.n & PC_MASK


def do_literal(m: Builder, x: Operands) -> Do:
    return Do(x.k, do_end(m, x))


def do_register(m: Builder, x: Operands) -> Do:
    return Do(m.w(x.s) & 0x3FFF, do_end(m, x))


# fmt: off
ROWS = (
    row(112, "CPSEQ{.B} Wb, Wn",     "1110 0111 1www wB00 0000 ssss", "",         skip_if(eq)),
    row(113, "CPSGT{.B} Wb, Wn",     "1110 0110 0www wB00 0000 ssss", "",         skip_if(gt)),
    row(114, "CPSLT{.B} Wb, Wn",     "1110 0110 1www wB00 0000 ssss", "",         skip_if(lt)),
    row(115, "CPSNE{.B} Wb, Wn",     "1110 0111 0www wB00 0000 ssss", "",         skip_if(ne)),
    row(130, "BTSS{.B} f, #bit4",    "1010 1110 bbbf ffff ffff ffff", "",         skip_f_bit(1)),
    row(131, "BTSS{.W} Ws, #bit4",   "1010 0110 bbbb 0000 0ppp ssss", "",         skip_bit(1)),
    row(132, "BTSC{.B} f, #bit4",    "1010 1111 bbbf ffff ffff ffff", "",         skip_f_bit(0)),
    row(133, "BTSC{.W} Ws, #bit4",   "1010 0111 bbbb 0000 0ppp ssss", "",         skip_bit(0)),
    row(136, "BRA OV, Expr",         "0011 0000 nnnn nnnn nnnn nnnn", "",         branch_if(bit("OV"))),
    row(137, "BRA C, Expr",          "0011 0001 nnnn nnnn nnnn nnnn", "",         branch_if(bit("C"))),
    row(138, "BRA Z, Expr",          "0011 0010 nnnn nnnn nnnn nnnn", "",         branch_if(bit("Z"))),
    row(139, "BRA N, Expr",          "0011 0011 nnnn nnnn nnnn nnnn", "",         branch_if(bit("N"))),
    row(140, "BRA LE, Expr",         "0011 0100 nnnn nnnn nnnn nnnn", "",         branch_if(less_or_equal)),
    row(141, "BRA LT, Expr",         "0011 0101 nnnn nnnn nnnn nnnn", "",         branch_if(less)),
    row(142, "BRA LEU, Expr",        "0011 0110 nnnn nnnn nnnn nnnn", "",         branch_if(less_or_equal_unsigned)),
    two(143, "BRA Expr",             "0011 0111 nnnn nnnn nnnn nnnn", "",         branch),
    row(144, "BRA NOV, Expr",        "0011 1000 nnnn nnnn nnnn nnnn", "",         branch_if(bit("OV"), 0)),
    row(145, "BRA NC, Expr",         "0011 1001 nnnn nnnn nnnn nnnn", "",         branch_if(bit("C"), 0)),
    row(146, "BRA NZ, Expr",         "0011 1010 nnnn nnnn nnnn nnnn", "",         branch_if(bit("Z"), 0)),
    row(147, "BRA NN, Expr",         "0011 1011 nnnn nnnn nnnn nnnn", "",         branch_if(bit("N"), 0)),
    row(148, "BRA GT, Expr",         "0011 1100 nnnn nnnn nnnn nnnn", "",         branch_if(less_or_equal, 0)),
    row(149, "BRA GE, Expr",         "0011 1101 nnnn nnnn nnnn nnnn", "",         branch_if(less, 0)),
    row(150, "BRA GTU, Expr",        "0011 1110 nnnn nnnn nnnn nnnn", "",         branch_if(less_or_equal_unsigned, 0)),
    row(151, "BRA OA, Expr",         "0000 1100 nnnn nnnn nnnn nnnn", "",         branch_if(bit("OA"))),
    row(152, "BRA OB, Expr",         "0000 1101 nnnn nnnn nnnn nnnn", "",         branch_if(bit("OB"))),
    row(153, "BRA SA, Expr",         "0000 1110 nnnn nnnn nnnn nnnn", "",         branch_if(bit("SA"))),
    row(154, "BRA SB, Expr",         "0000 1111 nnnn nnnn nnnn nnnn", "",         branch_if(bit("SB"))),
    two(155, "BRA Wn",               "0000 0001 0110 0000 0000 ssss", "",         branch_register),
    far(156, "CALL Expr",            "0000 0010 nnnn nnnn nnnn nnn0", "",         call),
    two(157, "CALL Wn",              "0000 0001 0000 0000 0000 ssss", "",         call_register),
    far(158, "GOTO Expr",            "0000 0100 nnnn nnnn nnnn nnn0", "",         goto),
    two(159, "GOTO Wn",              "0000 0001 0100 0000 0000 ssss", "",         goto_register),
    two(160, "RCALL Expr",           "0000 0111 nnnn nnnn nnnn nnnn", "",         relative_call),
    two(161, "RCALL Wn",             "0000 0001 0010 0000 0000 ssss", "",         relative_call_register),
    ret(162, "RETURN",               "0000 0110 0000 0000 0000 0000", "",         return_),
    ret(163, "RETFIE",               "0000 0110 0100 0000 0000 0000", "N OV Z C", return_from_interrupt),
    ret(164, "RETLW{.B} #lit10, Wn", "0000 0101 0Bkk kkkk kkkk dddd", "",         return_literal),
    row(165, "REPEAT #lit14",        "0000 1001 00kk kkkk kkkk kkkk", "",         repeat_literal),
    row(166, "REPEAT Wn",            "0000 1001 1000 0000 0000 ssss", "",         repeat_register),
    do_(167, "DO #lit14, Expr",      "0000 1000 00kk kkkk kkkk kkkk", "",         do_literal),
    do_(168, "DO Wn, Expr",          "0000 1000 1000 0000 0000 ssss", "",         do_register),
)
# fmt: on
