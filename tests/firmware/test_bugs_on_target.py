"""The named bugs of the original on the emulated robot: host/original_bugs.c, one test per reset."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.test_on_target import FCY, load, place, run_to

HOST = Path(__file__).parent / "host"
# Needs the host's unlock hook, or its UART sink: test_interrupts_at_every_instruction and the processors test do these.
HOST_ONLY = {"bug_13_events_from_threads_and_interrupts_mix_at_every_point", "bug_24b_each_uart_sends_its_own_bytes"}
TESTS = [
    name for name in re.findall(r"^TEST\((\w+),", (HOST / "original_bugs.c").read_text(), re.M) if name not in HOST_ONLY
]


@pytest.mark.parametrize("name", TESTS)
def test_the_kernel_on_the_robot(image: Build, name: str) -> None:
    """openswarm-original.md §7; issue 4, Must show 2: on posix and on emu."""
    defines = f"DEFINES=-DTESTS={','.join(TESTS)} -DSYS_DEFAULT_STACK=192"
    machine = load(image("bugs", TARGET_APPS, defines))
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    run_to(machine, "begin")
    machine.poke("chosen", TESTS.index(name))
    stop = machine.run(cycles=4 * FCY, until=place(machine, "passed"))
    assert stop.reason == "until", (stop, bytes(said))
