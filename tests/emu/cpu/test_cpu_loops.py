"""REPEAT and DO: counting, nesting, early ends, and interrupts at every point (isa.md §7.5, §7.6)."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import Rig

ISR = "isr: inc 0x1100\nbclr 0x84, #3\nretfie"
DA, RA = 0x0200, 0x0010


def interrupted(engine: str, text: str, cycle: int, **w: int) -> Rig:
    rig = Rig(f"{text}\nend: nop\nhalt: bra halt\n{ISR}", engine, **w)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(cycle)
    rig.note("isr")
    return rig


def test_repeat_with_count_zero_is_a_nop(engine: str) -> None:
    """isa.md §7.5: REPEAT with count 0 runs its target once; RA stays 0."""
    rig = Rig("repeat #0\nmov 0x42, w1\nend: nop", engine)
    assert rig.cycles_to() == 2
    assert rig.machine.w[1] & RA == 0


def test_the_target_sees_the_counter_fall_to_zero(engine: str) -> None:
    """isa.md §7.5: the target reads RCOUNT = count in its first iteration and 0 in its last."""
    rig = Rig("mov #0x36, w1\nrepeat #3\nmov [w1], [w2++]\nend: nop", engine, w2=0x1000)
    rig.cycles_to()
    assert [rig.machine.peek(0x1000 + 2 * index) for index in range(4)] == [3, 2, 1, 0]


def test_repeat_takes_its_count_from_a_register(engine: str) -> None:
    """isa.md §7.5: REPEAT Wn takes its count from Wn<13:0>."""
    rig = Rig("repeat w3\ninc w0, w0\nend: nop", engine, w0=0, w3=0xC004)
    assert rig.cycles_to() == 6
    assert rig.machine.w[0] == 5


@pytest.mark.parametrize("cycle", range(0, 9))
def test_repeat_can_be_interrupted_between_any_two_iterations(engine: str, cycle: int) -> None:
    """isa.md §7.5, §14.3: REPEAT can be interrupted between any two iterations. REPEAT is in cycle 0, iterations in
    1..6; the handler starts at c + 4. The whole run takes 7 cycles, 3 for the entry, and the handler."""
    rig = interrupted(engine, "repeat #5\ninc w0, w0", cycle, w0=0)
    rig.machine.hook_pc(rig.labels["halt"], lambda: rig.machine.cycle > 10)
    rig.run()
    assert rig.first("isr") == cycle + 4
    assert rig.machine.w[0] == 6
    assert rig.machine.peek(0x1100) == 1


def test_an_interrupted_repeat_stacks_its_target_with_ra_set(engine: str) -> None:
    """isa.md §7.5: an interrupt under REPEAT stacks the target's PC and SRL with RA = 1, and clears RA in SR."""
    rig = interrupted(engine, "repeat #5\ninc w0, w0", 2, w0=0)
    rig.machine.hook_pc(rig.labels["isr"], lambda: True)
    rig.run()
    machine = rig.machine
    assert machine.peek(0x0900) == 0x202
    assert machine.peek(0x0902) & RA << 8
    assert machine.peek("SR") & RA == 0
    assert machine.peek("RCOUNT") == 3


def test_a_handler_ends_a_repeat_early_by_clearing_rcount(engine: str) -> None:
    """isa.md §7.5: if a handler clears RCOUNT, the target runs once more. Two iterations ran before (cycles 1, 2),
    one after."""
    rig = Rig("repeat #9\ninc w0, w0\nend: nop\nisr: bclr 0x84, #3\nclr 0x36\nretfie", engine, w0=0)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(2)
    rig.cycles_to()
    assert rig.machine.w[0] == 3


def test_a_handler_may_use_repeat_if_it_saves_rcount(engine: str) -> None:
    """isa.md §7.5: hardware does not save RCOUNT, so a handler that uses REPEAT must save it."""
    isr = "isr: bclr 0x84, #3\npush 0x36\nrepeat #2\ninc w1, w1\npop 0x36\nretfie"
    rig = Rig(f"repeat #9\ninc w0, w0\nend: nop\n{isr}", engine, w0=0, w1=0)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(4)
    rig.cycles_to()
    assert (rig.machine.w[0], rig.machine.w[1]) == (10, 3)


