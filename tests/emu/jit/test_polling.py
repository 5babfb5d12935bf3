"""Polling loops: native code skips iterations of empty loops only, and reaches the state of loops that run."""

from __future__ import annotations

import pytest
from test_native_code import own_cache, pair  # noqa: F401  (the fixture)

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.dspic30f.isa.codec import decode_for_execution
from emu.dspic30f.isa.row import Insn
from emu.dspic30f.jit.machine_layout import machine_layout, record_offsets
from emu.dspic30f.jit.translate.polling import empty_loops
from emu.dspic30f.jit.translate.region import discover
from emu.dspic30f.state.modes import Modes
from emu.machine.machine import Machine
from tests.emu.jit.comparison.random_firmware import Firmware, difference, load, started, words_of

IFS0, TMR1 = (DSPIC30F6014A.sfrs[name].address for name in ("IFS0", "TMR1"))
FLAG = 0x900

EMPTY = {
    "wait for an interrupt flag": words_of("BTSS{.B} f, #bit4", f=IFS0, b=3) + words_of("BRA Expr", n=-2),
    "wait for a variable": words_of("MOV{.W} f, Wnd", f=FLAG, d=4)
    + words_of("CP0{.B} Ws", B=0, s=4, p=0)
    + words_of("BRA Z, Expr", n=-3),
    "wait for an interrupt for ever": words_of("BRA Expr", n=-1),
}
BUSY = {
    "a countdown": words_of("DEC{.B} Ws, Wd", B=0, s=4, p=0, d=4, q=0) + words_of("BRA NZ, Expr", n=-2),
    "a look at the time": words_of("MOV{.W} f, Wnd", f=TMR1, d=4)
    + words_of("CP0{.B} Ws", B=0, s=4, p=0)
    + words_of("BRA NZ, Expr", n=-3),
    "a store": words_of("MOV{.W} Wns, f", s=5, f=FLAG)
    + words_of("BTSS{.B} f, #bit4", f=IFS0, b=3)
    + words_of("BRA Expr", n=-3),
}
START = 0x200


def polling_firmware(loop: list[int]) -> Firmware:
    """Return firmware with a polling loop. T1 matches every 97 Tcy; its handler toggles FLAG. W1 counts after the
    loop."""
    enabled = 0 if loop == EMPTY["wait for an interrupt flag"] else 8
    sfrs = (("PR1", 96), ("IEC0", enabled), ("T1CON", 0x8000))
    toggle = words_of("BTG{.B} f, #bit4", f=FLAG, b=0)
    firmware, at = started(dict.fromkeys(range(15), 7) | {15: 0xA00, 0: 0}, sfrs, toggle)
    firmware.put(at, words_of("MOV{.W} Wns, f", s=0, f=FLAG) + words_of("GOTO Expr", n=START))
    at = firmware.put(START, loop)
    at = firmware.put(at, words_of("BCLR{.B} f, #bit4", f=IFS0, b=3))
    at = firmware.put(at, words_of("INC{.B} Ws, Wd", B=0, s=1, p=0, d=1, q=0))
    firmware.put(at, words_of("GOTO Expr", n=START))
    return firmware


def loops_of(words: list[int]) -> int:
    """Return the number of empty loops in a program of these words."""
    machine = Machine(engine="plain")
    load(machine, polling_firmware(words))

    def fetch(pc: int) -> Insn | None:
        flash = machine.program.flash
        return decode_for_execution(flash[pc >> 1], flash[(pc >> 1) + 1])

    key = Modes(machine.state).key()
    layout = machine_layout(machine.core, key, frozenset(), record_offsets(machine.core))
    return len(empty_loops(discover(START, fetch), layout, key.context))


@pytest.mark.parametrize("words", EMPTY.values(), ids=EMPTY)
def test_a_loop_that_only_waits_is_empty(words: list[int]) -> None:
    """engines.md §4.3: a loop is empty if it has no store, no read of a value that time changes, and no computation
    from the results of an earlier iteration."""
    assert loops_of(words) == 1


@pytest.mark.parametrize("words", BUSY.values(), ids=BUSY)
def test_a_loop_that_does_something_is_not(words: list[int]) -> None:
    """A loop with a store, a read of a changing value, or results of an earlier iteration is not empty."""
    assert loops_of(words) == 0


@pytest.mark.parametrize("words", (EMPTY | BUSY).values(), ids=EMPTY | BUSY)
def test_skipped_iterations_leave_what_run_ones_leave(words: list[int]) -> None:
    """Skipped iterations leave the record of executed ones, at stops in every phase of the loop and of the
    interrupt."""
    plain, native = pair(polling_firmware(words))
    for length in (*range(1, 120), 997, 5003):
        assert plain.run(length) == native.run(length)
        assert not difference(plain, native)


def test_a_loop_that_is_entered_behind_its_head_is_run() -> None:
    """A loop that is entered in the middle runs once before iterations are skipped, because its registers may
    differ."""
    skip_in = words_of("BRA Expr", n=1)  # enters the loop at the comparison
    assert loops_of(skip_in + EMPTY["wait for a variable"]) == 0
