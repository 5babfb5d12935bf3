"""The machine around the CPU: hooks, stops, resets, self-programming, divided runs."""

from __future__ import annotations

import pytest

from emu.machine.machine import Machine
from tests.emu.cpu.cpu_rig import RAM, START, Rig


def test_an_unknown_engine_is_refused() -> None:
    """Engine contract: an unknown engine name is refused."""
    with pytest.raises(ValueError, match="warp"):
        Machine(engine="warp")


def test_a_pc_hook_sees_every_arrival_with_its_cycle(engine: str) -> None:
    """Engine contract: a PC hook is called with the cycle of every arrival, also in the middle of translated code."""
    rig = Rig("loop: inc w0, w0\nmid: inc w1, w1\nbra loop", engine, w0=0, w1=0)
    rig.note("mid")
    rig.machine.run(40)
    assert [cycle for _label, cycle in rig.arrivals] == list(range(1, 40, 4))


def test_a_removed_hook_is_not_called(engine: str) -> None:
    """Engine contract: a removed hook is not called."""
    rig = Rig("loop: inc w0, w0\nmid: inc w1, w1\nbra loop", engine, w0=0, w1=0)
    calls = []
    remove = rig.machine.hook_pc(rig.labels["mid"], lambda: calls.append(rig.machine.cycle))
    rig.machine.run(8)
    remove()
    rig.machine.run(80)
    assert calls == [1, 5]


def test_a_stop_at_a_hook_resumes_behind_it(engine: str) -> None:
    """Engine contract: after a stop at a hook, the run continues with the hooked instruction."""
    rig = Rig("loop: inc w0, w0\nmid: inc w1, w1\nbra loop", engine, w0=0, w1=0)
    rig.note("mid", stop=True)
    assert [rig.run().cycle for _ in range(3)] == [1, 5, 9]


def test_an_sfr_hook_sees_accesses_with_values_and_cycles(engine: str) -> None:
    """Engine contract: an SFR hook is called in the cycle of the access, with its value."""
    rig = Rig("nop\nmov w0, 0x2CA\nmov 0x2CA, w1\nbset 0x2CA, #3\nend: nop", engine, w0=0x0100)
    seen = []
    rig.machine.hook_sfr("LATB", lambda write, word: seen.append((rig.machine.events.now, write, word)))
    rig.cycles_to()
    assert seen == [(1, True, 0x0100), (2, False, 0x0100), (3, False, 0x0100), (3, True, 0x0108)]


def test_a_sleeping_run_can_be_ended_from_outside(engine: str) -> None:
    """Engine contract: `interrupt` ends a run also while the CPU sleeps."""
    rig = Rig("mov w0, 0x102\nmov w1, 0x104\npwrsav #1\nend: nop", engine, w0=99, w1=0x8000)
    rig.enable(6, 4)
    rig.at(5000, rig.machine.interrupt)
    stop = rig.machine.run(10_000_000)
    assert (stop.reason, stop.cycle) == ("interrupted", 5000)


@pytest.mark.parametrize("kind", ["address", "condition"])
def test_a_run_ends_where_it_is_told(engine: str, kind: str) -> None:
    """Engine contract: `run(until=...)` ends at the address, or when the condition holds, with the reason "until"."""
    rig = Rig("loop: inc w0, w0\nmid: inc w1, w1\nbra loop", engine, w0=0, w1=0)
    machine = rig.machine
    until = rig.labels["mid"] if kind == "address" else lambda: machine.w[0] == 1
    stop = machine.run(until=until)
    assert (stop.reason, stop.cycle) == ("until", 1)
    assert machine.run(cycles=100, until=until if kind == "address" else lambda: machine.w[1] == 1).cycle in (2, 5)


def test_a_run_ends_at_the_first_boundary_at_or_behind_its_limit(engine: str) -> None:
    """Engine contract: a run ends at the first boundary at or after its limit, here between GOTOs of two cycles."""
    rig = Rig("loop: goto loop", engine)
    assert [rig.machine.run(5).cycle for _ in range(3)] == [6, 12, 18]


def test_a_run_can_be_ended_from_outside(engine: str) -> None:
    """Engine contract: `interrupt` ends a run with the reason "interrupted"."""
    rig = Rig("loop: inc w0, w0\nbra loop", engine)
    rig.at(500, rig.machine.interrupt)
    stop = rig.machine.run(10_000)
    assert stop.reason == "interrupted"
    assert 500 <= stop.cycle <= 505


