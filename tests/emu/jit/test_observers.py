"""Observers of a run (hooks, conditions, traces, waveforms) read every device in its current state."""

from __future__ import annotations

import io
import random
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

import emu
from emu.dap.breakpoints import Breakpoint
from emu.debug.history import History
from emu.debug.inspector import Inspector
from emu.dspic30f.jit.engine import JitEngine
from emu.instruments.trace import Tracer
from emu.instruments.vcd import WaveformRecorder
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from tests.emu.cli.programs import assembled, executable
from tests.emu.jit.comparison.engine_pair import Difference, QuickCompiler, engine_pair
from tests.emu.jit.comparison.observed_runs import check_observed
from tests.emu.jit.comparison.random_firmware import (
    BODY_WORDS,
    CODE,
    Firmware,
    difference,
    load,
    random_firmware,
    started,
    words_of,
)

PEEKED = ("TMR1", "TMR2", "TMR3", "IFS0", "IFS1", "PORTD", "PORTF", "U1STA", "U1RXREG", "ADCON1", "INTTREG")
"""Registers whose values depend on device time."""
WRITTEN = (
    "TMR1", "TMR2", "PR1", "PR2", "PR3", "T1CON", "T2CON", "LATD", "TRISD", "IFS0", "IEC0", "IPC0", "U1MODE", "U1STA",
    "U1TXREG", "U1BRG", "OC1CON", "OC1R", "ADCON1",
)  # fmt: skip
HOOKED_ADDRESSES = 6
NEVER_REACHED = 1 << 60
"""Threshold of translation that no code reaches, so that all code is interpreted."""
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
ENGINES_AND_CACHES = ("plain", "jit, cold", "jit, warm")

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


@pytest.fixture(params=ENGINES_AND_CACHES)
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


class ActingHooks:
    """Hooks of one machine that read and write its devices. Equal seeds and equal runs give equal actions."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self.seen: list[tuple[int, int, tuple[int, ...]]] = []
        """PC, cycle and values read, for each arrival."""
        self._machine = machine
        self._generator = random.Random(seed)
        for address in self._generator.sample(range(CODE, CODE + 2 * BODY_WORDS, 2), HOOKED_ADDRESSES):
            machine.hook_pc(address, self._act)

    def _act(self) -> None:
        machine, generator = self._machine, self._generator
        values = [machine.peek(name) for name in PEEKED]
        choice = generator.random()
        if choice < 0.3:
            values.append(machine.read(generator.choice(PEEKED)))
        elif choice < 0.5:
            machine.write(generator.choice(WRITTEN), generator.getrandbits(16))
        elif choice < 0.6:
            machine.write(generator.choice(("TMR1", "TMR2", "TMR3")), generator.randrange(400))
        elif choice < 0.7:
            machine.uart[1].feed(bytes([generator.randrange(256)]))
        self.seen.append((machine.pc, machine.cycle, tuple(values)))


def check_acting_hooks(seed: int, stops: int, cold: bool = False) -> int:
    """Run one random program with acting hooks in both engines, and return the number of arrivals.

    With `cold` the native engine has no code yet. Raises Difference if the hooks read different values or the
    snapshots differ at a stop.
    """
    generator = random.Random(seed)
    plain, native = engine_pair(random_firmware(seed), seed & 1, 0)
    if cold:
        assert isinstance(native.runner, JitEngine)
        native.runner.threshold = NEVER_REACHED
    hooks = [ActingHooks(machine, seed) for machine in (plain, native)]
    for _ in range(stops):
        cycles = generator.randrange(1, 600)
        one, other = plain.run(cycles), native.run(cycles)
        first, second = (acting.seen for acting in hooks)
        if first != second:
            pair = next((a, b) for a, b in zip([*first, None], [*second, None], strict=False) if a != b)
            raise Difference(f"seed {seed}: hooks see {pair}")
        found = difference(plain, native)
        if one != other or found:
            raise Difference(f"seed {seed}: {one} {other} {found}")
    return len(hooks[0].seen)


@pytest.mark.parametrize("cold", [False, True])
@pytest.mark.parametrize("seed", [5, 9, 14, 21])
def test_random_programs_with_acting_hooks_run_equally(seed: int, cold: bool) -> None:
    """Random programs with hooks that read and write device registers leave equal snapshots in both engines."""
    assert check_acting_hooks(seed, stops=8, cold=cold) > 0


@pytest.mark.parametrize("seed", range(3))
def test_random_observers_change_no_run(seed: int) -> None:
    """A sample of the campaign `observers`: snapshots and output equal those of the unobserved run."""
    check_observed(seed, Counter())


def arrivals(machines: Iterable[Machine], firmware: Firmware, address: int, cycles: int) -> list[list[int]]:
    """Run firmware with a hook at `address` on each machine and return the cycles of its calls."""
    seen: list[list[int]] = []
    for machine in machines:
        load(machine, firmware)
        seen.append([])
        machine.hook_pc(address, lambda m=machine, s=seen[-1]: s.append(m.cycle))  # type: ignore[misc]
        machine.run(cycles)
    return seen


def test_a_hooked_repeat_that_never_fits_before_the_next_event_goes_on() -> None:
    """engines.md §4.3: a hooked REPEAT that does not fit before the next event makes progress. The block checks the
    whole loop after the hook; exact code then runs it."""
    firmware, at = started({1: 200, 2: 0, 15: 0x900}, (("PR1", 99), ("IEC0", 8), ("T1CON", 0x8000)))
    end = firmware.put(at, words_of("REPEAT Wn", s=1) + words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0))
    firmware.put(end, words_of("BRA Expr", n=-3))
    plain, native = engine_pair(firmware, 0, 2)
    seen = arrivals((plain, native), firmware, at, 3_000)
    assert seen[0] == seen[1]
    assert len(seen[0]) > 10
    assert not difference(plain, native)


def test_each_iteration_of_a_hooked_target_is_an_arrival() -> None:
    """A hook on a REPEAT target is called in every iteration, because each is a boundary (isa.md §7.5)."""
    firmware, at = started({2: 0})
    at = firmware.put(at, words_of("REPEAT #lit14", k=5))
    firmware.put(at, words_of("INC{.B} Ws, Wd", B=0, s=2, p=0, d=2, q=0) + words_of("BRA Expr", n=-1))
    seen = arrivals(engine_pair(firmware, 0, 2), firmware, at, 100)
    assert seen == [seen[0]] * 2
    assert len(seen[0]) == 6
