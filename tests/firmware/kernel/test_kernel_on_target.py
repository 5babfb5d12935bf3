"""The kernel on the emulated dsPIC30F6014A: time, preemption at every instruction, registers, stack limits."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

import emu
from emu import Machine
from emu.cli import main
from tests.cases import check_all
from tests.firmware.conftest import TARGET_APPS, Build

FCY = 14_745_600
ENGINE = "auto"


def load(path: Path, ipl_slip: int = 0) -> Machine:
    return emu.load(path, engine=ENGINE, ipl_slip=ipl_slip)


def place(machine: Machine, symbol: str) -> int:
    """Return the program address of a C function or of an assembly label."""
    assert machine.image is not None
    found = machine.image.symbols.find("_" + symbol) or machine.image.symbols.find(symbol)
    assert found is not None, symbol
    return found.address


def run_to(machine: Machine, symbol: str, cycles: int = 10 * FCY) -> None:
    stop = machine.run(cycles=cycles, until=place(machine, symbol))
    assert stop.reason == "until", stop


def check_each_from(machine: Machine, symbol: str, check: Callable[..., object], cases: Iterable[Any]) -> None:
    """Run to a function, and check each case from there."""
    run_to(machine, symbol)
    begin = machine.snapshot()

    def check_from_there(*case: Any) -> None:
        machine.restore(begin)
        check(*case)

    check_all(check_from_there, cases)


def words(machine: Machine, name: str, count: int) -> list[int]:
    at = machine.address_of(name)
    return [machine.peek(at + 2 * i) for i in range(count)]


# ---- Listing 1 ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def listing1(image: Build) -> tuple[bytes, list[int], list[int]]:
    """Run 2.1 s and return UART1's output, the wake-up cycles of the log thread and the first-bit cycle of each
    line."""
    machine = emu.load(image("listing1"), engine=ENGINE, board="none")  # camera interrupts would delay a wake-up
    said = bytearray()
    wakes: list[int] = []
    starts: list[int] = []

    def on_byte(byte: int, cycle: int) -> None:
        if not said or said[-1] == 0x0A:
            starts.append(cycle)
        said.append(byte)

    machine.uart[1].on_byte = on_byte
    machine.hook_pc(place(machine, "sprintf"), lambda *_: wakes.append(machine.cycle))
    machine.run(cycles=21 * FCY // 10)
    return bytes(said), wakes, starts


@pytest.mark.slow
def test_listing1_logs_every_250_ms(listing1: tuple[bytes, list[int], list[int]]) -> None:
    """The log lines have the format of the paper's Listing 1, time:(left,right)."""
    said, _, _ = listing1
    assert said.decode() == "".join(f"{250 * i}:(0,0)\r\n" for i in range(9))


def test_wake_ups_are_exactly_3686400_cycles_apart(listing1: tuple[bytes, list[int], list[int]]) -> None:
    """Wake-ups are exactly 250 ms = 3,686,400 Tcy apart; start bits vary only by the time of formatting."""
    _, wakes, starts = listing1
    del wakes[0], starts[0]  # the thread logs before its first wait
    assert [b - a for a, b in itertools.pairwise(wakes)] == [3_686_400] * (len(wakes) - 1)
    bit = 128  # Tcy at 115,200 baud: transmission starts at the next edge of the free-running baud clock
    assert all(abs(b - a - 3_686_400) <= 1000 + bit for a, b in itertools.pairwise(starts))