def test_a_loop_of_resets_is_a_fault(engine: str) -> None:
    """Engine contract: an endless loop of RESET instructions is a fault."""
    rig = Rig("again: nop\nreset", engine)
    rig.machine.program.put_flash(0, [0x040000 | START, 0])
    stop = rig.machine.run(1000)
    assert stop.reason == "fault"
    assert "reset loop" in stop.detail
    assert len(rig.machine.resets) > 5


def test_the_watchdog_resets_a_program_that_does_not_clear_it(engine: str) -> None:
    """dspic30f6014a.md §4: the watchdog resets after 2 ms with both prescalers at 1, unless CLRWDT clears it in
    time."""
    for statement, expired in (("nop", True), ("clrwdt", False)):
        rig = Rig(f"loop: {statement}\nbra loop", engine)
        rig.machine.program.put(0xF80002, 0x8000)
        rig.machine.program.put_flash(0, [0x040000 | START, 0])
        rig.machine.reset("POR")
        rig.machine.run(40_000)
        assert bool(rig.machine.peek("RCON") & 0x10) == expired


def test_programs_may_rewrite_themselves(engine: str) -> None:
    """dspic30f6014a.md §16: a program can erase and program a flash row whose code has been executed before.

    The row at 0x400 holds `inc w0, w0; return`; the program replaces it by `dec w0, w0; return`.
    """
    text = """
        mov #0x000, w3 | call 0x400 | call 0x400 | call 0x400 | call 0x400 | call 0x400 | mov w0, 0x1000
        mov #0x0, w1 | mov w1, 0x32 | mov #0x400, w2 | tblwtl w2, [w2] | mov #0x4041, w4 | rcall burn
        tblwtl w6, [w2] | tblwth w7, [w2] | mov #0x402, w3 | tblwtl w8, [w3] | tblwth w9, [w3]
        mov #0x4001, w4 | rcall burn | call 0x400 | call 0x400
        end: nop
        burn: mov w4, 0x760 | mov #0x55, w5 | mov w5, 0x766 | mov #0xAA, w5 | mov w5, 0x766
        bset 0x760, #15 | nop | nop | return
    """
    rig = Rig(text, engine, w0=0, w6=0x0000, w7=0xE9, w8=0x0000, w9=0x06)
    rig.machine.program.put_flash(0x400, [0xE80000, 0x060000])
    rig.note("end", stop=True)
    assert rig.machine.run(500_000).reason == "breakpoint"
    assert rig.machine.peek(0x1000) == 5
    assert rig.machine.w[0] == 3
    assert rig.machine.cycle > 2 * 29_000  # both operations stop the CPU for 2 ms


def test_a_snapshot_of_one_engine_continues_in_another() -> None:
    """Engine contract: a snapshot of one engine can be restored and continued in another."""
    text = "loop: inc w0, w0\nadd w0, [w1], [w1]\nrepeat #5\nrlc w2, w2\nbra loop"
    first, second = Rig(text, "plain"), Rig(text, "jit")
    first.machine.run(101)
    second.machine.restore(first.machine.snapshot())
    first.machine.run(500)
    second.machine.run(500)
    assert first.machine.snapshot() == second.machine.snapshot()


def test_peek_and_poke_have_no_side_effects(engine: str) -> None:
    """Engine contract: `peek` and `poke` have no side effects."""
    rig = Rig("end: nop", engine)
    rig.machine.poke(RAM + 1, 0xAB, size=1)
    assert rig.machine.peek(RAM) == 0xAB00
    assert rig.machine.peek(RAM + 1, size=1) == 0xAB
    rig.machine.poke("IFS0", 8)
    assert rig.machine.peek("IFS0") == 8


def test_a_run_in_pieces_is_the_run_in_one_go(engine: str) -> None:
    """Engine contract: a run in pieces equals one run. The engine rechecks a request that DISI blocks by an event of
    its own, which a snapshot excludes."""
    text = "loop: disi #29\nnop\nnop\nrepeat #11\nnop\nbra loop\nisr: bclr 0x84, #3\nretfie"
    whole, pieces = Rig(text, engine), Rig(text, engine)
    for rig in whole, pieces:
        rig.vector(0x1A, "isr")
        rig.enable(3, 4)
        for cycle in range(50, 1300, 97):
            rig.interrupt_at(cycle)
    for step in (1 + 7 * number % 40 for number in range(60)):
        whole.machine.run(step)
        while pieces.machine.cycle < whole.machine.cycle:
            pieces.machine.run(1)
        assert pieces.machine.snapshot() == whole.machine.snapshot(), whole.machine.cycle
