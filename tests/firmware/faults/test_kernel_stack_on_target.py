"""The kernel stack has its own limit: an overflow causes a trap before it damages the heap."""

from __future__ import annotations

import re

import pytest

from emu.machine.machine import Machine
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.kernel.test_kernel_on_target import FCY, check_each_from, load, place, run_to

KERNEL_STACK = 224
"""Size of the kernel stack in bytes (port/dspic30f/hal_limits.h); the heap follows it."""
FIRST = 0x41
"""Value of the firmware's `kind` that selects the first of KINDS (target/handlers)."""
KINDS = {
    "formats": ("snprintf", "vsnprintf", "format", "formats"), "recursion": ("chain",), "large frame": ("large_frame",),
    "kernel call without room": ("Sys_Send_IntEvent", "Sys_Send_Event"), "condition": ("chain",),
    "interrupt": ("chain",), "scheduler": ("chain",),
}  # fmt: skip
"""Overflow cases with the functions that may be running at the trap; the first case allows any library function."""


def heap(machine: Machine) -> list[int]:
    """Return the first words after the kernel stack: the first small heap block and its successors."""
    first = machine.address_of("os_memory") + KERNEL_STACK
    return [machine.peek(address) for address in range(first, first + 64, 2)]


def culprit(machine: Machine, said: bytes) -> str:
    """Return the name of the function at the address in the fault report."""
    assert machine.image is not None
    found = re.search(rb"stack trap at 0x([0-9a-f]+):([0-9a-f]+) in thread \d+\r\n", said)
    assert found, said
    inside = machine.image.symbols.code(int(found[1], 16) << 16 | int(found[2], 16))
    assert inside is not None
    return inside[0].name.lstrip("_")


@pytest.mark.slow
@pytest.mark.parametrize("ipl_slip", [0, 1])
def test_an_overflow_of_the_kernel_stack_is_caught_at_the_culprit(image: Build, ipl_slip: int) -> None:
    """An overflow of the kernel stack, here by snprintf("%f") in a handler, is reported in the function that causes
    it."""
    machine = load(image("handlers", TARGET_APPS), ipl_slip)
    said = bytearray()
    machine.uart[1].on_byte = lambda byte, _: said.append(byte)
    before: list[list[int]] = []
    harmed: list[bool] = []
    for name in ("snprintf", "deep_handler", "deep_condition", "deep_isr", "deep_pick"):
        machine.hook_pc(place(machine, name), lambda: before.append(heap(machine)) is not None)
    machine.hook_pc(place(machine, "_StackError"), lambda: harmed.append(heap(machine) != before[-1]) is not None)

    def check(kind: str) -> None:
        for seen in (said, before, harmed):
            seen.clear()
        machine.poke("kind", FIRST + list(KINDS).index(kind))
        stop = machine.run(cycles=FCY // 4, until=place(machine, "hal_stop"))
        assert stop.reason == "until", stop
        assert harmed == [False]
        assert machine.peek("LATD") & 0xFF == 0, "the motors stop"
        name = culprit(machine, bytes(said))
        library = kind == "formats" and name not in ("chain", "fill", "large_frame")
        assert name in KINDS[kind] or library, name

    check_each_from(machine, "begin", check, KINDS)


@pytest.mark.slow
def test_half_a_kernel_stack_is_free_beside_an_ordinary_handler(image: Build) -> None:
    """The same program without an overflow runs: an ordinary handler leaves half of the kernel stack free."""
    machine = load(image("handlers", TARGET_APPS))
    run_to(machine, "begin")
    machine.poke("kind", 0)
    assert machine.run(cycles=FCY // 4).reason == "limit"
    assert machine.peek("rounds") > 100
