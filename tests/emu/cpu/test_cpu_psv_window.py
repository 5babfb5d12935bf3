"""Cycles and results of instructions that read program memory through the PSV window (isa.md §7.8, §13.3)."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import RAM, TABLE, Rig


def windowed(engine: str, text: str, **w: int) -> Rig:
    rig = Rig(text, engine, **w)
    rig.window(*(0x3F0000 | 0x1111 * (index + 1) for index in range(14)))
    return rig


@pytest.mark.parametrize(
    ("statement", "cycles"),
    [
        ("mov [w1], w2", 2),
        ("mov.b [w1], w2", 2),
        ("mov [w1++], [w2]", 2),
        ("mov [w1+2], w2", 2),
        ("mov.d [w1], w2", 3),
        ("mov 0x8000, w2", 2),
        ("push 0x8000", 2),
        ("add w0, [w1], w2", 3),
        ("add w0, [w1], [w2++]", 3),
        ("cp w0, [w1]", 3),
        ("btst.z [w1], #0", 3),
        ("se [w1], w2", 3),
        ("mul.uu w0, [w1], w2", 3),
        ("lac [w1], a", 3),
    ],
)
def test_a_window_read_costs_one_cycle_in_moves_and_two_elsewhere(engine: str, statement: str, cycles: int) -> None:
    """isa.md §13.3: outside REPEAT, a window read costs one extra cycle in moves and two in other instructions."""
    assert windowed(engine, f"{statement}\nend: nop", w1=TABLE).cycles_to() == cycles


def test_a_prefetch_from_the_window_costs_one_cycle(engine: str) -> None:
    """isa.md §13.3: an X prefetch from the window, in an instruction of the MAC class, costs one extra cycle."""
    rig = windowed(engine, "mac w4*w5, a, [w8]+=2, w4\nend: nop", w8=TABLE)
    assert rig.cycles_to() == 2
    assert rig.machine.w[4] == 0x1111


@pytest.mark.parametrize(("bit", "cycles"), [(0, 4), (1, 3)])
def test_a_skip_on_a_window_bit_takes_both_extras(engine: str, bit: int, cycles: int) -> None:
    """isa.md §13.1, §13.3: BTSS on a word in the window takes 1 + 2 PSV cycles, + 1 for the skip; the word is 1111."""
    rig = windowed(engine, f"btss [w1], #{bit}\nnext: nop\nend: nop", w1=TABLE)
    assert rig.cycles_to("next" if bit else "end") == cycles


def test_a_stall_adds_to_window_cycles(engine: str) -> None:
    """A stall adds to window cycles: ADD W0,[W1],[W2++] takes 3 cycles, MOV [W2],[W3] 1 cycle after a stall of 1.

    Source: the example in isa.md §13.3.
    """
    assert windowed(engine, "add w0, [w1], [w2++]\nmov [w2], [w3]\nend: nop", w1=TABLE).cycles_to() == 5


def test_a_destination_in_ram_and_psv_off_cost_nothing(engine: str) -> None:
    """isa.md §13.3: a RAM access while PSV is on, and a read with PSV off, cost no extra cycle."""
    assert windowed(engine, "mov [w1], [w2]\nend: nop").cycles_to() == 1


@pytest.mark.parametrize(("count", "cycles"), [(1, 1 + 3 + 3), (2, 1 + 3 + 1 + 3), (9, 1 + 3 + 8 + 3)])
def test_under_repeat_only_the_first_and_last_iteration_pay(engine: str, count: int, cycles: int) -> None:
    """isa.md §13.3: under REPEAT, only the first and the last iteration have extra cycles: 2 each, also for MOV."""
    rig = windowed(engine, f"repeat #{count}\nmov [w1++], [w2++]\nend: nop", w1=TABLE, w2=RAM)
    assert rig.cycles_to() == cycles
    assert rig.machine.peek(RAM + 2 * count) == 0x1111 * (count + 1)


def test_an_interrupt_under_repeat_makes_two_more_iterations_pay(engine: str) -> None:
    """isa.md §13.3: an interrupt under REPEAT adds extra cycles to the iteration before it and to the first one after
    the return.

    REPEAT 0; first iteration 1..3; iterations in 4, 5; flag first 1 in 5: that one becomes 5..7, handler at
    max(5 + 4, 7 + 3) = 10; BCLR 10, RETFIE 11..13; first iteration 14..16, three more in 17..19, last 20..22.
    """
    rig = windowed(engine, "repeat #7\nmov [w1++], [w2++]\nend: nop\nisr: bclr 0x84, #3\nretfie", w1=TABLE, w2=RAM)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(5)
    rig.note("isr")
    assert rig.cycles_to() == 23
    assert rig.first("isr") == 10
    assert rig.machine.peek(RAM + 14) == 0x8888


def test_window_bytes_words_and_pages(engine: str) -> None:
    """isa.md §7.8: the window reads the low 16 bits of the program word at {PSVPAG, EA<14:0>}; the upper byte is not
    accessible."""
    rig = Rig("mov [w1], w2\nmov.b [++w1], w3\nend: nop", engine, w1=TABLE + 2, w3=0)
    rig.window(0x3F1234, 0x3FABCD, page=2)
    rig.cycles_to()
    assert (rig.machine.w[2], rig.machine.w[3]) == (0xABCD, 0xAB)


def test_writes_to_the_window_are_lost(engine: str) -> None:
    """isa.md §7.8, UNVERIFIED: a write to the window is ignored and does not trap."""
    rig = windowed(engine, "mov w0, [w1]\nend: nop", w1=TABLE)
    assert rig.cycles_to() == 1
    assert rig.machine.peek("INTCON1") == 0