@pytest.mark.parametrize("cycle", range(0, 20))
def test_a_divide_survives_a_handler_that_divides(engine: str, cycle: int) -> None:
    """isa.md §6.7: a divide can be interrupted between any two iterations by a handler that divides, if it saves W0,
    W1 and RCOUNT."""
    isr = (
        "isr: bclr 0x84, #3\npush w0\npush w1\npush 0x36\nrepeat #17\ndiv.u w6, w7\nmov w0, w8\n"
        "pop 0x36\npop w1\npop w0\nretfie"
    )
    rig = Rig(f"repeat #17\ndiv.u w4, w2\nend: nop\nhalt: bra halt\n{isr}", engine, w4=0x3000, w2=0x27, w6=100, w7=7)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(cycle)
    rig.machine.run(120)
    assert (rig.machine.w[0], rig.machine.w[1], rig.machine.w[8]) == (0x013B, 0x0003, 14)


def test_a_do_loop_costs_nothing_per_iteration(engine: str) -> None:
    """isa.md §7.6: DO takes 2 cycles, runs its body count + 1 times, and takes no extra cycle at the end of an
    iteration."""
    rig = Rig("do #4, last\ninc w0, w0\nlast: inc w1, w1\nend: nop", engine, w0=0, w1=0)
    assert rig.cycles_to() == 2 + 5 * 2
    assert (rig.machine.w[0], rig.machine.w[1]) == (5, 5)
    assert rig.machine.peek("SR") & DA == 0
    assert rig.machine.peek("CORCON") == 0x0020


def test_a_do_loop_shows_its_level_and_registers(engine: str) -> None:
    """isa.md §7.6: in a DO loop DOSTART = PC + 4, DOEND and DCOUNT are set, DL = 1 and DA = 1."""
    rig = Rig("do #4, last\nbody: nop\nlast: nop\nend: nop", engine)
    rig.note("body", stop=True)
    rig.run()
    machine = rig.machine
    assert machine.peek("DOSTARTL") == rig.labels["body"]
    assert machine.peek("DOENDL") == rig.labels["last"]
    assert machine.peek("DCOUNT") == 4
    assert machine.peek("CORCON") >> 8 & 7 == 1
    assert machine.peek("SR") & DA


def test_do_loops_nest_once_in_hardware(engine: str) -> None:
    """isa.md §7.6: hardware nests two DO loops; shadow registers restore the outer one. 2 + 3 x (1 + 2 + 4 x 2 + 1)
    cycles."""
    text = "do #2, last\ninc w0, w0\ndo #3, inner\ninc w1, w1\ninner: inc w2, w2\nlast: inc w3, w3\nend: nop"
    rig = Rig(text, engine, w0=0, w1=0, w2=0, w3=0)
    assert rig.cycles_to() == 2 + 3 * (1 + 2 + 4 * 2 + 1)
    assert [rig.machine.w[number] for number in range(4)] == [3, 12, 12, 3]


@pytest.mark.parametrize(
    ("place", "rounds"),
    [("first", 1), ("middle", 1), ("penultimate", 2), ("last", 2)],
)
def test_edt_ends_the_loop_after_this_iteration_or_the_next(engine: str, place: str, rounds: int) -> None:
    """isa.md §7.6: EDT ends the loop after the current iteration, or after the next one if the penultimate or last
    instruction sets it."""
    body = dict.fromkeys(("first", "middle", "penultimate", "last"), "nop")
    body[place] = "mov w4, 0x44"
    text = "do #9, last\ninc w0, w0\n" + "\n".join(f"{name}: {statement}" for name, statement in body.items())
    rig = Rig(f"{text}\nend: nop", engine, w0=0, w4=0x0820)
    rig.cycles_to()
    assert rig.machine.w[0] == rounds
    assert rig.machine.peek("CORCON") == 0x0020


