"""The named bugs of the original system on the emulated robot: tests of host/original_bugs.c, each after a reset."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.drivers.test_drivers_on_target import START, robot
from tests.firmware.kernel.test_kernel_on_target import FCY, check_each_from, load, place, run_to
from tests.fuzz.seeds import base_seed

HOST = Path(__file__).parents[1] / "host"
# These need the host's unlock hook or UART sink; test_every_instruction.py and the processor tests cover them.
HOST_ONLY = {"bug_13_events_from_threads_and_interrupts_mix_at_every_point", "bug_24b_each_uart_sends_its_own_bytes"}
TESTS = [
    name for name in re.findall(r"^TEST\((\w+),", (HOST / "original_bugs.c").read_text(), re.M) if name not in HOST_ONLY
]


@pytest.mark.slow
def test_the_kernel_on_the_robot(image: Build) -> None:
    """Each test of host/original_bugs.c that can run on the chip passes on the emulated robot (openswarm-original.md
    §7)."""
    defines = f"DEFINES=-DTESTS={','.join(TESTS)} -DSYS_DEFAULT_STACK=192"
    machine = load(image("bugs", TARGET_APPS, defines))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)

    def check(name: str) -> None:
        said.clear()
        machine.poke("chosen", TESTS.index(name))
        stop = machine.run(cycles=4 * FCY, until=place(machine, "passed"))
        assert stop.reason == "until", (stop, bytes(said))

    check_each_from(machine, "begin", check, TESTS)


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
