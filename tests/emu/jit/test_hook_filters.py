"""Conditional breakpoints: native code passes the address while the condition cannot hold, and stops where it does."""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from emu.dap.breakpoints import Breakpoint
from emu.dap.debuggee import Debuggee
from emu.debug.expressions.expression import evaluate, number_of
from emu.debug.expressions.filters import filter_of
from emu.debug.history import History
from emu.dspic30f.jit.engine import JitEngine
from toolchain.driver import driver

SOURCE = """
volatile unsigned count; volatile int level; volatile char letter = -3; volatile long wide;
volatile unsigned long mask = 0xF0000000; int local_too;
void __attribute__((noinline)) mark(int local_too)
{ count++; level = 50 - (int)count + local_too; wide -= 70000; mask |= 16; }
int main(void) { for (;;) { mark(0); letter++; } }
"""
CONDITIONS = ("count == 40", "count", "!level", "level < -20", "level >= 45 && count != 2", "3 < count", "letter == -1",
              "wide < -900000", "mask == 0xF0000010 && count > 30")  # fmt: skip


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filters")
    (folder / "p.c").write_text(SOURCE)
    assert driver.main(["-Os", "-g", str(folder / "p.c"), "-o", str(folder / "p.elf")]) == 0
    return folder / "p.elf"


def machine_of(image: Path, engine: str) -> emu.Machine:
    machine = emu.load(image, engine=engine, board=None)
    if isinstance(machine.runner, JitEngine):
        machine.runner.threshold, machine.runner.wait = 1, True
    return machine


def stops(machine: emu.Machine, condition: str) -> tuple[list[int], int]:
    """Return the cycles of the first stops at `mark` with a condition, and how often Python was called."""
    address, calls, found = machine.program_address("mark"), 0, []

    def hook() -> bool:
        nonlocal calls
        calls += 1
        return bool(number_of(evaluate(machine.inspector, condition)))

    filter_ = filter_of(machine.inspector, condition, address)
    assert filter_ is not None
    machine.hook_pc(address, hook, filter_)
    for _ in range(5):
        if machine.run(cycles=2_000).reason == "breakpoint":
            found.append(machine.cycle)
    return found, calls


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_stops_are_those_of_the_plain_engine(image: Path, condition: str) -> None:
    expected, arrivals = stops(machine_of(image, "plain"), condition)
    assert expected
    native, calls = stops(machine_of(image, "jit"), condition)
    assert native == expected
    assert calls <= arrivals


def test_native_code_does_not_call_a_hook_whose_filter_is_false(image: Path) -> None:
    _, calls = stops(machine_of(image, "jit"), "count == 40")
    _, arrivals = stops(machine_of(image, "plain"), "count == 40")
    assert calls < arrivals / 4


@pytest.mark.parametrize(
    "condition",
    ["local_too == 1", "count + 1 == 2", "level == 0xFFFF", "count == -1", "count == 3u", "TMR1 > 5", "nothing"],
)
def test_other_conditions_have_no_filter(image: Path, condition: str) -> None:
    """Locals, arithmetic, comparisons that C converts to unsigned, registers and unknown names are left to Python."""
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
