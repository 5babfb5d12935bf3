"""Tests of the host on the emulated robot, each after a reset: named bugs of the original system, kills, misuse."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import START, robot
from tests.firmware.kernel.test_kernel_on_target import FCY, check_each_from, load, place, run_to
from tests.fuzz.seeds import base_seed

HOST = Path(__file__).parents[1] / "host"
# These need hooks of the host or its UART sink; test_every_instruction.py and the processor tests cover some of them.
HOST_ONLY = {
    "bug_13_events_from_threads_and_interrupts_mix_at_every_point",
    "bug_24b_each_uart_sends_its_own_bytes",
    "a_kill_at_every_unlock_of_any_call_loses_nothing",
    "an_eager_kill_at_every_unlock_of_any_call_loses_nothing",
    "a_failing_allocation_in_any_call_loses_nothing",
    "a_kernel_without_threads_starts_threads_from_a_handler",
}
SOURCES = ("original_bugs", "kills", "misuse")
"""Files of HOST without .c."""


@pytest.mark.slow
@pytest.mark.parametrize("source", SOURCES)
def test_the_kernel_on_the_robot(image: Build, source: str) -> None:
    """Each test of the host's file that can run on the chip passes on the emulated robot (openswarm-original.md §7)."""
    found = re.findall(r"^TEST\((\w+),", (HOST / f"{source}.c").read_text(), re.M)
    tests = [name for name in found if name not in HOST_ONLY]
    assert len(tests) > 5
    defines = f"DEFINES=-DSOURCE={source} -DTESTS={','.join(tests)} -DSYS_DEFAULT_STACK=192"
    machine = load(image("bugs", TARGET_APPS, defines))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)

    def check(name: str) -> None:
        said.clear()
        machine.poke("chosen", tests.index(name))
        stop = machine.run(cycles=4 * FCY, until=place(machine, "passed"))
        assert stop.reason == "until", (stop, bytes(said))

    check_each_from(machine, "begin", check, tests)


@pytest.mark.slow
def test_bug_22_the_kernel_works_at_every_optimisation_level(image: Build) -> None:
    """Bug 22, only -O0 worked: every kernel call works at each optimisation level (openswarm-original.md §7).

    All other images are compiled with -Os; the commit determines the level of this one. A second thread checks its
    registers meanwhile. The functions that `emu cycles` stops at are not inlined.
    """
    level = ("-O0", "-O1", "-O2")[base_seed() % 3]
    machine = load(image("calls", TARGET_APPS, f"OPTIMISE={level}", "DEFINES=-DSYS_DEFAULT_STACK=256"))
    for name in ("Sys_Yield", "Sys_Send_Event", "hal_idle", "_T1Interrupt", "_T2Interrupt"):
        assert place(machine, name)
    for _ in range(18):  # each scene is run twice
        run_to(machine, "scene_end")
        machine.step()
    assert machine.peek("failures") == 0
    assert machine.peek("broken") == 0
    assert machine.peek("heard") == machine.peek("sent") > 8
    assert machine.peek("checked") > 10


def test_bug_16_images_are_not_classified_in_an_interrupt(image: Build) -> None:
    """Bug 16: image classification no longer blocks stepping, clock and scheduling (openswarm-original.md §7)."""
    machine = robot(image("clustering"), engine="auto", selector=START)
    stop = machine.run(cycles=FCY, until=place(machine, "on_frame"))
    assert stop.reason == "until"
    assert machine.peek("SR") >> 5 & 7 <= 1, "in a handler, which every device interrupts"
