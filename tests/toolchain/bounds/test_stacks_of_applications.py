"""Stacks and handlers of applications and of random programs, observed at every instruction, never exceed their bounds.

Samples of `python -m bench.kernel.stacks` and of tests/fuzz/compiler/fuzz_bounds.py; errors planted in the analysis are
found.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import emu
from bench.kernel.stack_observer import RETURN_ADDRESS, Observer
from bench.kernel.stacks import VALUES, StackRow, rows_of, table
from tests.firmware.conftest import Build, image
from tests.fuzz.compiler.fuzz_bounds import examine
from toolchain.bounds import interference
from toolchain.bounds.interference import SECOND_STACK, report_of
from toolchain.bounds.preserved import PreservedRegisters
from toolchain.bounds.program import Program
from toolchain.bounds.report import Bound, BoundAnalysis
from toolchain.elf.read import read_executable

CYCLES = 900_000
"""Long enough for the first line of listing1's log."""
SHORT = 200_000
"""Long enough for the first message of hello."""

TWO_TIMERS = """
#include <xc.h>
volatile int handled;
void __attribute__((interrupt, no_auto_psv)) _T1Interrupt(void) { IFS0bits.T1IF = 0; handled++; }
void __attribute__((interrupt, no_auto_psv)) _T2Interrupt(void) { IFS0bits.T2IF = 0; handled++; }
int main(void)
{
    PR1 = 150;
    PR2 = 151;
    IPC0bits.T1IP = 4;
    IPC1bits.T2IP = 5;
    T1CON = T2CON = 0x8000;
    IEC0bits.T1IE = 1;
    IEC0bits.T2IE = 1;
    for (;;) {
    }
}
"""
"""Timers of nearly equal periods: each interrupt occurs at every distance from the other."""

RESET = """
    .text
    .global __reset
__reset:
    mov #0x900, w15
    mov #0xA00, w0
    mov w0, SPLIM
    nop
    bra _load
"""
"""Start-up code of a program without main."""

__all__ = ["image"]


def program_of(path: Path) -> Program:
    return Program(read_executable(path.read_bytes(), str(path)))


@pytest.mark.slow
def test_no_stack_of_an_application_exceeds_its_bound(image: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    """No measured stack of listing1 exceeds its bound, and the stack of its thread alone equals the bound.

    The thread's deepest call is snprintf, whose assembly shares W9 between its routines. An analysis that assumes
    that all routines preserve W8-W14 gives a bound below the measurement.
    """
    path = image("listing1")
    seen = Observer(path, program_of(path)).run(CYCLES)
    report = report_of(program_of(path), ["main"])
    for name, most in seen.stacks.items():
        bound = report.stacks[name]
        assert bound is not None
        assert most <= bound, name
    thread = next(row for row in report.threads if row.name == "loggingThread")
    assert RETURN_ADDRESS + thread.bytes == seen.alone["loggingThread"] == 88 + RETURN_ADDRESS
    monkeypatch.setattr(PreservedRegisters, "changed_by", lambda _self, _entry: frozenset())
    program = program_of(path)
    planted = BoundAnalysis(program).bound("loggingThread", program.calls.named("loggingThread"), "thread")
    assert RETURN_ADDRESS + planted.bytes < seen.alone["loggingThread"]


@pytest.mark.slow
@pytest.mark.parametrize("app", ["search", "foraging"])
def test_every_stack_of_an_application_has_a_bound(image: Build, app: str) -> None:
    """Loops and calls through pointers of the application and its drivers are annotated."""
    path = image(app)
    report = report_of(Program(read_executable(path.read_bytes(), str(path)), VALUES), [])
    assert report.stacks.keys() >= {"main", SECOND_STACK}
    assert None not in report.stacks.values(), report.unbounded_stacks


@pytest.mark.slow
def test_interrupts_requested_in_the_deepest_moments_reach_nested_stacks(
    image: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Requested interrupts nest deeper than in the plain run and stay within every bound.

    An analysis that omits nested interrupts states a bound below the measured depth.
    """
    path = image("hello")
    rows = rows_of("hello", path, SHORT)
    assert not [row for row in rows if row.is_exceeded]
    assert {row.unit for row in rows} == {"bytes", "cycles"}
    assert "| hello | `greet` | 70 | " in table(rows)
    observer = Observer(path, program_of(path))
    plain = dict(observer.run(SHORT).stacks)
    nested = {row.name: row.seen for row in rows}
    assert nested["greet"] > plain["greet"]
    assert nested["kernel stack"] > plain["kernel stack"]
    monkeypatch.setattr(interference, "_on_top", lambda _interrupts, _level: 0)
    planted = report_of(program_of(path), ["main"]).stacks["greet"]
    assert planted is not None
    assert plain["greet"] <= planted < nested["greet"]


@pytest.mark.slow
def test_an_interrupt_of_the_entry_of_a_handler_is_measured(tmp_path: Path) -> None:
    """A handler that interrupts another one's entry ends where it returns to that entry, not at the end of both."""
    source, path = tmp_path / "timers.c", tmp_path / "timers.elf"
    source.write_text(TWO_TIMERS)
    emu.build(source, output=path, flags=("-Os", "-g"))
    rows = {row.name: row for row in rows_of("timers", path, 60_000)}
    assert not [row for row in rows.values() if row.is_exceeded]
    assert rows["__T1Interrupt"].seen == rows["__T2Interrupt"].seen == rows["__T1Interrupt"].bound


@pytest.mark.slow
def test_code_without_main_is_measured_from_its_first_function(tmp_path: Path) -> None:
    """An image without start-up code and main, such as a boot loader, begins at the first C function after reset."""
    start, source, path = tmp_path / "start.s", tmp_path / "loader.c", tmp_path / "loader.elf"
    start.write_text(RESET)
    source.write_text("volatile int x; void load(void) { int kept[8]; kept[x & 7] = 1; x = kept[x & 3]; for (;;); }\n")
    emu.build(source, start, output=path, flags=("-Os", "-g", "-nostartfiles", "-Wl,--no-data-init"))
    (row,) = (row for row in rows_of("loader", path, 5_000) if row.name == "load alone")
    assert row.seen == row.bound == RETURN_ADDRESS + 16


def test_a_row_below_its_measurement_is_exceeded() -> None:
    """A measurement above its bound is reported; a bound that is not known is not exceeded."""
    assert not StackRow("a", "main", "bytes", None, 50).is_exceeded
    assert not StackRow("a", "main", "bytes", 50, 50).is_exceeded
    assert StackRow("a", "main", "bytes", 49, 50).is_exceeded


@pytest.mark.slow
def test_an_unsound_stack_of_a_random_program_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign of random programs finds a stack bound that is two bytes too small."""
    assert examine(2, tmp_path)[0] == "bounded"
    whole = Bound.bytes.fget
    assert whole is not None
    monkeypatch.setattr(Bound, "bytes", property(lambda self: whole(self) - 2))
    with pytest.raises(AssertionError, match="bytes of stack, bound"):
        examine(2, tmp_path)
