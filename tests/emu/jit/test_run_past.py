"""`Machine.run_past`: where runs to each limit would have ended, and the same machine, in every engine."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from random_firmware import difference, load, random_firmware

from emu.dspic30f.jit.engine import JitEngine
from emu.machine import Machine


def machine(engine: str, seed: int) -> Machine:
    made = Machine(engine=engine)
    if isinstance(made.runner, JitEngine):
        made.runner.threshold = 1
        made.runner.wait = True
    load(made, random_firmware(seed))
    return made


@pytest.mark.parametrize("engine", ["plain", "interp", "jit"])
@pytest.mark.parametrize("seed", range(3))
def test_cuts_are_where_runs_would_have_ended(engine: str, seed: int) -> None:
    """Random firmware with interrupts, sleep and faults: cut by cut, and in one go."""
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