@pytest.mark.slow
def test_the_clock_does_not_drift(image: Build) -> None:
    """The clock does not drift: five 1 ms events take exactly 73,728 Tcy, 3,600,000 take 53,084,160,000 (kernel.md
    §3)."""
    machine = load(image("hello"))
    ticks: list[int] = []
    machine.hook_pc(place(machine, "_T1Interrupt"), lambda *_: ticks.append(machine.cycle))
    machine.run(cycles=FCY // 4)
    assert len(ticks) > 200
    fives = [b - a for a, b in zip(ticks[::5], ticks[5::5], strict=False)]
    jitter = max(fives) - min(fives)
    assert jitter <= 8, "interrupt latency varies by a few cycles, the period does not"
    assert abs(sum(fives) - 73_728 * len(fives)) <= 8


# ---- Registers ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_registers_survive_preemption_under_a_storm(image: Build) -> None:
    """Registers survive preemption during an interrupt storm (kernel.md §4).

    Checked are all W registers, flags, RCOUNT and TBLPAG; with SYS_DSP also accumulators, CORCON and nested DO
    loops. Bugs 7 (an interrupt overwrote saved registers) and 23 (accumulators saved in part) of
    openswarm-original.md §7.
    """
    machine = load(image("registers", TARGET_APPS))
    machine.run(cycles=200_000)
    machine.write("PR2", 60)  # slices of 488 Tcy instead of 147,456
    switches = 0

    def count(*_: object) -> None:
        nonlocal switches
        switches += 1

    machine.hook_pc(place(machine, "_T2Interrupt"), count)
    machine.run(cycles=3_000_000)
    assert machine.peek("broken") == 0
    assert switches > 2_500
    assert all(words(machine, "checked", 4))
    assert machine.peek("stormed") > 1_500
    assert machine.peek("stormed") - machine.peek("handled") <= 1


# ---- Stack limits -------------------------------------------------------------------------------------------------

DROPS = "DEFINES=-DSYS_ON_OVERFLOW=SYS_DROP_THREAD"
"""Make variable by which a stack overflow ends only its thread."""
LED_RING = 0xF6C0
"""Bits of LATA that light the ring: the pattern of the safe state (board/epuck/pins.h)."""
KINDS = ["push", "call chain", "large frame", "variadic call", "kernel call without room", "interrupt frame"]


@pytest.mark.slow
def test_a_stack_overflow_ends_only_the_offender(image: Build) -> None:
    """A stack overflow ends only the thread that causes it if the program chooses so (openswarm_config.h).

    Source: kernel.md §4; bug 21 of openswarm-original.md §7.
    """
    machine = load(image("overflow", TARGET_APPS, DROPS))
    machine.stop_on_fault = False
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)

    def check(kind: str) -> None:
        said.clear()
        machine.poke("kind", KINDS.index(kind))
        stop = machine.run(cycles=FCY // 20)
        assert stop.reason == "limit", stop
        culprit = machine.peek("culprit_pid")
        assert machine.peek("ended") == culprit
        assert said.decode() == f"stack overflow: thread {culprit}\r\n"
        rounds = words(machine, "rounds", 2)
        machine.run(cycles=FCY // 50)
        assert all(now > before for now, before in zip(words(machine, "rounds", 2), rounds, strict=True))
        assert machine.peek("LATD") & 0xFF == 0, "the motors stop"

    check_each_from(machine, "begin", check, KINDS)


@pytest.mark.slow
@pytest.mark.parametrize("words", [(), (DROPS,)], ids=["stops", "drops"])
def test_the_emulator_reports_a_stack_overflow_as_a_fault(image: Build, words: tuple[str, ...]) -> None:
    """The report names thread and function, whether the system stops or ends only the thread and continues."""
    machine = load(image("overflow", TARGET_APPS, *words))

    def check(kind: str) -> None:
        machine.poke("kind", KINDS.index(kind))
        stop = machine.run(cycles=FCY // 20)
        assert stop.reason == "fault", stop
        assert stop.fault is not None
        assert stop.fault.cause.startswith("stack overflow")
        assert stop.fault.thread is not None
        assert f"thread {machine.peek('culprit_pid')}" in stop.fault.thread
        assert stop.fault.frames[0].function
        if words:
            assert machine.run(cycles=FCY // 20).reason == "limit"
            assert machine.peek("ended") == machine.peek("culprit_pid")
        else:
            assert machine.peek("LATD") & 0xFF == 0, "the motors stop"
            assert machine.peek("LATA") & LED_RING == LED_RING
            assert machine.peek("ended") == 0

    check_each_from(machine, "begin", check, KINDS)


def test_a_run_ends_with_status_1_after_a_stack_overflow(image: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """`emu run`, also with --json, exits with status 1 after the first kind of overflow, a push."""
    path = str(image("overflow", TARGET_APPS))
    assert main(["run", path, "--seconds", "0.1"]) == 1
    assert "stack overflow" in capsys.readouterr().err
    assert main(["run", path, "--seconds", "0.1", "--json"]) == 1
    facts = json.loads(capsys.readouterr().out)
    assert facts["status"] == 1
    assert facts["reason"] == "fault"


def test_a_trap_stops_the_motors_and_reports(image: Build) -> None:
    """A trap stops the motors and then reports cause, PC and thread over UART1."""
    machine = load(image("overflow", TARGET_APPS))
    run_to(machine, "begin")
    machine.poke("kind", len(KINDS))
    machine.run(cycles=FCY // 50)
    assert machine.peek("LATD") & 0xFF != 0
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    machine.pc = 0x018000  # unimplemented program memory (isa.md §14.4)
    machine.run(cycles=FCY // 100)
    assert machine.peek("LATD") & 0xFF == 0
    assert b"address trap at 0x" in said
    assert b" in thread " in said


# ---- Every instruction ----------------------------------------------------------------------------------------------

T2IF, T3IF, INT1IF = 1 << 6, 1 << 7, 1 << 0


def thread_list(machine: Machine) -> list[int]:
    """Return the PCBs on the ring and on the blocked list; assert that both lists are well-formed."""
    ring, seen = machine.peek("os_ring"), []
    at = ring
    while at and (not seen or at != ring):
        seen.append(at)
        at = machine.peek(at + 14)
        assert len(seen) < 20
    at = machine.peek("os_blocked")
    while at:
        seen.append(at)
        at = machine.peek(at + 14)
        assert len(seen) < 20
    assert len(seen) == len(set(seen))
    return seen


@pytest.mark.slow
def test_a_thread_keeps_64_of_its_128_bytes(image: Build) -> None:
    """Interrupts and kernel leave a thread 64 of 128 stack bytes, measured with a fill pattern and nested
    interrupts."""
    machine = load(image("points", TARGET_APPS))
    run_to(machine, "scenario_begin")
    begin = machine.cycle
    nested = 0
    spot = place(machine, "pattern_checker")

    def storm(*_: object) -> None:
        nonlocal nested
        nested += 1
        machine.poke("IFS0", machine.peek("IFS0") | T2IF | T3IF)
        machine.write("IFS1", machine.peek("IFS1") | INT1IF)

    for offset in range(0, 60, 6):
        machine.hook_pc(spot + offset, storm)
    machine.run(cycles=400_000)
    assert nested > 100
    assert machine.cycle > begin
    pid = machine.peek("checker_pid")
    pcb = next(p for p in thread_list(machine) if machine.peek(p + 16) == pid)
    block = machine.peek(pcb + 10)
    stack = [machine.peek(a) for a in range(block, pcb - 12, 2)]
    unused = 0
    while stack and stack[-1] == 0xA5A5:
        stack.pop()
        unused += 2
    assert unused >= 64, "the checker itself uses four bytes and a call"
