"""Base cycles of every kind of instruction (isa.md §13.1), measured between the starts of two instructions."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import RAM, Rig


@pytest.mark.parametrize(
    ("statement", "cycles"),
    [
        ("nop", 1),
        ("add w0, w1, w2", 1),
        ("mov w0, [w1++]", 1),
        ("mov [w1], [w2]", 1),
        ("mov #0x1234, w3", 1),
        ("mul.uu w0, w1, w2", 1),
        ("bset 0x1000, #3", 1),
        ("add 0x1000", 1),
        ("mov 0x2C6, w0", 1),  # reading an SFR takes no extra cycle
        ("mov w0, 0x2CA", 1),  # writing an SFR takes no extra cycle
        ("exch w0, w1", 1),
        ("lnk #4", 1),
        ("push w0", 1),
        ("mac w4*w5, a, [w8]+=2, w4, [w10]+=2, w5", 1),
        ("mov.d w0, w2", 2),
        ("mov.d [w1], w2", 2),
        ("mov.d w2, [w1]", 2),
        ("tblrdl [w1], w2", 2),
        ("tblwtl w2, [w1]", 2),
        ("bra end", 2),
        ("goto end", 2),
        ("call end", 2),
        ("rcall end", 2),
        ("disi #0", 1),
        ("clrwdt", 1),
    ],
)
def test_an_instruction_takes_its_base_cycles(engine: str, statement: str, cycles: int) -> None:
    """isa.md §13.1: each instruction takes its base cycles."""
    assert Rig(f"{statement}\nend: nop", engine).cycles_to() == cycles


def test_two_word_instructions_take_two_cycles(engine: str) -> None:
    """isa.md §13.1: the two-word instructions DO, CALL and GOTO take two cycles."""
    assert Rig("do #0, last\nend: nop\nlast: nop", engine).cycles_to() == 2


@pytest.mark.parametrize(("sr", "cycles"), [(0x0002, 2), (0x0000, 1)])
def test_a_conditional_branch_takes_two_cycles_only_when_taken(engine: str, sr: int, cycles: int) -> None:
    """isa.md §13.1: a conditional branch takes two cycles if it is taken, otherwise one."""
    rig = Rig("bra z, taken\nfall: nop\ntaken: nop", engine)
    rig.machine.poke("SR", sr)
    assert rig.cycles_to("taken" if sr else "fall") == cycles


@pytest.mark.parametrize("statement", ["return", "retfie", "retlw #5, w3"])
def test_returns_take_three_cycles(engine: str, statement: str) -> None:
    """isa.md §13.1: returns take three cycles if no exception is pending."""
    rig = Rig(f"call sub\nend: nop\nsub: nop\n{statement}", engine)
    assert rig.cycles_to() == 2 + 1 + 3


@pytest.mark.parametrize("branch", ["bra w3", "goto w3", "call w3", "rcall w3"])
def test_computed_flow_takes_two_cycles(engine: str, branch: str) -> None:
    """isa.md §7.1, §13.1: computed branches and calls take two cycles; BRA and RCALL count words from the next
    instruction."""
    rig = Rig(f"{branch}\nnop\nend: nop", engine, w3=1 if branch in ("bra w3", "rcall w3") else 0x204)
    assert rig.cycles_to() == 2


@pytest.mark.parametrize(
    ("skip", "next_", "taken", "cycles"),
    [
        ("btss w0, #0", "nop", 0, 1),
        ("btss w0, #0", "nop", 1, 2),
        ("btss w0, #0", "goto 0x400", 1, 3),
        ("btsc 0x1000, #0", "nop", 1, 1),
        ("btsc 0x1000, #0", "nop", 0, 2),
        ("btsc 0x1000, #0", "call 0x400", 0, 3),
        ("cpseq w0, w1", "nop", 0, 1),
        ("cpseq w0, w1", "nop", 1, 2),
        ("cpseq w0, w1", "do #1, 0x300", 1, 3),
    ],
)
def test_a_skip_costs_a_cycle_per_skipped_word(engine: str, skip: str, next_: str, taken: int, cycles: int) -> None:
    """isa.md §7.3, §13.1: a skip instruction takes 1 cycle without a skip, 2 if it skips one word, and 3 for two
    words."""
    rig = Rig(f"{skip}\nskipped: {next_}\nend: nop", engine, w0=taken, w1=1)
    rig.machine.poke(RAM, taken)
    label = "skipped" if cycles == 1 else "end"
    assert rig.cycles_to(label) == cycles


def test_a_divide_takes_nineteen_cycles(engine: str) -> None:
    """isa.md §6.7: a divide takes 19 cycles: REPEAT #17 plus 18 iterations."""
    rig = Rig("repeat #17\ndiv.u w4, w2\nend: nop", engine, w4=0x3000, w2=0x27)
    assert rig.cycles_to() == 19
    assert (rig.machine.w[0], rig.machine.w[1]) == (0x013B, 0x0003)


@pytest.mark.parametrize(("count", "cycles"), [(0, 2), (1, 3), (5, 7), (100, 102)])
def test_repeat_takes_one_cycle_and_runs_its_target_count_plus_one_times(engine: str, count: int, cycles: int) -> None:
    """isa.md §7.5, §13.1: REPEAT takes one cycle, and its target runs count + 1 times."""
    rig = Rig(f"repeat #{count}\ninc w0, w0\nend: nop", engine, w0=0)
    assert rig.cycles_to() == cycles
    assert rig.machine.w[0] == count + 1


def test_table_reads_under_repeat_take_two_cycles_each(engine: str) -> None:
    """isa.md §7.7, UNVERIFIED on silicon: table reads under REPEAT take two cycles each."""
    rig = Rig("repeat #3\ntblrdl [w1++], w2\nend: nop", engine, w1=0x400)
    assert rig.cycles_to() == 1 + 4 * 2
