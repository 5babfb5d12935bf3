"""Interrupts: acceptance, entry, and latency of requests in every cycle of every kind of instruction (isa.md §14).

The handler's first instruction executes in max(c + 4, e + 3), where c is the first cycle in which the flag is 1, and
e is the last cycle of the instruction that executes then.
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from emu.dspic30f.exceptions.power import DRAIN_CYCLES
from tests.emu.cpu.cpu_rig import RAM, STACK, TABLE, Rig

ISR = "isr: nop\nstay: bra stay"
T1_VECTOR, T1_ALTERNATE = 0x1A, 0x9A


def latency(engine: str, text: str, flag: int, window: bool = False, **w: int) -> tuple[int, int]:
    """Return the cycle of the handler's first instruction and the stacked PC as a label offset, for a flag that is 1
    from cycle `flag` on."""
    rig = Rig(f"{text}\nend: nop\nnop\nnop\nnop\nnop\n{ISR}", engine, **w)
    if window:
        rig.window(*range(0x10))
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(flag)
    start = rig.cycles_to("isr")
    stacked = rig.machine.peek(rig.machine.w[15] - 4)
    return start, stacked - rig.labels["end"]


@pytest.mark.parametrize(("flag", "start", "returns"), [(0, 4, 0), (1, 5, 2), (2, 6, 4)])
def test_into_one_cycle_instructions(engine: str, flag: int, start: int, returns: int) -> None:
    """isa.md §14.3, first column: an interrupt of one-cycle instructions has a latency of 4 cycles from the flag to
    the handler."""
    assert latency(engine, "nop", flag) == (start, returns)


@pytest.mark.parametrize(("flag", "start", "returns"), [(0, 4, 0), (1, 5, 0), (2, 6, 2)])
@pytest.mark.parametrize("statement", ["mov.d w0, w2", "tblrdl [w1], w2", "bra end", "call end", "goto end"])
def test_into_two_cycle_instructions(engine: str, statement: str, flag: int, start: int, returns: int) -> None:
    """isa.md §14.3, second column: an interrupt of a two-cycle instruction; a flag in its last cycle has the latency
    of the first column."""
    assert latency(engine, statement, flag) == (start, returns)


@pytest.mark.parametrize(("flag", "start"), [(0, 5), (1, 5), (2, 6)])
def test_into_a_skip_over_two_words(engine: str, flag: int, start: int) -> None:
    """isa.md §14.3: BTSS that skips two words occupies cycles 0..2, so e = 2."""
    assert latency(engine, "btss w0, #0\ngoto 0x400", flag, w0=1) == (start, 0)


@pytest.mark.parametrize(("flag", "start"), [(1, 5), (2, 6)])
def test_into_a_stalled_instruction(engine: str, flag: int, start: int) -> None:
    """isa.md §14.3: MOV in 0, stall in 1, MOV [W2] in 2. A flag in the stall cycle has e = 2, so the handler starts
    in max(5, 5)."""
    assert latency(engine, "mov #0x1000, w2\nmov [w2], w3", flag) == (start, 0)


@pytest.mark.parametrize(("flag", "start"), [(1, 6), (2, 6), (3, 7)])
def test_into_a_stalled_two_cycle_instruction(engine: str, flag: int, start: int) -> None:
    """isa.md §14.3: MOV.D [W2] with its stall occupies cycles 1..3; a flag in the stall cycle has a latency of one
    cycle more."""
    assert latency(engine, "mov #0x1000, w2\nmov.d [w2], w4", flag) == (start, 0)


@pytest.mark.parametrize(("flag", "start"), [(0, 4), (1, 5)])
def test_into_a_window_move(engine: str, flag: int, start: int) -> None:
    """isa.md §13.3, §14.3: MOV from the PSV window occupies cycles 0..1."""
    assert latency(engine, "mov [w1], w2", flag, window=True, w1=TABLE) == (start, 0)


@pytest.mark.parametrize(("flag", "start"), [(0, 5), (1, 5), (2, 6)])
@pytest.mark.parametrize("statement", ["add w0, [w1], w2", "mov.d [w1], w2"])
def test_into_a_three_cycle_window_read(engine: str, statement: str, flag: int, start: int) -> None:
    """isa.md §14.3: a window read of three cycles has e = 2, so one cycle of extra latency is possible."""
    assert latency(engine, statement, flag, window=True, w1=TABLE) == (start, 0)


@pytest.mark.parametrize(("flag", "start", "end"), [(0, 4, 7), (1, 5, 8), (2, 6, 9)])
def test_a_return_is_cut_to_two_cycles_by_a_pending_exception(engine: str, flag: int, start: int, end: int) -> None:
    """isa.md §13.1, §14.3: RETURN takes two cycles, 0..1, if a request is pending by cycle 1, otherwise three."""
    rig = Rig("return\nend: nop\nisr: bclr 0x84, #3\nretfie", engine, w15=STACK + 4)
    rig.machine.poke(STACK, rig.labels["end"])
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(flag)
    rig.note("isr")
    assert rig.cycles_to() == end + 1
    assert rig.first("isr") == start


def test_back_to_back_interrupts_execute_nothing_in_between(engine: str) -> None:
    """isa.md §14.3: between back-to-back interrupts no instruction executes. T1 runs in 4, its RETFIE in 5..6,
    shortened because INT0 is pending; INT0's handler starts in 6 + 3."""
    text = "nop\nend: nop\nisr: bclr 0x84, #3\nretfie\nother: bclr 0x84, #0\nretfie"
    rig = Rig(text, engine)
    rig.vector(T1_VECTOR, "isr")
    rig.vector(0x14, "other")
    rig.interrupt_at(0, irq=3, priority=4)
    rig.interrupt_at(2, irq=0, priority=4)
    rig.note("isr")
    rig.note("other")
    assert rig.cycles_to() == 9 + 1 + 3
    assert (rig.first("isr"), rig.first("other")) == (4, 9)


