"""Traps, and resets that the core causes: causes, timing, priorities, conflicts (isa.md §10, §14.4, §14.6)."""

from __future__ import annotations

import pytest

from tests.emu.cpu.cpu_rig import RAM, STACK, START, Rig

OSCILLATOR, ADDRESS, STACK_ERROR, MATH = 0x06, 0x08, 0x0A, 0x0C
OSCFAIL, STKERR, ADDRERR, MATHERR = 2, 4, 8, 16
HANDLER = "trap: nop\nstay: bra stay"


def trapped(engine: str, text: str, vector: int, **w: int) -> Rig:
    rig = Rig(f"{text}\nend: nop\nnop\nnop\nnop\nhold: bra hold\n{HANDLER}", engine, **w)
    rig.vector(vector, "trap")
    return rig


def stacked(rig: Rig) -> int:
    """Return the handler's return address relative to `end`."""
    top = rig.machine.w[15]
    return (rig.machine.peek(top - 2) & 0x7F) << 16 | rig.machine.peek(top - 4) - rig.labels["end"]


@pytest.mark.parametrize(
    ("statement", "w1"),
    [
        ("mov [w1], w2", RAM + 1),  # cause 1: odd address in a word read
        ("mov w0, [w1]", RAM + 1),
        ("mov.d [w1], w2", RAM + 1),
        ("mac w4*w5, a, [w8]+=2, w4", 0),
        ("bset [w1], #3", RAM + 1),  # cause 2
        ("mov [w1], w2", 0x2800),  # cause 3
        ("mov w0, [w1]", 0x2800),
        ("mov.b [w1], w2", 0x7FFF),
        ("mov [w1], w2", 0x8000),
        ("mov w0, 0x2800", 0),
    ],
)
def test_address_errors_trap_at_once(engine: str, statement: str, w1: int) -> None:
    """isa.md §14.4: an address error is a hard trap of level 13: c = e, the handler starts in e + 4, and the stacked
    PC is the following instruction."""
    cycles = 2 if statement.startswith("mov.d") else 1
    rig = trapped(engine, statement, ADDRESS, w1=w1, w8=RAM + 1)
    assert rig.cycles_to("trap") == cycles - 1 + 4
    assert stacked(rig) == 0
    assert rig.machine.peek("INTCON1") == ADDRERR
    assert rig.machine.peek("SR") >> 5 & 7 == 13 - 8
    assert rig.machine.peek("CORCON") & 8


def test_a_faulting_instruction_writes_nothing_but_completes(engine: str) -> None:
    """isa.md §14.4: an instruction with an address error writes no data but updates pointers and registers."""
    rig = trapped(engine, "mov [w1++], [w2++]", ADDRESS, w1=RAM + 1, w2=RAM + 0x100)
    rig.machine.poke(RAM + 0x100, 0x5555)
    rig.machine.poke(RAM, 0x1234)
    rig.cycles_to("trap")
    assert rig.machine.peek(RAM + 0x100) == 0x5555
    assert (rig.machine.w[1], rig.machine.w[2]) == (RAM + 3, RAM + 0x102)


def test_a_double_store_that_leaves_memory_writes_neither_word(engine: str) -> None:
    """isa.md §14.4, engines.md §4.1: a double store that leaves memory writes neither word, because all addresses are
    checked before the first access."""
    rig = trapped(engine, "mov.d w2, [w1]", ADDRESS, w1=0x27FE, w2=1)
    rig.cycles_to("trap")
    assert rig.machine.peek(0x27FE) == 0


@pytest.mark.parametrize("target", [0x018000, 0x000004, 0x0000FE])
def test_jumping_where_no_instruction_can_be_is_an_address_error(engine: str, target: int) -> None:
    """isa.md §14.4, causes 4 and 5: a jump to an address without an instruction is an address error: GOTO in 0..1,
    handler in 1 + 4; the target is stacked."""
    rig = trapped(engine, f"goto {target}", ADDRESS)
    assert rig.cycles_to("trap") == 5
    assert stacked(rig) + rig.labels["end"] == target


