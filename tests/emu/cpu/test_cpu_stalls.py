"""RAW stalls: one extra cycle before a source address that uses a register written by the instruction before (isa.md
§13.2)."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import RAM, Rig

STALLED, FREE = 3, 2
"""Cycles of two one-cycle instructions, with and without a stall."""


def pair(engine: str, first: str, second: str, **w: int) -> int:
    return Rig(f"{first}\n{second}\nend: nop", engine, **w).cycles_to()


@pytest.mark.parametrize(
    ("first", "second", "cycles"),
    [
        ("add w0, w1, w2", "mov w2, w3", FREE), ("add w0, w1, w2", "mov [w2], w3", STALLED),
        ("add w0, w1, w2", "mov [w2++], w3", STALLED), ("add w0, w1, [w2]", "mov w2, w3", FREE),
        ("add w0, w1, [w2]", "mov [w2], w3", FREE), ("add w0, w1, [w2]", "mov [w2++], w3", FREE),
        ("add w0, w1, [w2++]", "mov w2, w3", FREE), ("add w0, w1, [w2++]", "mov [w2], w3", STALLED),
        ("add w0, w1, [w2++]", "mov [w2++], w3", STALLED), ("add w0, w1, [--w2]", "mov [w2], w3", STALLED),
    ],
)  # fmt: skip
def test_the_table_of_register_dependencies(engine: str, first: str, second: str, cycles: int) -> None:
    """isa.md §13.2: each row of the table of register dependencies has its stall, in the table's order (both operands
    of the sum are even addresses)."""
    assert pair(engine, first, second, w0=0x800, w1=0x800) == cycles


def test_a_store_to_the_address_of_a_register_stalls_its_use_as_pointer(engine: str) -> None:
    """isa.md §13.2: an indirect store to the address of W2 (W2 = 0004) stalls the use of W2 as a pointer."""
    assert pair(engine, "mov w1, [w2]", "mov [w2], w3", w1=RAM, w2=4) == STALLED


def test_a_file_register_store_to_a_w_register_stalls_too(engine: str) -> None:
    """isa.md §13.2, cause 1: a file register store to the memory-mapped address of Wn stalls its use as a pointer."""
    assert pair(engine, "mov w1, 0x0004", "mov [w2], w3", w1=RAM) == STALLED


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("mov [w1++], w2", "mov [w1++], w3"),  # writes a source pointer, then uses it as source
        ("mov #0x1000, w1", "mov w0, [w1]"),  # writes a destination pointer
        ("mov #0x1000, w1", "add w1, w1, w2"),  # writes a data register
        ("mov #0x1000, w0", "add 0x1000"),  # writes WREG, which is data
        ("bset [w1++], #0", "mov [w1], w2"),  # UNVERIFIED: read-modify-write counts as source side
        ("pop w1", "pop w2"),  # W15 modified on the source side
    ],
)
def test_no_stall(engine: str, first: str, second: str) -> None:
    """isa.md §13.2, "not a stall": the pairs of this list have none."""
    assert pair(engine, first, second) == FREE


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("push w0", "pop w1"),
        ("mov.b #4, w2", "mov [w2], w3"),
        ("mov #0x1000, w2", "mov [w1+w2], w3"),
        ("mov #2, w1", "mov [w1+0x100], w3"),
        ("mov #0x1000, w8", "mac w4*w5, a, [w8]+=2, w4"),
        ("mov #0x1800, w10", "mac w4*w5, a, [w10]+=2, w5"),
        ("mov #2, w12", "mac w4*w5, a, [w9+w12], w4"),
        ("mul.uu w0, w1, w2", "mov [w3], w4"),  # both registers of a pair count
        ("lnk #4", "pop w1"),
        ("mov #0x0900, w14", "ulnk"),  # UNVERIFIED
    ],
)
def test_other_sources_and_uses(engine: str, first: str, second: str) -> None:
    """isa.md §13.2: byte writes, offsets, prefetch pointers, register pairs and the stack pointer also stall."""
    assert pair(engine, first, second, w0=0, w1=0x1000, w2=0x1000) == STALLED


def test_a_call_stalls_a_pop_at_its_target(engine: str) -> None:
    """isa.md §13.2: CALL writes W15 on the destination side and stalls a pop at its target: 2 + 1 + 1 cycles."""
    assert Rig("rcall sub\nsub: pop w1\nend: nop", engine).cycles_to() == 4


def test_a_table_read_pointer_stalls(engine: str) -> None:
    """isa.md §13.2: a table read stalls for its pointer: 1 + stall + 2 cycles."""
    assert pair(engine, "mov #0x400, w1", "tblrdl [w1], w2") == 4


def test_two_matching_registers_stall_once(engine: str) -> None:
    """isa.md §13.2: two matching registers cause only one stall between two instructions."""
    assert pair(engine, "mul.uu w0, w1, w2", "mov [w2+w3], w4", w0=0, w1=0) == STALLED


def test_the_return_after_a_push_stalls(engine: str) -> None:
    """isa.md §13.2: RETURN reads through W15 and stalls after a push. 2 + 1 + 1 + stall + 3 cycles; the first RETURN
    pops the pushed word."""
    rig = Rig("rcall sub\nend: nop\nsub: mov #0, w0\nsub w15, #0, w15\nreturn", engine)
    assert rig.cycles_to() == 2 + 1 + 1 + 1 + 3


def test_iterations_of_a_repeat_target_stall_each_other(engine: str) -> None:
    """isa.md §7.5, §13.2: iterations of `MOV [W1],W1`, which writes the pointer it reads, stall each other: REPEAT,
    then 1 + 3 x (stall + 1)."""
    rig = Rig("repeat #3\nmov [w1], w1\nend: nop", engine, w1=RAM)
    rig.machine.poke(RAM, RAM)
    assert rig.cycles_to() == 1 + 1 + 3 * 2


def test_a_loop_end_stalls_the_loop_start(engine: str) -> None:
    """isa.md §13.2: the last instruction of a DO loop stalls the first one, which is prefetched next. 2 + (1 + 1) +
    (stall + 1 + 1)."""
    rig = Rig("do #1, last\nmov [w2], w3\nlast: mov #0x1000, w2\nend: nop", engine, w2=RAM)
    assert rig.cycles_to() == 2 + 2 + 3


def test_a_stall_disappears_when_an_interrupt_comes_between(engine: str) -> None:
    """isa.md §13.2: a stall disappears if an interrupt comes between both instructions: after the handler the second
    one starts without the extra cycle.

    MOV in cycle 0 = c; handler in 4; RETFIE 4..6; the use of W2 in 7.
    """
    rig = Rig("mov #0x1000, w2\nmov [w2], w3\nend: nop\nisr: bclr 0x84, #3\nretfie", engine)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(0)
    rig.note("isr")
    assert rig.cycles_to() == 4 + 1 + 3 + 1
    assert rig.first("isr") == 4


def test_the_hazard_of_a_skipped_instruction_is_not_seen(engine: str) -> None:
    """isa.md §13.2: a skipped instruction causes no stall, because only the next executed instruction counts; BTSS
    and its skip take 2 cycles."""
    rig = Rig("btss w0, #0\nmov #0x1000, w2\nmov [w2], w3\nend: nop", engine, w0=1)
    assert rig.cycles_to() == 2 + 1
