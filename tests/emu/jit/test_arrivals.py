"""Arrivals that native code counts and logs equal those that hooks of the plain engine see."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

import emu
from emu.debug.history import History
from emu.dspic30f.jit.engine import JitEngine
from emu.instruments.coverage import Counts, count_executions
from emu.system.arrivals import ROOM
from tests.emu.jit.comparison.compiled_program import build, machine_of

SOURCE = """
#include <p30F6014A.h>
volatile int ticks, below; volatile long total; volatile unsigned char letter; volatile char text[8];
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; ticks++; letter += 3; }
void __attribute__((noinline)) step(int n) { below -= n; total += below; text[n & 7] = (char)n; }
void __attribute__((noinline)) send(int n) { U1TXREG = n; }
int main(void) {
    PR1 = 311; IEC0bits.T1IE = 1; T1CON = 0x8000; U1MODE = 0x8000; U1STA = 0x400;
    for (int i = 0; ; i++) {
        for (int k = 0; k < 6; k++) step(i + k);
        if (U1STAbits.TRMT) send(i);
        if (i % 32 == 0) __asm__ volatile("pwrsav #1");
    }
}
"""
PLACES = ("step", "send", "_T1Interrupt")
VALUES = ("below", "total", "letter", "W0", "w15")
CYCLES = 30_000


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("arrivals"), SOURCE)


def seen_by_hooks(path: Path) -> tuple[list[emu.Arrival], bytes]:
    """Return what hooks in Python see in the plain engine, and the state of a run without hooks."""
    machine, found = machine_of(path, "plain"), list[emu.Arrival]()
    for place in PLACES:

        def look(place: str = place) -> None:
            values = (*map(machine.var, VALUES[:3]), machine.w[0], machine.w[15])
            found.append(emu.Arrival(machine.cycle, place, values))

        machine.hook_pc(place, look)
    machine.run(cycles=CYCLES)
    unobserved = machine_of(path, "plain")
    unobserved.run(cycles=CYCLES)
    return found, unobserved.snapshot()


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_arrivals_are_those_that_hooks_see(path: Path, engine: str) -> None:
    """The recording does not change the run, and on jit Python is rarely called."""
    expected, state = seen_by_hooks(path)
    machine = machine_of(path, engine)
    with emu.Arrivals(machine, *PLACES, values=VALUES) as arrivals:
        machine.run(cycles=CYCLES)
    assert arrivals.all() == expected
    assert arrivals.counts == {place: sum(one.place == place for one in expected) for place in PLACES}
    assert min(arrivals.counts.values()) > 10
    assert any(one.values[0] < 0 for one in expected)
    assert machine.snapshot() == state
    if isinstance(machine.runner, JitEngine):
        assert machine.runner.counts.interpreted + machine.runner.counts.cold < 200 < len(expected)
    machine.run(cycles=CYCLES)
    assert len(arrivals.all()) == len(expected)


def test_recordings_beside_other_observers(path: Path) -> None:
    """Other hooks at a place, a second recording and coverage leave the result as it is."""
    expected, state = seen_by_hooks(path)
    machine, calls = machine_of(path, "jit"), list[int]()
    machine.hook_pc("send", lambda: calls.append(machine.cycle))
    stop = count_executions(machine, counts := Counts())
    with (
        emu.Arrivals(machine, *PLACES, values=VALUES) as first,
        emu.Arrivals(machine, "send", "step", log=False) as second,
    ):
        machine.run(cycles=CYCLES)
    stop()
    assert first.all() == expected
    assert second.counts == {place: first.counts[place] for place in ("send", "step")}
    assert second.all() == []
    assert calls == [one.cycle for one in expected if one.place == "send"]
    assert counts.executed[machine.program_address("step")] == first.counts["step"]
    assert machine.snapshot() == state


def test_more_arrivals_than_the_memory_holds(path: Path) -> None:
    """The log continues in order when its memory is full."""
    machine = machine_of(path, "jit")
    with emu.Arrivals(machine, "step", values=["total"]) as arrivals:
        machine.run(cycles=500_000)
    cycles = [one.cycle for one in arrivals.all()]
    assert len(cycles) == arrivals.counts["step"] > 2 * ROOM
    assert all(a < b for a, b in pairwise(cycles))


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_an_arrival_at_which_a_run_ends_is_recorded_once(path: Path, engine: str) -> None:
    """The next run continues after the arrival. A restored machine arrives again, and replayed cycles do not count."""
    machine = machine_of(path, engine)
    with emu.Arrivals(machine, "step") as arrivals:
        stops = [machine.run(until="step") for _ in range(20)]
        state = machine.snapshot()
        assert [one.cycle for one in arrivals.all()] == [stop.cycle for stop in stops]
        machine.restore(state)
        machine.run(cycles=1)
        assert arrivals.counts["step"] == 21
        history = History(machine)
        history.advance(machine.cycle + 3_000)
        counted = arrivals.counts["step"]
        history.seek(history.start + 100)
        history.seek(history.end)
        assert arrivals.counts["step"] == counted > 30


def test_places_and_values_that_are_refused(path: Path) -> None:
    machine = machine_of(path, "jit")
    with pytest.raises(KeyError, match="there is no function or label 'nowhere'"):
        emu.Arrivals(machine, "nowhere")
    for value in ("text", "TMR1", "ticks + 1", 0x84):
        with pytest.raises(ValueError, match=r"is not a number in RAM|names no object"):
            emu.Arrivals(machine, "step", values=[value])


def test_a_table_of_arrivals(path: Path) -> None:
    pytest.importorskip("pandas")
    machine = machine_of(path, "jit")
    with emu.Arrivals(machine, "step", values=["below", 0x900]) as arrivals:
        machine.run(cycles=3_000)
    frame = arrivals.frame()
    assert list(frame.columns) == ["cycle", "place", "below", "2304"]
    assert len(frame) == arrivals.counts["step"]
