"""Conditional breakpoints: native code passes the address while the condition cannot hold, and stops where it does."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.dap import debuggee
from emu.dap.breakpoints import Breakpoint
from emu.dap.debuggee import Debuggee
from emu.dap.logged_writes import can_log_writes
from emu.debug.expressions.condition_filters import filter_of
from emu.debug.expressions.expression import evaluate, number_of
from emu.debug.history import History
from emu.dspic30f.jit.engine import JitEngine
from tests.emu.jit.comparison.compiled_program import build, machine_of

SOURCE = """
#include <p30F6014A.h>
volatile unsigned count; volatile int level; volatile char letter = -3; volatile long wide;
volatile unsigned long mask = 0xF0000000; int local_too;
volatile struct { char low; signed int high : 5; unsigned rest : 11; } packed;
volatile int table[4]; volatile int *pointer = table;
void __attribute__((noinline)) mark(int local_too)
{ count++; level = 50 - (int)count; wide -= 70000 + local_too; mask |= 16;
  packed.high = (int)count; packed.rest = count; table[2]++; }
void __attribute__((noinline, optimize("O0"))) deep(int argument)
{ volatile int kept = argument + 1; volatile long far = kept - 70000L;
  __asm__ volatile("work: nop"); kept = (int)far; }
int main(void)
{
    PR1 = 333; T1CON = 0x8000; U1MODE = 0x8000; U1STA = 0x400;
    for (;;) { mark((int)count & 3); deep((int)count & 7); letter++; if (U1STAbits.TRMT) U1TXREG = 'a'; }
}
"""
GLOBALS = ("count == 40", "count", "!level", "level < -20", "level >= 45 && count != 2", "3 < count", "letter == -1",
           "wide < -900000", "mask == 0xF0000010 && count > 30", "table[2] == 9", "packed.high == -3",
           "packed.rest > 20")  # fmt: skip
AT_MARK = ("W0 == 2", "W15 > 0x800", "W4", "TMR1 < 40", "TMR1 > 300", "U1STA.TRMT", "!U1STAbits.TRMT && TMR1 > 100",
           "T1CONbits.TON == 1", "SR.Z", "local_too == 3")  # fmt: skip
AT_WORK = ("kept == 3", "far < -69996", "kept == 8 && count > 9", "table[2] > 3")
CONDITIONS = [
    *(("mark", one) for one in (*GLOBALS, *AT_MARK)),
    *(("work", one) for one in AT_WORK),
]


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("filters"), SOURCE)


def stops(machine: emu.Machine, condition: str, place: str = "mark") -> tuple[list[int], int]:
    """Return the cycles of the first stops at `place` with a condition, and how often Python was called."""
    address, calls, found = machine.program_address(place), 0, []

    def hook() -> bool:
        nonlocal calls
        calls += 1
        return bool(number_of(evaluate(machine.inspector, condition, machine.backtrace()[0])))

    filter_ = filter_of(machine.inspector, condition, address)
    assert filter_ is not None
    machine.hook_pc(address, hook, filter_)
    for _ in range(5):
        if machine.run(cycles=4_000).reason == "breakpoint":
            found.append(machine.cycle)
    return found, calls


def test_native_code_continues_from_an_arrival_that_python_has_seen(image: Path) -> None:
    """Native code stops at the next arrival whose condition holds, also if the run began at an arrival whose hook
    Python has called in vain, because the code was loaded only afterwards."""
    plain, native = machine_of(image, "plain"), machine_of(image, "jit")
    address = native.program_address("mark")
    filter_ = filter_of(native.inspector, "W0 == 2", address)
    assert filter_ is not None
    native.hook_pc(address, lambda: native.w[0] == 2, filter_)
    native.run(cycles=20_000)
    engine = native.runner
    assert isinstance(engine, JitEngine)
    natively, found, expected = engine.natively, [], []
    waiting = 0

    def not_at_first(limit: int) -> bool:
        nonlocal waiting
        waiting -= 1
        return waiting < 0 and natively(limit)

    engine.natively = not_at_first  # type: ignore[method-assign]
    for start in range(20_000, 40_000, 2_000):
        plain.run(cycles=start - plain.cycle)
        plain.run(cycles=5_000, until="mark", when="W0 == 1")
        native.restore(plain.snapshot())
        waiting = 1
        found.append(native.run(cycles=5_000).cycle)
        expected.append(plain.run(cycles=5_000, until="mark", when="W0 == 2").cycle)
    assert found == expected


@pytest.mark.parametrize(("place", "condition"), CONDITIONS)
def test_the_stops_are_those_of_the_plain_engine(image: Path, place: str, condition: str) -> None:
    expected, arrivals = stops(machine_of(image, "plain"), condition, place)
    assert expected
    native, calls = stops(machine_of(image, "jit"), condition, place)
    assert native == expected
    assert calls <= arrivals


def test_native_code_does_not_call_a_hook_whose_filter_is_false(image: Path) -> None:
    for place, condition in (("mark", "count == 40"), ("mark", "TMR1 > 330"), ("work", "kept == 8")):
        _, calls = stops(machine_of(image, "jit"), condition, place)
        _, arrivals = stops(machine_of(image, "plain"), condition, place)
        assert calls < arrivals / 2


@pytest.mark.parametrize(
    "condition",
    ["count + 1 == 2", "level == 0xFFFF", "count == -1", "count == 3u", "nothing", "pointer[1] == 2", "*pointer", "&&"],
)
def test_other_conditions_have_no_filter(image: Path, condition: str) -> None:
    """Arithmetic, comparisons that C converts to unsigned, targets of pointers and unknown names are left to Python."""
    machine = machine_of(image, "jit")
    assert filter_of(machine.inspector, condition, machine.program_address("mark")) is None


@pytest.mark.parametrize("engine", ["plain", "jit"])
def test_a_breakpoint_of_the_debugger_counts_its_hits(image: Path, engine: str) -> None:
    """A hit condition counts the arrivals at which the condition holds."""
    machine = machine_of(image, engine)
    target = Debuggee(machine, lambda: False, lambda _text: None, History(machine))
    address = machine.program_address("mark")
    target.set_breakpoints("here", [Breakpoint(1, "function", (address,), condition="count > 10", hit_condition="3")])
    assert target.resume().reason == "breakpoint"
    assert machine.peek("count") == 13


@pytest.mark.parametrize("name", ["level", "mask", "letter"])
def test_a_data_breakpoint_stops_after_every_write(image: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A data breakpoint stops in the same cycles as single steps, also at writes that leave the value unchanged."""
    results = []
    for engine, is_logged in (("jit", True), ("plain", True), ("plain", False)):
        monkeypatch.setattr(debuggee, "can_log_writes", can_log_writes if is_logged else lambda *_: False)
        machine = machine_of(image, engine)
        target = Debuggee(machine, lambda: False, lambda _text: None, History(machine))
        value = machine.value(name)
        point = Breakpoint(1, "data", (value.address or 0,), size=value.type.bytes, access="write")
        target.set_breakpoints("here", [point])
        results.append([(target.resume().description, machine.cycle, machine.pc) for _ in range(5)])
    assert results[0] == results[1] == results[2]
    assert all(text.startswith("write at") for text, _, _ in results[0])