def test_the_first_push_beyond_the_limit_traps_softly(engine: str) -> None:
    """isa.md §10.2, §14.4: a push at SPLIM is legal; the next one is a soft trap: PUSH in 1, c = 2, one NOP, handler
    in 6."""
    rig = trapped(engine, "push w0\npush w0\nnext: nop", STACK_ERROR)
    rig.machine.write("SPLIM", STACK)
    assert rig.cycles_to("trap") == 6
    assert stacked(rig) == 0
    assert rig.machine.peek("INTCON1") & STKERR
    assert rig.machine.peek(STACK + 2) == rig.machine.w[0]  # the faulting access is executed


def test_the_limit_is_armed_by_a_word_write_only(engine: str) -> None:
    """isa.md §10.2: only a word write to SPLIM arms the stack limit."""
    rig = trapped(engine, "push w0\npush w0", STACK_ERROR)
    rig.machine.write("SPLIM", STACK & 0xFF, size=1)
    rig.cycles_to("end")
    assert rig.machine.peek("INTCON1") == 0


@pytest.mark.parametrize(
    ("statement", "w15"),
    [("pop w0", 0x0800), ("mov [w15], w0", 0x07FE), ("mov [w15-0x10], w0", 0x0800), ("return", 0x0802)],
)
def test_stack_underflow_is_always_checked(engine: str, statement: str, w15: int) -> None:
    """isa.md §10.1, §10.4: stack underflow is always checked."""
    rig = trapped(engine, f"{statement}\nnop\nnop", STACK_ERROR, w15=w15)
    rig.note("trap", stop=True)
    rig.run(20)
    assert rig.machine.peek("INTCON1") & STKERR


def test_a_stack_error_of_a_return_counts_from_its_last_cycle(engine: str) -> None:
    """isa.md §14.4: a stack error of RETURN is a soft trap that counts from its last cycle: RETURN in 0..2, c = 3,
    one NOP, handler in 7."""
    rig = trapped(engine, "return\nback: nop", STACK_ERROR, w15=0x0802)
    rig.machine.poke(0x07FE, rig.labels["back"])
    rig.machine.poke(0x0800, 0)
    assert rig.cycles_to("trap") == 7


def test_arithmetic_on_the_stack_pointer_is_not_checked(engine: str) -> None:
    """isa.md §10.4: arithmetic on W15 is not checked against the stack limit."""
    rig = trapped(engine, "mov #0x0700, w15\nadd w15, #8, w15\nmov #0x0900, w15", STACK_ERROR)
    assert rig.cycles_to("end") == 3
    assert rig.machine.peek("INTCON1") == 0


def test_divide_by_zero_stacks_the_divide(engine: str) -> None:
    """isa.md §6.7, §14.4: division by zero: first iteration in cycle 1, c = 2, one more iteration, handler in 6. The
    divide is stacked; RA and RCOUNT are kept."""
    rig = trapped(engine, "repeat #17\ndiv.u w4, w2", MATH, w2=0)
    assert rig.cycles_to("trap") == 6
    assert stacked(rig) == -2
    assert rig.machine.peek(rig.machine.w[15] - 2) & 0x1000  # RA in the stacked SRL
    assert rig.machine.peek("RCOUNT") == 15
    assert rig.machine.peek("INTCON1") == MATHERR


def test_a_shift_beyond_sixteen_is_a_math_error(engine: str) -> None:
    """isa.md §8.5: an accumulator shift by more than 16 is a math error and leaves the accumulator unchanged."""
    rig = trapped(engine, "sftac a, w2\nnop", MATH, w2=17)
    rig.machine.poke("ACCAL", 0x1234)
    assert rig.cycles_to("trap") == 5
    assert rig.machine.peek("ACCAL") == 0x1234