@pytest.mark.parametrize("cycle", range(0, 18))
def test_a_do_loop_can_be_interrupted_anywhere(engine: str, cycle: int) -> None:
    """isa.md §7.6: an interrupt at any place of a DO loop does not change DA, DL and the counters; the handler runs
    once, the loop five times."""
    text = "do #4, last\ninc w0, w0\nmov.d w4, w6\nlast: inc w1, w1"
    rig = interrupted(engine, text, cycle, w0=0, w1=0)
    rig.machine.run(100)
    assert (rig.machine.w[0], rig.machine.w[1], rig.machine.peek(0x1100)) == (5, 5, 1)
    assert rig.machine.peek("SR") & DA == 0


def test_a_handler_may_run_a_do_loop_of_its_own(engine: str) -> None:
    """isa.md §7.6: a handler may run its own DO loop while DL is at most 2."""
    isr = "isr: bclr 0x84, #3\ndo #2, isrlast\ninc w2, w2\nisrlast: inc w3, w3\nretfie"
    text = f"do #4, last\ninc w0, w0\nlast: inc w1, w1\nend: nop\nhalt: bra halt\n{isr}"
    rig = Rig(text, engine, w0=0, w1=0, w2=0, w3=0)
    rig.vector(0x1A, "isr")
    rig.interrupt_at(5)
    rig.machine.run(100)
    assert [rig.machine.w[number] for number in range(4)] == [5, 5, 3, 3]


def test_a_branch_out_leaves_the_loop_armed(engine: str) -> None:
    """isa.md §7.6: after a branch out of the loop, DA and DL stay set, and reaching DOEND later continues the loop."""
    text = "do #4, last\ninc w0, w0\nbra z, out\nlast: nop\nend: nop\nout: nop\nleft: bra last"
    rig = Rig(text, engine, w0=0xFFFF)
    rig.note("left", stop=True)
    rig.run()
    assert rig.machine.peek("SR") & DA
    rig.cycles_to()
    assert rig.machine.w[0] == 4


def test_repeat_inside_do(engine: str) -> None:
    """isa.md §7.6: REPEAT is allowed in a DO loop except at its end. 2 + 3 x (1 + 4 + 1) cycles."""
    rig = Rig("do #2, last\nrepeat #3\ninc w0, w0\nlast: inc w1, w1\nend: nop", engine, w0=0, w1=0)
    assert rig.cycles_to() == 2 + 3 * 6
    assert (rig.machine.w[0], rig.machine.w[1]) == (12, 3)


def test_the_last_instruction_may_move_the_loops_own_start(engine: str) -> None:
    """isa.md §7.6: if the last instruction changes DOSTARTL, the loop continues at the new address. 2 + 3 cycles,
    then four times the part from `from` on."""
    start = "mov #from, w2\ndo #4, last\ninc w0, w0\nfrom: inc w1, w1\nlast: mov w2, 0x3A\nend: nop"
    rig = Rig(start, engine, w0=0, w1=0)
    assert rig.cycles_to() == 1 + 2 + 3 + 4 * 2
    assert (rig.machine.w[0], rig.machine.w[1]) == (1, 5)


def test_the_last_instruction_may_change_the_count(engine: str) -> None:
    """isa.md §7.6: DCOUNT is read after the last instruction, which may change it."""
    rig = Rig("do #5, last\ninc w0, w0\nlast: lsr 0x38\nend: nop", engine, w0=0)
    rig.cycles_to()
    assert rig.machine.w[0] == 2  # 5 becomes 2, is decremented to 1, then to 0


def test_an_instruction_may_move_the_loops_end_to_itself(engine: str) -> None:
    """isa.md §7.6: DOEND is read after the instruction that writes it, which may make itself the last one: two
    instructions, three times."""
    text = "mov #here, w2\ndo #2, last\ninc w0, w0\nhere: mov w2, 0x3E\ninc w1, w1\nlast: nop\nend: nop"
    rig = Rig(text, engine, w0=0, w1=0)
    assert rig.cycles_to() == 1 + 2 + 3 * 2 + 2
    assert (rig.machine.w[0], rig.machine.w[1]) == (3, 1)
