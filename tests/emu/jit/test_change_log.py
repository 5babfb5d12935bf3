"""Changes of watched numbers are logged alike by each engine, in the cycle in which they happen, and change no run."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

import emu
from emu.dspic30f.change_log import BOUNDARY, ROOM, Change, Watched, WatchedNumber, changes_in
from emu.dspic30f.jit.engine import JitEngine
from emu.instruments.changes import log_changes
from emu.instruments.vcd import WaveformRecorder
from emu.machine.machine import Machine
from emu.machine.stops import Stop
from tests.emu.jit.comparison.compiled_program import build, compile_eagerly, machine_of
from tests.emu.jit.comparison.random_firmware import load, random_firmware

SOURCE = """
#include <p30F6014A.h>
#include <string.h>
typedef struct { int spare; unsigned pid; } Block;
volatile int ticks; volatile unsigned char letter; volatile long total; volatile unsigned rare; char text[24], copy[24];
volatile char last;
Block blocks[2] = { { 0, 7 }, { 0, 9 } }; Block *volatile running; unsigned *volatile alias;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void)
{ IFS0bits.T1IF = 0; ticks++; running = ticks & 1 ? &blocks[ticks >> 1 & 1] : 0; }
void __attribute__((interrupt, no_auto_psv)) _T2Interrupt(void)
{ IFS0bits.T2IF = 0; SRbits.IPL = 6; letter++; if (running) running->pid += 2; }
static void __attribute__((noinline)) deep(int n) { if (n) deep(n - 1); total += n; }
int main(void) {
    PR1 = 700; PR2 = 1101; IPC0bits.T1IP = 5; IPC1bits.T2IP = 3; IEC0bits.T1IE = 1; IEC0bits.T2IE = 1;
    T1CON = 0x8000; T2CON = 0x8000; alias = (unsigned *)&rare;
    for (unsigned i = 0; ; i++) {
        for (int k = 0; k < 24; k++) text[k] = (char)(i + k);
        memcpy(copy, text, sizeof copy);
        last = copy[i & 15];
        deep(i & 3);
        if (i % 8 == 0) { (*alias)++; __asm__ volatile("pwrsav #1"); }
        if (i % 16 == 0) __asm__ volatile("mov #0x00e0, w0\\n mov w0, SR\\n nop\\n clr SR" : : : "w0");
    }
}
"""
NAMES = ("ticks", "letter", "total", "rare", "copy[3]")
CYCLES = 40_000


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("changes"), SOURCE)


def watched_by(machine: emu.Machine) -> list[Watched]:
    """Return everything that can be watched in the program, with part of the stack."""
    values = [machine.value(name) for name in NAMES]
    running = machine.value("running").address
    stack = WatchedNumber(machine.w[15] + 6, 4)
    assert running is not None
    numbers = [WatchedNumber(value.address or 0, value.type.bytes) for value in values]
    return [*numbers, WatchedNumber(running, 2, 2), stack, "ipl", "asleep"]


def stepped(machine: Machine, watched: list[Watched], until: int) -> list[Change]:
    """Return the changes of a run by single steps, compared after every boundary and instruction."""
    found, seen = [], [read(machine, one) for one in watched]

    def look() -> None:
        for index, one in enumerate(watched):
            value = read(machine, one)
            if value != seen[index]:
                seen[index] = value
                found.append(Change(machine.cycle, machine.pc, 0, index, value))

    while machine.cycle < until:
        stop = machine.service_boundary(until)
        look()
        if stop is not None or machine.cycle >= until:
            break
        stop = machine.step()
        look()
        if stop is not None:
            break
    return found


def read(machine: Machine, one: Watched) -> int:
    if not isinstance(one, WatchedNumber):
        return machine.state.ipl if one == "ipl" else int(machine.is_asleep)
    if one.offset is None:
        return machine.peek(one.address, one.size)
    block = machine.peek(one.address)
    place, ram = block + one.offset & 0xFFFF, machine.chip.data["ram"]
    return machine.peek(place, one.size) if block and ram.start <= place <= ram.end - one.size else 0


def logged(machine: Machine, watched: list[Watched], advance: Callable[[], object]) -> list[Change]:
    """Return the changes of a run as the log has them, without the address of the instruction."""
    found: list[Change] = []
    stop = log_changes(machine, watched, lambda entries: found.extend(changes_in(entries)))
    advance()
    stop()
    return [one._replace(site=0) for one in found]


def slices(machine: Machine, until: int, cycles: int) -> None:
    while machine.cycle < until and machine.advance(min(until, machine.cycle + cycles)) is None:
        pass


@pytest.mark.parametrize(("engine", "cycles", "threshold"), [
    ("plain", CYCLES, 1), ("jit", CYCLES, 1), ("jit", 501, 1), ("jit", CYCLES, 9),
])  # fmt: skip
def test_changes_by_stores_interrupts_and_sleep(path: Path, engine: str, cycles: int, threshold: int) -> None:
    """The log equals single steps, also with a threshold of 9, at which handlers have no native code yet."""
    stepping, machine = machine_of(path, "plain"), machine_of(path, engine)
    if isinstance(machine.runner, JitEngine):
        machine.runner.threshold = threshold
    if threshold > 1:
        machine.hook_pc("deep", lambda: None)
    for one in (stepping, machine):
        one.run(until="main")
    watched = watched_by(machine)
    found = logged(machine, watched, lambda: slices(machine, CYCLES, cycles))
    expected = stepped(stepping, watched, CYCLES)
    assert {one.number for one in expected} == set(range(len(watched)))
    assert found == expected
    assert machine.snapshot() == stepping.snapshot()


@pytest.mark.parametrize("threshold", [1, 9])
def test_a_change_by_a_hook_belongs_to_the_boundary_before_the_instruction(path: Path, threshold: int) -> None:
    """A hook's change is logged at the boundary before the hooked instruction, in interpreted and in native code.

    At threshold 9 the interrupt handlers are still interpreted.
    """
    found = []
    for engine in ("plain", "jit"):
        machine, writes = machine_of(path, engine), list[tuple[int, int, int, int, int]]()
        if isinstance(machine.runner, JitEngine):
            machine.runner.threshold = threshold
        machine.run(until="main")
        watched = watched_by(machine)

        def write(machine: Machine = machine, writes: list[tuple[int, int, int, int, int]] = writes) -> None:
            value = machine.peek("rare") + 1000 & 0xFFFF
            writes.append((machine.cycle, machine.pc, BOUNDARY, NAMES.index("rare"), value))
            machine.poke("rare", value)

        for place in ("deep", "_T1Interrupt", "_T2Interrupt"):
            machine.hook_pc(place, write)
        changes: list[Change] = []
        stop = log_changes(machine, watched, lambda entries, to=changes: to.extend(changes_in(entries)))  # type: ignore[misc]
        slices(machine, 12_000, 12_000)
        stop()
        assert set(writes) <= set(changes)
        assert len(writes) > 20
        found.append([one._replace(site=0) for one in changes])
    assert found[0] == found[1]


def test_a_watch_that_pauses_calls_a_hook_that_writes_once_per_arrival(path: Path) -> None:
    """The pause follows the hooked instruction in each engine."""
    pauses, calls = [], []
    for engine in ("plain", "jit"):
        machine, called = machine_of(path, engine), list[int]()
        machine.run(until="main")

        def write(machine: Machine = machine, called: list[int] = called) -> None:
            called.append(machine.cycle)
            machine.poke("rare", machine.peek("rare") + 1000 & 0xFFFF)

        machine.hook_pc("deep", write)
        pauses.append([(*one, machine.cycle, machine.pc) for one in emu.watch(machine, "rare", cycles=8_000)])
        calls.append(called)
    assert pauses[0] == pauses[1]
    assert calls[0] == calls[1] == sorted(set(calls[0]))
    assert len(calls[0]) > 10


NESTED = """
#include <p30F6014A.h>
volatile int low, high;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; low++; }
void __attribute__((interrupt, no_auto_psv)) _OC1Interrupt(void) { IFS0bits.OC1IF = 0; high++; }
int main(void) {
    PR1 = 96; PR2 = 130; OC1R = 20; OC1RS = 50; IPC0bits.T1IP = 5; IPC0bits.OC1IP = 7;
    IEC0bits.T1IE = 1; IEC0bits.OC1IE = 1; OC1CON = 5; T1CON = 0x8000; T2CON = 0x8000;
    for (;;) __asm__ volatile("pwrsav #1");
}
"""


def test_a_boundary_with_two_interrupts_is_logged_once(tmp_path: Path) -> None:
    """Native code enters the first; the event of the output compare, which Python fires, requests the second."""
    image = build(tmp_path, NESTED)
    stepping, machine = machine_of(image, "plain"), machine_of(image, "jit")
    watched: list[Watched] = ["asleep", "ipl"]
    expected = stepped(stepping, watched, CYCLES)
    levels = [one.value for one in expected if one.number == 1]
    assert (7, 5) in pairwise(levels)  # level 7 ends, level 5 has not begun
    assert logged(machine, watched, lambda: slices(machine, CYCLES, CYCLES)) == expected


@pytest.mark.parametrize("seed", range(6))
def test_random_firmware(seed: int) -> None:
    """Random instructions of every row, with traps, REPEAT, DO and interrupts, give the same log in each engine."""
    generator = random.Random(seed)
    places = [generator.randrange(0x800, 0xA00) & ~1 for _ in range(4)]
    watched: list[Watched] = ["ipl", "asleep", *(WatchedNumber(at, generator.choice((1, 2, 4))) for at in places)]
    watched += [WatchedNumber(generator.randrange(0x800, 0x900) & ~1, 2, 4), WatchedNumber(0x800, 8)]
    results, states = [], []
    for engine in ("plain", "jit"):
        machine = Machine(engine=engine)
        machine.stop_on_fault = False
        compile_eagerly(machine)
        load(machine, random_firmware(seed))
        results.append(
            stepped(machine, watched, 6_000) if engine == "plain"
            else logged(machine, watched, lambda m=machine: slices(m, 6_000, 1_777))  # type: ignore[misc]
        )  # fmt: skip
        states.append(machine.snapshot())
    assert results[0] == results[1]
    assert states[0] == states[1]


def test_more_changes_than_the_log_holds(path: Path) -> None:
    """Native code returns when the log is full, and no change is lost."""
    machine, other = machine_of(path, "jit"), machine_of(path, "jit")
    for one in (machine, other):
        one.run(until="main")
    address = machine.value("text").address or 0
    watched: list[Watched] = [WatchedNumber(address + 2 * n, 2) for n in range(12)]
    found = logged(machine, watched, lambda: machine.advance(300_000))
    assert len(found) > 2 * ROOM
    assert found == logged(other, watched, lambda: slices(other, 300_000, 2_000))


def waveform(machine: emu.Machine, names: list[str], cycles: int) -> str:
    stream = io.StringIO()
    recorder = WaveformRecorder(machine, stream, names)
    stop: Stop | None = None
    while stop is None and machine.cycle < CYCLES:
        stop = recorder.advance(min(CYCLES, machine.cycle + cycles))
    recorder.close()
    return stream.getvalue()


def test_a_waveform_is_the_same_in_each_engine_and_with_a_register_in_it(path: Path) -> None:
    """A watched register makes the machine step; the other values change in the same cycles."""
    names = ["ipl", "asleep", *NAMES]
    plain, native = (waveform(machine_of(path, engine), names, 9_999) for engine in ("plain", "jit"))
    assert native == plain
    stepped = waveform(machine_of(path, "jit"), [*names, "RCOUNT"], 9_999)
    of_rcount = next(line.split()[3] for line in stepped.splitlines() if " RCOUNT " in line)
    changes = [line for line in stepped.splitlines() if "RCOUNT" not in line and not line.endswith(f" {of_rcount}")]
    assert [line for line in changes if line[0] != "#"] == [line for line in plain.splitlines() if line[0] != "#"]


def changes_of(machine: emu.Machine, place: str, cycles: int) -> list[tuple[emu.Change, int, int]]:
    """Return the changes that `emu.watch` yields, each with the cycle and PC at which the machine is paused."""
    address = machine.value(place).address or 0
    return [(one, machine.cycle, machine.pc) for one in emu.watch(machine, address, cycles=cycles)]


@pytest.mark.parametrize("place", ["ticks", "rare"])
def test_the_machine_is_paused_at_every_change(path: Path, place: str) -> None:
    found = changes_of(machine_of(path, "jit"), place, 9_000)
    assert len(found) > 2
    assert all((one.cycle, one.pc) == (cycle, pc) for one, cycle, pc in found)
    assert found == changes_of(machine_of(path, "plain"), place, 9_000)


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_a_watch_without_pauses_yields_the_same_changes(
    path: Path, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emu.api, "WATCH_CYCLES", 1_000)
    machine = machine_of(path, engine)
    found = list(emu.watch(machine, "ticks", cycles=9_000, pause=False))
    assert len(found) > 9
    assert found == [one for one, _, _ in changes_of(machine_of(path, "jit"), "ticks", 9_000)]
    assert machine.cycle >= 9_000


CONDITIONS = ("rare == 2", "ticks >= 5 && letter > 2", "total > 100", "!running && ticks == 4", "letter != 0",
              "TMR1 == 650")  # fmt: skip
PLACED = (("deep", "W15 > 0x830 && ticks > 3"), ("deep", "W0 == 1"), ("_T2Interrupt", "TMR1 > 400"),
          ("deep", "ticks + 1 > 4"))  # fmt: skip


@pytest.mark.parametrize("until", CONDITIONS)
def test_a_run_ends_when_a_condition_holds(path: Path, until: str) -> None:
    """A run ends after the same instruction as with a function that is called after every instruction."""
    native, plain, stepping = machine_of(path, "jit"), machine_of(path, "plain"), machine_of(path, "plain")
    stops = [machine.run(cycles=CYCLES, until=until) for machine in (native, plain)]
    stops.append(stepping.run(cycles=CYCLES, until=lambda: bool(stepping.var(until))))
    assert stops[0].reason == "until"
    assert stops[0] == stops[1] == stops[2]
    assert native.snapshot() == plain.snapshot() == stepping.snapshot()


@pytest.mark.parametrize(("place", "when"), PLACED)
def test_a_run_ends_at_a_place_when_a_condition_holds(path: Path, place: str, when: str) -> None:
    native, plain = machine_of(path, "jit"), machine_of(path, "plain")
    stops = [machine.run(cycles=CYCLES, until=place, when=when) for machine in (native, plain)]
    assert stops[0].reason == "until"
    assert stops[0] == stops[1]
    assert stops[0].pc == native.program_address(place)
    assert native.var(when)


def test_runs_that_follow_each_other_have_a_condition_each(path: Path) -> None:
    """Native code of the first condition would not see a store to the variable of the second one."""
    native, plain = machine_of(path, "jit"), machine_of(path, "plain")
    for until in ("letter == 2", "rare == 2"):
        stops = [machine.run(cycles=CYCLES, until=until) for machine in (native, plain)]
        assert stops[0].reason == "until"
        assert stops[0] == stops[1]


def test_conditions_that_are_refused(path: Path) -> None:
    machine = machine_of(path, "jit")
    with pytest.raises(ValueError, match="needs a place"):
        machine.run(cycles=10, when="ticks > 2")
    with pytest.raises(ValueError, match="nothing called 'tocks'"):
        machine.run(cycles=10, until="tocks > 2")
    with pytest.raises(KeyError, match="tocks"):
        machine.run(cycles=10, until="tocks")
    with pytest.raises(ValueError, match="no 2 bytes of data space at 0x3001"):
        machine.run(cycles=10, until="*(int *)0x3001 > 3")
    with pytest.raises(ValueError, match="'n > 3': optimised out"):
        machine.run(until="deep", when="n > 3")