@pytest.mark.parametrize(("enable", "traps"), [(0x0400, True), (0x0200, False), (0, False)])
def test_accumulator_overflow_traps_if_enabled(engine: str, enable: int, traps: bool) -> None:
    """isa.md §8.5, §14.4: OVATE enables the trap on overflow of ACCA. The condition persists, so clearing the flag
    alone does not end the trap."""
    rig = trapped(engine, "add a\nnop", MATH)
    rig.machine.poke("INTCON1", enable)
    rig.machine.poke("ACCAH", 0x7FFF)
    rig.machine.poke("ACCBH", 0x7FFF)
    rig.note("trap", stop=True)
    assert (rig.run(30).reason == "breakpoint") == traps
    rig.machine.write("INTCON1", enable)
    assert bool(rig.machine.peek("INTCON1") & MATHERR) == traps


def test_a_trap_is_not_masked_by_disi_or_priority_seven(engine: str) -> None:
    """isa.md §14.1: neither DISI nor CPU priority 7 masks a trap."""
    rig = trapped(engine, "disi #100\nmov [w1], w2", ADDRESS, w1=RAM + 1)
    rig.machine.poke("SR", 0x00E0)
    assert rig.cycles_to("trap") == 5


def test_a_flag_left_set_enters_again_after_retfie(engine: str) -> None:
    """isa.md §14.4: if the handler does not clear the trap flag, the trap is entered again after RETFIE."""
    rig = Rig("mov [w1], w2\nend: nop\ntrap: inc w3, w3\nretfie", engine, w1=RAM + 1, w3=0)
    rig.vector(ADDRESS, "trap")
    rig.machine.run(100)
    assert rig.machine.w[3] > 5


def test_a_higher_trap_interrupts_a_lower_one(engine: str) -> None:
    """isa.md §14.4: an address error in the handler of a math error is taken at once, because its level is higher."""
    text = "repeat #17\ndiv.u w4, w2\nend: nop\nmath: mov [w1], w3\nnop\naddr: nop\nstay: bra stay"
    rig = Rig(text, engine, w1=RAM + 1, w2=0)
    rig.vector(MATH, "math")
    rig.vector(ADDRESS, "addr")
    assert rig.cycles_to("addr") == 6 + 4
    assert rig.machine.peek("SR") >> 5 & 7 == 13 - 8


def test_a_lower_trap_waits_for_a_higher_one(engine: str) -> None:
    """isa.md §14.4: a stack error raised in the handler of an address error is taken after that handler."""
    text = (
        "mov [w1], w2\nend: nop\nstay: bra stay\naddr: bclr 0x80, #3\nmov w0, [w15]\nnop\nretfie\n"
        "stack: mov w4, 0x20\nbclr 0x80, #2\nretfie"
    )
    rig = Rig(text, engine, w1=RAM + 1, w4=0x1F00)
    rig.vector(ADDRESS, "addr")
    rig.vector(STACK_ERROR, "stack")
    rig.machine.write("SPLIM", STACK + 2)
    rig.note("addr")
    rig.note("stack")
    rig.run(60)
    assert [label for label, _cycle in rig.arrivals] == ["addr", "stack"]


def test_an_oscillator_failure_enters_after_the_current_instruction(engine: str) -> None:
    """isa.md §14.4: an oscillator failure (level 14, hard), raised by a device event in cycle 5, is entered after the
    current instruction."""
    rig = trapped(engine, "nop\n" * 12, OSCILLATOR)
    rig.at(5, lambda: rig.machine.core.traps.request_flag("OSCFAIL"))
    assert rig.cycles_to("trap") == 9
    assert rig.machine.peek("SR") >> 5 & 7 == 14 - 8


def test_an_address_error_below_an_oscillator_failure_resets(engine: str) -> None:
    """isa.md §14.4, §14.6: an address error in the handler of an oscillator failure is a trap conflict: the chip
    resets with RCON.TRAPR, and the run stops at the faulting address."""
    rig = Rig("nop\n" * 10 + "osc: nop\nculprit: mov [w1], w2\nnop", engine, w1=RAM + 1)
    rig.vector(OSCILLATOR, "osc")
    rig.at(2, lambda: rig.machine.core.traps.request_flag("OSCFAIL"))
    stop = rig.run(50)
    assert (stop.reason, stop.pc) == ("fault", rig.labels["culprit"])
    assert rig.machine.peek("RCON") & 0x8000
    assert rig.machine.pc == 0