def test_entry_pushes_pc_and_status_and_raises_the_priority(engine: str) -> None:
    """isa.md §7.4, §14.2: an interrupt entry pushes PC and SRL and raises the CPU priority."""
    rig = Rig(f"nop\nend: nop\n{ISR}", engine)
    rig.machine.poke("SR", 0x010D)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0, priority=5)
    rig.cycles_to("isr")
    machine = rig.machine
    assert machine.w[15] == STACK + 4
    assert machine.peek(STACK) == rig.labels["end"]
    assert machine.peek(STACK + 2) == 0x0D00
    assert machine.peek("SR") == 0x01AD


def test_retfie_restores_status_and_priority(engine: str) -> None:
    """isa.md §7.4, §14.2: RETFIE restores SRL and IPL3 and does not change SRH."""
    rig = Rig("nop\nend: nop\nisr: bclr 0x84, #3\nadd w0, w0, w0\nretfie", engine, w0=0x8000)
    rig.machine.poke("SR", 0x0008)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0)
    rig.cycles_to()
    assert rig.machine.peek("SR") == 0x0008
    assert rig.machine.w[15] == STACK


@pytest.mark.parametrize(
    ("ipl", "priority", "accepted"),
    [(3, 4, True), (4, 4, False), (5, 4, False), (6, 7, True), (7, 7, False), (0, 0, False)],
)
def test_a_request_needs_more_than_the_cpu_priority(engine: str, ipl: int, priority: int, accepted: bool) -> None:
    """isa.md §14.1: a request is accepted only if its priority is higher than the CPU priority."""
    rig = Rig(f"nop\nloop: bra loop\n{ISR}", engine)
    rig.machine.poke("SR", ipl << 5)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0, priority=priority)
    rig.note("isr", stop=True)
    assert (rig.machine.run(50).reason == "breakpoint") == accepted


