"""Observers of a run (hooks, conditions, traces, waveforms) read every device in its current state."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))

from engine_pair import QuickCompiler
from hook_campaign import NEVER_REACHED, check_acting_hooks
from programs import assembled, executable

import emu
from emu.dap.breakpoints import Breakpoint
from emu.debug.history import History
from emu.debug.inspector import Inspector
from emu.dspic30f.jit.engine import JitEngine
from emu.instruments.trace import Tracer
from emu.instruments.vcd import WaveformRecorder
from emu.machine.machine import Machine
from emu.machine.stops import Stop

TIMER_LOOP = """
    mov #0xffff, w0
    mov w0, {PR1}
    mov #0x8000, w0
    mov w0, {T1CON}
    mov w0, {U1MODE}
    repeat:
    repeat #300
    nop
    inc w3, w3
    mark:
    mov {TMR1}, w5
    after:
    nop
    bra @repeat
"""
MARK, AFTER = (assembled(TIMER_LOOP)[1][name] for name in ("mark", "after"))
WAYS = ("plain", "jit, cold", "jit, warm")

IDLE_WITH_TIMER = """
    mov #0x8000, w0
    mov w0, {U1MODE}
    mov #0x0400, w0
    mov w0, {U1STA}
    mov #0x41, w1
    mov w1, {U1TXREG}
    mov #0xffff, w0
    mov w0, {PR1}
    mov #0x8000, w0
    mov w0, {T1CON}
    bset {IEC0}, #3
    pwrsav #1
    nop
    end:
    bra @end
"""


@pytest.fixture(params=WAYS)
def machine(request: pytest.FixtureRequest, tmp_path: Path) -> Machine:
    """Return a machine with the timer loop in each engine; the native engine is tested with and without code."""
    path = tmp_path / "loop.elf"
    path.write_bytes(executable(TIMER_LOOP))
    engine, _, warmth = request.param.partition(", ")
    made = emu.load(path, engine=engine, board=None)
    if isinstance(made.runner, JitEngine):
        made.runner.compiler, made.runner.wait = QuickCompiler(0), True
        made.runner.threshold = NEVER_REACHED if warmth == "cold" else 1
    return made


def test_a_hook_sees_the_timer_that_the_hooked_instruction_reads(machine: Machine) -> None:
    """`peek` and `read` in a hook return the timer value that the hooked instruction reads, because both are in the
    same cycle."""
    in_hooks: list[tuple[int, int]] = []
    by_firmware: list[int] = []
    machine.hook_pc(MARK, lambda: in_hooks.append((machine.peek("TMR1"), machine.read("TMR1"))))
    machine.hook_pc(AFTER, lambda: by_firmware.append(machine.w[5]))
    machine.run(cycles=5_000)
    assert len(by_firmware) > 10
    assert in_hooks[: len(by_firmware)] == [(value, value) for value in by_firmware]


def test_a_write_in_a_hook_acts_like_a_write_of_an_instruction(machine: Machine) -> None:
    """If a hook clears the timer, the hooked instruction reads the cleared timer."""
    read: list[int] = []
    machine.hook_pc(MARK, lambda: machine.write("TMR1", 0))
    machine.hook_pc(AFTER, lambda: read.append(machine.w[5]))
    machine.run(cycles=5_000)
    assert read == [0] * len(read)
    assert len(read) > 10


def test_a_hook_that_feeds_input_is_called_once_per_arrival(machine: Machine) -> None:
    """A hook that feeds input is called once per arrival: the next boundary checks for interrupts, but the hooked
    instruction runs first."""
    arrivals: list[int] = []

    def feed() -> None:
        arrivals.append(machine.cycle)
        machine.uart[1].feed(b"x")

    machine.hook_pc(MARK, feed)
    machine.run(cycles=5_000)
    assert len(arrivals) == len(set(arrivals)) > 10


def test_a_conditional_breakpoint_compares_the_present_value_of_a_register(machine: Machine) -> None:
    """The condition `TMR1 > 2000` is true at the first arrival after cycle 2,000, also during a replay of the
    history."""
    inspector = Inspector(machine)
    point = Breakpoint(1, "instruction", (MARK,), condition="TMR1 > 2000")

    def condition() -> bool:
        return point.should_stop(inspector, lambda _text: None)

    history = History(machine)
    remove = machine.hook_pc(MARK, condition)
    stop = history.advance(20_000)
    assert stop is not None
    first = machine.cycle
    assert 2_000 < first < 2_400
    remove()
    history.advance(10_000)
    machine.hook_pc(MARK, condition)
    history.seek(100)
    machine.replay_condition = condition
    again = history.advance(20_000)
    assert again is not None
    assert (again.reason, machine.cycle) == ("breakpoint", first)


def _traced(machine: Machine, cycle: int) -> Stop | None:
    assert machine.image is not None
    return Tracer(machine, machine.image, io.StringIO()).advance(cycle)


def _watched(machine: Machine, cycle: int) -> Stop | None:
    recorder = WaveformRecorder(machine, io.StringIO(), ["ipl"])
    stop = recorder.advance(cycle)
    recorder.close()
    return stop


@pytest.mark.parametrize("advance", [_traced, _watched])
def test_a_trace_does_not_change_a_run_that_ends_asleep(
    tmp_path: Path, advance: Callable[[Machine, int], Stop | None]
) -> None:
    """A trace does not change output, timer and snapshot of a run that ends in Sleep."""
    path = tmp_path / "idle.elf"
    path.write_bytes(executable(IDLE_WITH_TIMER))
    results = []
    for run in (emu.Machine.advance, advance):
        machine = emu.load(path, engine="plain", board=None)
        sent: list[int] = []
        machine.uart[1].listen(lambda byte, _start, sent=sent: sent.append(byte), lazy=True)  # type: ignore[misc]
        run(machine, 5_000)
        assert machine.is_asleep
        data = machine.snapshot()[: machine.record.data_end]
        results.append((machine.cycle, sent, machine.peek("TMR1"), machine.peek("U1STA"), data))
    assert results[0] == results[1]
    assert results[0][1] == [0x41]


@pytest.mark.parametrize("cold", [False, True])
@pytest.mark.parametrize("seed", [5, 9, 14, 21])
def test_random_programs_with_acting_hooks_run_equally(seed: int, cold: bool) -> None:
    """Random programs with hooks that read and write device registers leave equal snapshots in both engines."""
    assert check_acting_hooks(seed, stops=8, cold=cold) > 0