@pytest.mark.parametrize("word", [0x3F0000, 0xDB1234, 0x0A0000, 0xF40000])
def test_an_illegal_opcode_resets(engine: str, word: int) -> None:
    """isa.md §4.1, §14.6: an illegal opcode resets with RCON.IOPUWR; the run stops at the faulting address."""
    rig = Rig(f"nop\nbad: .word {word}\nnop", engine)
    stop = rig.run()
    assert (stop.reason, stop.pc, stop.cycle) == ("fault", rig.labels["bad"], 2)
    assert f"{word:06X}" in stop.detail
    assert rig.machine.peek("RCON") & 0x4000
    assert rig.machine.w[15] == 0x0800


def test_an_uninitialised_pointer_resets(engine: str) -> None:
    """isa.md §2.2: use of an uninitialised pointer resets. A word write initialises a W register, a byte write does
    not."""
    rig = Rig("mov.b #0x10, w1\nbad: mov [w1], w2\nnop", engine)
    rig.machine.state.initialised &= ~2
    stop = rig.run()
    assert (stop.reason, stop.pc) == ("fault", rig.labels["bad"])
    assert "W1" in stop.detail
    assert rig.machine.peek("RCON") & 0x4000


@pytest.mark.parametrize("writing", ["mov #0x1000, w1", "mov w0, 0x0002", "pop.s"])
def test_what_initialises_a_register(engine: str, writing: str) -> None:
    """isa.md §2.2: a register is initialised by word writes; UNVERIFIED for the memory-mapped write and POP.S."""
    rig = Rig(f"push.s\n{writing}\nmov.b [w1], w2\nend: nop", engine, w0=RAM)
    rig.machine.state.initialised &= ~2
    rig.cycles_to()


def test_the_check_of_pointers_can_be_turned_off(engine: str) -> None:
    """isa.md §2.2: an option of the emulator turns the check for uninitialised pointers off."""
    rig = Rig("mov [w1], w2\nend: nop", engine)
    rig.machine.state.check_pointers = False
    rig.machine.program.put_flash(0, [0x040000 | START, 0])
    rig.machine.reset("EXTR")
    assert rig.cycles_to() == 3


@pytest.mark.parametrize("word", [0xDA4000, 0xDAC000])
def test_debugger_words_stop_the_run_and_fall_through(engine: str, word: int) -> None:
    """isa.md §4.1, engines.md §10: a debugger word stops the run; a continued run executes the next instruction."""
    rig = Rig(f"mov #7, w0\nbrk: .word {word}\nend: nop", engine)
    stop = rig.run()
    assert (stop.reason, stop.pc) == ("breakpoint", rig.labels["brk"])
    assert rig.machine.w[0] == 7
    assert rig.cycles_to() == 2


def test_the_reset_instruction(engine: str) -> None:
    """isa.md §9, §11, §14.6: RESET sets RCON.SWR, resets the core state and keeps RAM; the GOTO at 0 takes two
    cycles."""
    rig = Rig("mov #0x1234, w3\nmov w3, 0x1000\nreset\nagain: nop", engine)
    rig.machine.program.put_flash(0, [0x040000 | rig.labels["again"], 0])
    assert rig.cycles_to("again") == 3 + 2
    machine = rig.machine
    assert machine.peek("RCON") & 0x40
    assert (machine.w[3], machine.w[15]) == (0, 0x0800)
    assert machine.peek(0x1000) == 0x1234
    assert machine.peek("CORCON") == 0x0020
    assert machine.state.initialised == 0x8000


def test_a_run_may_go_on_over_faults(engine: str) -> None:
    """isa.md §14.6: with `stop_on_fault` off, a fault resets the device and the run continues."""
    rig = Rig("bad: .word 0x3F0000", engine)
    rig.machine.stop_on_fault = False
    rig.machine.program.put_flash(0, [0x040000 | START, 0])
    assert rig.run(30).reason == "limit"
    assert len(rig.machine.resets) > 5