def test_the_higher_priority_wins_and_then_the_lower_number(engine: str) -> None:
    """isa.md §14.1: of several requests, the one with the highest priority is accepted, among equals the one with the
    lowest number."""
    text = "nop\nloop: bra loop\nint0: bclr 0x84, #0\nretfie\nt1: bclr 0x84, #3\nretfie\nt2: bclr 0x84, #6\nretfie"
    rig = Rig(text, engine)
    for irq, (vector, label, priority) in {0: (0x14, "int0", 3), 3: (0x1A, "t1", 5), 6: (0x20, "t2", 5)}.items():
        rig.vector(vector, label)
        rig.interrupt_at(10, irq=irq, priority=priority)
        rig.note(label)
    rig.run(100)
    assert [label for label, _cycle in rig.arrivals] == ["t1", "t2", "int0"]


def test_a_higher_request_preempts_a_handler(engine: str) -> None:
    """isa.md §14.1: nesting: INT0 (priority 5) interrupts the handler of T1 (priority 3) in its second instruction."""
    text = "nop\nloop: bra loop\nt1: nop\nsecond: nop\nthird: nop\nbra third\nint0: nop\nstay: bra stay"
    rig = Rig(text, engine)
    rig.vector(0x1A, "t1")
    rig.vector(0x14, "int0")
    rig.interrupt_at(0, irq=3, priority=3)
    rig.interrupt_at(5, irq=0, priority=5)
    assert rig.cycles_to("int0") == 9
    assert rig.machine.peek(rig.machine.w[15] - 4) == rig.labels["third"]


def test_without_nesting_every_handler_runs_at_priority_seven(engine: str) -> None:
    """isa.md §14.1: with NSTDIS = 1, every interrupt sets IPL to 7, and SR<7:5> is read-only."""
    rig = Rig("nop\nloop: bra loop\nisr: clr 0x42\nhere: nop\nstay: bra stay", engine)
    rig.machine.poke("INTCON1", 0x8000)
    rig.vector(T1_VECTOR, "isr")
    rig.vector(0x14, "isr")
    rig.interrupt_at(0, priority=2)
    rig.cycles_to("here")
    assert rig.machine.peek("SR") == 0x00E0


def test_the_alternate_table(engine: str) -> None:
    """isa.md §14.2: ALTIVT selects the alternate vector table, in which T1 is at 0x9A."""
    rig = Rig(f"nop\nloop: bra loop\n{ISR}", engine)
    rig.machine.poke("INTCON2", 0x8000)
    rig.vector(T1_ALTERNATE, "isr")
    rig.interrupt_at(0)
    assert rig.cycles_to("isr") == 4


def test_a_flag_set_by_software_is_seen_one_cycle_later(engine: str) -> None:
    """isa.md §14.3, engines.md §4.2: BSET IFS0 in cycle 0 makes the flag 1 in c = 1; NOP runs in 1, and the handler
    starts in 5."""
    rig = Rig(f"bset 0x84, #3\nnop\nend: nop\n{ISR}", engine)
    rig.vector(T1_VECTOR, "isr")
    rig.enable(3, 4)
    assert rig.cycles_to("isr") == 5
    assert rig.machine.peek(STACK) == rig.labels["end"]


@pytest.mark.parametrize("opening", ["bset 0x8C, #3", "clr 0x42", "clr 0x42\nnop"])
def test_what_an_instruction_opens_counts_at_the_boundary_after_it(engine: str, opening: str) -> None:
    """isa.md §14.3 [unsure]: if a write of IEC or IPL in cycle 1 enables a pending request, the handler starts in e +
    3 = 4."""
    rig = Rig(f"nop\n{opening}\nend: nop\n{ISR}", engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0)
    if opening.startswith("bset"):
        rig.machine.poke("IEC0", 0)
    else:
        rig.machine.poke("SR", 0x00E0)
    assert rig.cycles_to("isr") == 4


@pytest.mark.parametrize(("slip", "taken"), [(0, False), (1, True)])
@pytest.mark.parametrize("closing", ["mov w0, 0x42", "bclr 0x8C, #3"])
def test_what_an_instruction_closes_counts_at_once_or_with_slip_one_boundary_later(
    engine: str, slip: int, taken: bool, closing: str
) -> None:
    """isa.md §14.3 [unsure]: if the flag rises in the cycle of a write that raises IPL or clears IEC, the request is
    blocked at once, or with `ipl_slip` one boundary later."""
    rig = Rig(f"nop\n{closing}\nend: nop\nloop: bra loop\n{ISR}", engine, ipl_slip=slip, w0=0x00E0)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(1)
    rig.note("isr", stop=True)
    stop = rig.machine.run(60)
    assert (stop.reason == "breakpoint") == taken
    assert not taken or stop.cycle == 5


