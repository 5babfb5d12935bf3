"""`Machine.run_past` gives the same stops and state as runs to each limit, in every engine."""

from __future__ import annotations

import pytest

from emu.chips.dspic30f6014a import DSPIC30F6014A
from emu.machine.machine import Machine
from tests.emu.cpu.cpu_rig import START, assemble
from tests.emu.jit.comparison.compiled_program import compile_eagerly
from tests.emu.jit.comparison.random_firmware import difference, load, random_firmware


def machine(engine: str, seed: int) -> Machine:
    made = Machine(engine=engine)
    compile_eagerly(made)
    load(made, random_firmware(seed))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["plain", "jit"])
@pytest.mark.parametrize("seed", range(2))
def test_cuts_are_where_runs_would_have_ended(engine: str, seed: int) -> None:
    """For random firmware with interrupts, Sleep and faults, `run_past` reports the cycles at which separate runs
    end."""
    stepwise, once = machine(engine, seed), machine(engine, seed)
    first, period, last = 700, 311, 9_000
    ended, cuts = [], []
    stop = None
    for limit in range(first, last + 1, period):
        stop = stepwise.run_until(limit)
        if stop is not None:
            break
        ended.append(stepwise.cycle)
    if stop is None:
        stop = stepwise.run_until(last)
    found = once.run_past(first, period, last, cuts)
    assert cuts == ended
    assert (found and found.reason, once.cycle) == (stop and stop.reason, stepwise.cycle)
    assert difference(stepwise, once) == ""


ONE_UPON_ANOTHER = """
mov #0x900, w15
mov #COMPARE, w0
mov w0, OC1R
mov #0x1400, w0
mov w0, IPC0    ; a match of timer 1 gives way to one of OC1
bset IEC0, #3
bset IEC0, #2
mov #30, w0
mov w0, PR1
mov #1, w0
mov w0, OC1CON
mov #0x8000, w0
mov w0, T2CON
mov w0, T1CON
loop: bra loop
timer: bclr IFS0, #3
retfie
compare: bclr IFS0, #2
retfie
trap: retfie
"""
"""Program in which Python sets the flag of OC1 and native code handles timer 1. Some values of COMPARE set the flag
during the entry of timer 1's exception."""


@pytest.mark.parametrize("engine", ["plain", "jit"])
@pytest.mark.parametrize("compare", range(30, 38))
def test_a_limit_among_exceptions_counts_behind_the_last(engine: str, compare: int) -> None:
    """If several exceptions are entered in a row, the run ends after the last entry, wherever the limit is among
    them."""
    text = ONE_UPON_ANOTHER.replace("COMPARE", str(compare))
    for name in ("OC1R", "IPC0", "IEC0", "PR1", "OC1CON", "T2CON", "T1CON", "IFS0"):
        text = text.replace(name, f"{DSPIC30F6014A.sfrs[name].address:#x}")
    words, labels = assemble(text)
    vectors = {2 * n: labels["trap"] for n in range(2, 64)} | {0: 0x040000 | START, 2: 0}
    vectors |= {0x14 + 2 * 3: labels["timer"], 0x14 + 2 * 2: labels["compare"]}
    ended: dict[str, list[int]] = {"plain": [], engine: []}
    cut: dict[str, list[int]] = {"plain": [], engine: []}
    for name in ended:
        made = Machine(engine=name)
        made.stop_on_fault = False
        compile_eagerly(made)
        for at, word in (words | vectors).items():
            made.program.put(at, word)
        made.run_until(20)
        begun = made.snapshot()
        for limit in range(21, 100):
            made.restore(begun)
            made.run_until(limit)
            ended[name].append(made.cycle)
            made.restore(begun)
            made.run_past(limit, 1000, 200, cut[name])
    assert ended[engine] == ended["plain"]
    assert cut[engine] == cut["plain"] == ended["plain"]
