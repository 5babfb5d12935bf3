"""The safe state after a fault: time until the wheels stop, the LED pattern, the cause that survives a reset."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, LED_RING, load, place, run_to

KINDS = (
    "trap",
    "assertion",
    "stack overflow of a thread",
    "critical section that does not end",
    "handler that does not end",
)
"""Faults by the values of `kind` in target/failsafe."""
WATCHDOG_TCY = 128 * FCY // 1000
PIN_MOTORS = 0xFF
RESET_WATCHDOG, RESET_PIN = 4, 2
FAULT_ADDRESS, FAULT_STACK, FAULT_ASSERTION = 2, 5, 6
"""Values of sys_reset and sys_fault (openswarm_reset.h)."""
UARTEN, UTXEN = 1 << 15, 1 << 10
TABLE = Path(__file__).parents[3] / "docs" / "reference" / "kernel.md"


def driving(image: Build, kind: int) -> Machine:
    """Return a machine at the instruction before the fault; the motors turn."""
    machine = load(image("failsafe", TARGET_APPS))
    run_to(machine, "begin")
    machine.poke("kind", kind)
    run_to(machine, "fault")
    assert machine.peek("LATD") & PIN_MOTORS
    assert machine.peek("TRISD") & PIN_MOTORS == 0
    return machine


def has_no_current(machine: Machine) -> bool:
    """Whether no coil has current: the outputs are low, or the pins are inputs after a reset."""
    return machine.peek("LATD") & PIN_MOTORS == 0 or machine.peek("TRISD") & PIN_MOTORS == PIN_MOTORS


def cycles_until_stop(machine: Machine) -> int:
    """Run until the wheels stop, by an instruction or by the watchdog's reset; return the number of Tcy."""
    begin, resets = machine.cycle, len(machine.resets)
    for _ in range(4000):
        machine.step()
        if has_no_current(machine):
            return machine.cycle - begin
    machine.stop_on_fault = False
    machine.run(cycles=2 * WATCHDOG_TCY, until=place(machine, "begin"))
    assert len(machine.resets) == resets + 1, "the wheels continue to turn"
    return machine.resets[-1][0] - begin


def table() -> dict[str, int]:
    """Return the documented Tcy by kind of fault (docs/reference/kernel.md)."""
    rows = re.findall(r"^\| ([a-z][^|]*?) \| ([\d,]+) \|", TABLE.read_text(), re.M)
    return {kind: int(number.replace(",", "")) for kind, number in rows if kind in KINDS}


@pytest.mark.slow
def test_the_wheels_stop_within_the_documented_time(image: Build) -> None:
    measured = {name: cycles_until_stop(driving(image, kind)) for kind, name in enumerate(KINDS)}
    documented = table()
    assert set(documented) == set(KINDS)
    assert {kind: tcy <= documented[kind] for kind, tcy in measured.items()} == dict.fromkeys(KINDS, True), measured


@pytest.mark.parametrize(
    ("kind", "fault"),
    [(0, FAULT_ADDRESS), (1, FAULT_ASSERTION), (2, FAULT_STACK)],
    ids=["trap", "assertion", "overflow"],
)
def test_a_fault_is_reported_and_kept_over_a_reset(image: Build, kind: int, fault: int) -> None:
    """The run ends as a fault with a thread; after a reset by the pin the program reads cause, thread and place."""
    machine = driving(image, kind)
    stop = machine.run(cycles=FCY // 10)
    assert stop.reason == "fault", stop
    assert stop.fault is not None
    assert stop.fault.thread is not None
    assert machine.peek("LATD") & PIN_MOTORS == 0
    assert machine.peek("LATA") & LED_RING == LED_RING
    machine.reset("EXTR")
    run_to(machine, "begin")
    cause = machine.address_of("cause")
    assert machine.peek(cause) == RESET_PIN | fault << 8
    assert machine.peek(cause + 2) == 1, "the PID of the thread"
    assert machine.peek(cause + 4) != 0, "the place"
    machine.reset("EXTR")
    run_to(machine, "begin")
    assert machine.peek(cause) == RESET_PIN, "a fault is reported once"


def test_an_assertion_before_the_kernel_names_main(image: Build) -> None:
    """Before Sys_Init_Kernel a report names thread 0, here on a UART1 that a boot loader has left enabled."""
    machine = load(image("failsafe", TARGET_APPS))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    run_to(machine, "main")
    machine.write("U1MODE", UARTEN)
    machine.write("U1STA", UTXEN)
    machine.w[0], machine.w[1] = machine.address_of("depth"), 7  # an empty file name
    machine.pc = machine.program_address("Sys_Assertion_Failed")
    assert machine.run(cycles=FCY // 10).reason == "fault"
    assert said == b":7 in thread 0\r\n"


@pytest.mark.parametrize("kind", [3, 4], ids=["section", "handler"])
def test_the_watchdog_ends_in_the_safe_state(image: Build, kind: int) -> None:
    """After the watchdog's reset the program stops in the safe state; `emu` reports it as a fault."""
    machine = driving(image, kind)
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    stop = machine.run(cycles=4 * WATCHDOG_TCY)
    assert stop.reason == "fault", stop
    assert said.startswith(b"watchdog reset:128 in thread 0"), said
    assert machine.peek(machine.address_of("cause")) == RESET_WATCHDOG
    assert has_no_current(machine)
    assert machine.peek("LATA") & LED_RING == LED_RING


def test_a_program_that_works_is_not_bitten(image: Build) -> None:
    machine = driving(image, len(KINDS))
    resets = len(machine.resets)
    assert machine.run(cycles=4 * WATCHDOG_TCY).reason == "limit"
    assert len(machine.resets) == resets