@pytest.mark.parametrize(("count", "start"), [(0, 4), (1, 5), (2, 6), (5, 9)])
def test_disi_blocks_its_own_cycle_and_the_next_ones(engine: str, count: int, start: int) -> None:
    """isa.md §12, §14.3: DISI #k in cycle 0 blocks cycles 0..k; the NOP in k + 1 is the last instruction before the
    handler, which starts in k + 1 + 3."""
    rig = Rig(f"disi #{count}\n" + "nop\n" * 12 + ISR, engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0)
    assert rig.cycles_to("isr") == start


def test_a_second_disi_replaces_the_count(engine: str) -> None:
    """isa.md §12: a second DISI replaces the count. DISI #1000 in 0, request in 1; DISI #2 in 3 blocks 3..5; NOP in
    6, handler in 6 + 3."""
    rig = Rig("disi #1000\nnop\nnop\ndisi #2\n" + "nop\n" * 12 + ISR, engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(1)
    assert rig.cycles_to("isr") == 9


def test_priority_seven_ignores_disi(engine: str) -> None:
    """isa.md §12: DISI does not block an interrupt of priority 7."""
    rig = Rig("disi #100\n" + "nop\n" * 12 + ISR, engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(2, priority=7)
    assert rig.cycles_to("isr") == 6


def test_disicnt_counts_down_and_can_be_ended(engine: str) -> None:
    """isa.md §12: after DISI #k in cycle 0, DISICNT reads k in 1 and k - 1 in 2, and INTCON2<14> is set. Writing 0
    ends the block at once: CLR in 4, handler in 4 + 3."""
    rig = Rig(f"disi #20\nmov 0x52, w1\nmov 0x52, w2\nmov 0x82, w3\nclr 0x52\nend: nop\n{ISR}", engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(1)
    assert rig.cycles_to("isr") == 7
    assert (rig.machine.w[1], rig.machine.w[2], rig.machine.w[3]) == (20, 19, 0x4000)
    assert rig.machine.peek("DISICNT") == 0


def test_multi_cycle_instructions_count_all_their_cycles_against_disi(engine: str) -> None:
    """isa.md §12: DISI counts cycles, not instructions. DISI #4 in 0 blocks 0..4; GOTO 1..2, GOTO 3..4, NOP 5,
    handler in 8."""
    rig = Rig(f"disi #4\ngoto a\na: goto b\nb: nop\nnop\nnop\n{ISR}", engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(0)
    assert rig.cycles_to("isr") == 8


@pytest.mark.parametrize("flag", range(0, 8))
def test_a_read_in_the_same_cycle_sees_the_flag(engine: str, flag: int) -> None:
    """engines.md §4.2: an event due in cycle t is applied before accesses of t. IFS0 is read in cycles 0, 2, 4, 6."""
    rig = Rig("\n".join(["mov 0x84, w0\nmov w0, [w14++]"] * 4) + "\nend: nop", engine, w14=RAM)
    rig.interrupt_at(flag)
    rig.machine.poke("IEC0", 0)
    rig.cycles_to()
    seen = [bool(rig.machine.peek(RAM + 2 * index)) for index in range(4)]
    assert seen == [2 * index >= flag for index in range(4)]


def test_of_two_accesses_the_first_comes_one_cycle_earlier(engine: str) -> None:
    """engines.md §4.2: MOV.D reads its low word in e - 1. MOV.D in 0..1 reads IFS0 and IFS1; both flags rise in 1, so
    only IFS1 has its flag."""
    rig = Rig("mov.d [w1], w2\nend: nop", engine, w1=0x84)
    rig.interrupt_at(1, irq=3)
    rig.interrupt_at(1, irq=16)
    rig.machine.poke("IEC0", 0)
    rig.machine.poke("IEC1", 0)
    rig.cycles_to()
    assert (rig.machine.w[2], rig.machine.w[3]) == (0, 1)


@pytest.mark.parametrize(("wake", "start"), [(10, 14), (1, 5), (3, 7)])
def test_out_of_idle(engine: str, wake: int, start: int) -> None:
    """isa.md §11, §14.3: on wake-up from Idle, the waking cycle counts as an instruction's, so the handler starts in
    c + 4."""
    rig = Rig(f"pwrsav #1\nend: nop\n{ISR}", engine)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(wake)
    assert rig.cycles_to("isr") == start
    assert rig.machine.peek(STACK) == rig.labels["end"]
    assert rig.machine.peek("RCON") & 4


def test_an_interrupt_below_the_cpu_priority_wakes_without_a_handler(engine: str) -> None:
    """isa.md §11: a request not above the CPU priority wakes the CPU without a handler; execution continues after
    PWRSAV in the cycle after the flag rose."""
    rig = Rig(f"pwrsav #1\nend: nop\n{ISR}", engine)
    rig.machine.poke("SR", 0x00E0)
    rig.vector(T1_VECTOR, "isr")
    rig.interrupt_at(10)
    assert rig.cycles_to() == 11


def test_a_request_that_waits_makes_pwrsav_a_nop(engine: str) -> None:
    """isa.md §11: PWRSAV is a NOP if the wake-up condition is already true."""
    rig = Rig(f"nop\npwrsav #1\nend: nop\n{ISR}", engine)
    rig.machine.poke("SR", 0x00E0)
    rig.interrupt_at(0)
    assert rig.cycles_to() == 2


def test_sleeping_with_nothing_to_wake_it_halts(engine: str) -> None:
    """engines.md §10: if nothing can wake a sleeping CPU, the run ends."""
    rig = Rig("pwrsav #0\nend: nop", engine)
    stop = rig.run(1000)
    assert (stop.reason, stop.pc) == ("halt", rig.labels["end"])


def test_idling_beside_a_timer_that_interrupts_nobody_halts(engine: str) -> None:
    """engines.md §10: Idle beside a timer whose interrupt is disabled ends the run, because nothing can wake the
    CPU."""
    rig = Rig("mov w0, 0x102\nmov w1, 0x104\npwrsav #1\nend: nop", engine, w0=99, w1=0x8000)
    stop = rig.run(20_000_000)
    assert (stop.reason, stop.pc) == ("halt", rig.labels["end"])
    assert stop.cycle <= 1_001_000


@pytest.mark.parametrize("part", [70_000, 999_999, 30_000_000])
def test_the_cycle_of_a_halt_does_not_depend_on_the_parts_of_a_run(engine: str, part: int) -> None:
    """Any division of the run halts at the same cycle; the timer's next event is due after 16.8 million cycles."""
    rig = Rig("mov w0, 0x102\nmov w1, 0x104\npwrsav #1\nend: nop", engine, w0=0xFFFF, w1=0x8030)
    stop = rig.machine.run(cycles=part)
    while stop.reason == "limit":
        stop = rig.machine.run(cycles=part)
    assert (stop.reason, stop.pc, stop.cycle) == ("halt", rig.labels["end"], 2 + DRAIN_CYCLES)


def test_a_timer_interrupt_comes_with_its_period(engine: str) -> None:
    """isa.md §14.3: a timer interrupts every PR + 1 cycles, and in NOPs each handler starts 4 cycles after its flag."""
    rig = Rig("mov w0, 0x102\nmov w1, 0x104\n" + "nop\n" * 400 + "isr: bclr 0x84, #3\nretfie", engine, w0=49, w1=0x8000)
    rig.vector(T1_VECTOR, "isr")
    rig.enable(3, 4)
    rig.note("isr")
    rig.run(260)
    starts = [cycle for _label, cycle in rig.arrivals]
    assert len(starts) >= 4
    assert {later - sooner for sooner, later in pairwise(starts)} == {50}
