"""Cycle counts in the headers and masked times of the port, compared with `toolchain bounds` of an image."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import emu
from bench.kernel.bounds import IMAGES, rows_of
from tests.firmware.conftest import TARGET_APPS, Build
from tests.firmware.contracts import CALL, HEADERS, callers, numbers
from tests.firmware.kernel.test_option_headers import OTHERS
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.cli import main
from toolchain.elf.read import read_executable

LOAD = {"n": 4, "m": 4, "b": 1, "s": 1, "q": 1, "i": 0, "u": 100, "d": 2, "k": 224}
SHORT = ("swap_reserve", "refuse_message", "first_waiter")
"""Functions that are not called if memory suffices and the event is registered and has a subscriber."""
SWITCH = ("os_schedule", "save_dsp", "resume_dsp")
"""Functions that are not called if no message is pending and neither thread has SYS_DSP."""
PROMISES = {
    "Sys_Yield": (SWITCH, "54 to a yielded thread, 65 to a preempted one, with the call instruction", 65, 1.0),
    "Sys_Start_CriticalSection": ((), "18, the end 15", 18, 1.0),
    "Sys_End_CriticalSection": ((), "18, the end 15", 15, 1.0),
    "Sys_Get_ProcessState": ((), "90 + 25 n", 90 + 25 * LOAD["n"], 1.0),
    "Sys_Get_UnusedStack": ((), "110 + 22 n + 10 per byte", 110 + 22 * LOAD["n"] + 10 * LOAD["u"], 1.0),
    "Sys_Get_UnusedKernelStack": ((), "20 + 8 per byte", 20 + 8 * LOAD["u"], 1.0),
    "Sys_IsEventRegistered": ((), "40 + 9 b", 40 + 9 * LOAD["b"], 1.0),
    "Sys_Set_Scheduler": ((), "28, refused 35", 35, 1.0),
    "Sys_Get_LostEvents": ((), "40", 40, 1.0),
    "Sys_Get_SystemTime": ((), "9", 9, 1.0),
    "Sys_Get_LastError": ((), "18", 18, 1.0),
    "Sys_Send_IntEvent": (SHORT, "104, or 133 + 10 b", 133 + 10 * LOAD["b"], 1.15),
}
"""For each call: excluded functions, contract text, its cycles under LOAD, permitted excess of the bound.

Measured contracts may lie below the bound, because the bound cannot exclude some paths: for a send, a constant
payload and a scheduler that preempts.
"""
SWITCHES = ("hal_yield", "hal_block", "hal_abandon")
"""Functions that save the frame of a switch, which is not part of a contract line."""
INLINED = {"Sys_Get_ProcessID", "Sys_Get_Statistics", "Sys_Get_MotorSpeed_Left", "Sys_Get_MotorSpeed_Right"}
"""Calls of openswarm.h that the link-time optimiser inlines, so that they need no stack of their own."""
NO_CALLS = {"Sys_Assertion_Failed", "Sys_Default_MotorProcessor", "Sys_Raw_Tx", "Sys_Chunk_Rx", "Sys_Frame_Tx",
            "Sys_Frame_Rx"}  # fmt: skip
"""Functions without a contract line: one that ends the system, and processors, which drivers call."""
LINK = ("Sys_Send_Neighbours", "Sys_Get_Neighbours", "Sys_Get_RobotNumber", "Sys_Set_RobotNumber",
        "Sys_Set_InfraredThreshold", "Sys_Estimate_Range")  # fmt: skip
"""Calls of openswarm_infrared.h that are bounded; those that start the link run once and are omitted."""
RETURN_ADDRESS = 4
CLOSE = ("Sys_Kill_Process", "end_thread", "Sys_Register_Event", "Sys_Unregister_Event", "Sys_Subscribe_to_Event",
         "Sys_Unsubscribe_Handler", "Sys_Send_Event", "Sys_Send_IntEvent", "Sys_Start_ProcessWith",
         "Sys_Get_ProcessState")  # fmt: skip
"""Calls whose worst case the image `crowded` creates: their bounds are at most 1.3 times the measured cycles."""
FREE = 1200
"""Maximum Tcy to free a block of memory (g of openswarm.h)."""
MEASURED = {
    "Sys_Start_Process": (
        "520 + 20 n, and 2 per byte beyond SYS_DEFAULT_STACK; at most 900 more while memory is short, and 800 in a "
        "handler",
        lambda n, k, **_: 520 + 20 * n + 2 * (k - 128) + 900 + 800,
    ),
    "Sys_Kill_Process": (
        "450 + 25 m + g per subscription of its own", lambda m, o, **_: 450 + 25 * m + FREE * o,
    ),
    "Sys_Get_ProcessState": ("90 + 25 n", lambda n, **_: 90 + 25 * n),
    "Sys_Register_Event": ("146 + 9 b; at most 600 more while memory is short", lambda b, **_: 146 + 9 * b + 600),
    "Sys_Unregister_Event": (
        "230 + 9 b + (15 + g) s + 20 n + 10 q + g",
        lambda b, s, n, q, **_: 230 + 9 * b + (15 + FREE) * s + 20 * n + 10 * q + FREE,
    ),
    "Sys_Subscribe_to_Event": (
        "140 + 9 b + 11 s + 18 n; at most 650 more while memory is short",
        lambda b, s, n, **_: 140 + 9 * b + 11 * s + 18 * n + 650,
    ),
    "Sys_Unsubscribe_Handler": ("120 + 9 b + (15 + g) s", lambda b, s, **_: 120 + 9 * b + (15 + FREE) * s),
    "Sys_Send_Event": (
        "95, or 124 + 10 b; 17 + d/2 more unless d = 2; 8 per waiting thread if there is no handler; 70 without "
        "listeners; at most 460 more while memory is short",
        lambda b, n, **_: 124 + 10 * b + 17 + 1 + 8 * n,
    ),
    "Sys_Send_IntEvent": ("104, or 133 + 10 b", lambda b, n, **_: 133 + 10 * b + 8 * n),
}  # fmt: skip
"""For each call that `crowded` makes with structures of their worst shapes: contract text, and its cycles by sizes."""
WITH_ROW = {"Sys_Start_Process": "Sys_Start_ProcessWith"}
"""Calls whose row is that of another call."""
SCENES = 4
DEVICES_MASKED = 56
"""Maximum Tcy for which levels 4 and 5 are masked, with the frame of a SYS_DSP thread (port/dspic30f/README.md)."""


@pytest.fixture(scope="module")
def calls(image: Build) -> tuple[str, object]:
    """Return the image that makes every kernel call."""
    path = image("calls", TARGET_APPS)
    return str(path), read_executable(path.read_bytes(), str(path))


@pytest.mark.slow
@pytest.mark.parametrize("call", PROMISES)
def test_a_call_takes_no_longer_than_its_contract(calls, call: str) -> None:
    """The contract of each call covers its bound, and is at most 1.6 times the bound."""
    left_out, text, cycles, slack = PROMISES[call]
    header = (HEADERS / "openswarm.h").read_text()
    lines = header[: re.search(rf"\b{call}\(", header).start()]
    assert f"| {text} |" in lines[lines.rindex("| no |") :] or f"| {text}." in lines[lines.rindex("| no |") :]
    _, executable = calls
    program = Program(executable, LOAD, left_out)
    bound = BoundAnalysis(program).bound(call, program.address(call), "call")
    assert not bound.unbounded
    assert bound.cycles <= slack * cycles
    assert cycles <= 1.6 * bound.cycles


@pytest.mark.parametrize("header", sorted(path.name for path in HEADERS.glob("openswarm*.h")))
def test_every_call_has_a_contract_line(header: str) -> None:
    """Each call of a public header states who may make it; outside of options, also its cycles and its stack."""
    declared = set(CALL.findall((HEADERS / header).read_text())) - NO_CALLS
    assert declared == set(callers(header))
    if header.removesuffix(".h").partition("_")[2] in {"", *OTHERS}:
        assert declared == set(numbers(header))


@pytest.mark.slow
def test_the_stack_of_every_call_is_its_bound(calls) -> None:
    """The stack bytes of each contract line of openswarm.h equal the bound, without the frame of a switch."""
    _, executable = calls
    program = Program(executable, LOAD, SWITCHES)
    analysis = BoundAnalysis(program)
    later = [call for call, letters in callers("openswarm.h").items() if letters != "M"]
    bounded = {call: address for call in later if (address := program.address(call)) is not None}
    assert set(later) - set(bounded) == INLINED
    stack = {call: max(analysis.bound(call, at, "call").stack.values()) for call, at in bounded.items()}
    stated = numbers("openswarm.h")
    assert {call: stated[call][1] for call in stack} == {call: depth + RETURN_ADDRESS for call, depth in stack.items()}


@pytest.mark.slow
@pytest.mark.parametrize("call", LINK)
def test_a_call_of_the_link_takes_no_longer_than_its_contract(image: Build, call: str) -> None:
    """A call of the infra-red link takes no longer than its contract.

    Most are checked by their bounds. Sends are measured on the emulator, because the bound assumes the longest copy.
    """
    path = image("infrared-calls", TARGET_APPS, "OPTIMISE=-Os -fno-lto")
    executable = read_executable(path.read_bytes(), str(path))
    program = Program(executable, LOAD)
    bound = BoundAnalysis(program).bound(call, program.address(call), "call")
    line = (HEADERS / "openswarm_infrared.h").read_text().partition(f" {call}(")[0].rpartition("| no | ")[2]
    cycles, stack = (int(word) for word in line.split(" | ")[:2])
    assert stack == max(bound.stack.values()) + RETURN_ADDRESS
    machine = emu.load(path)
    assert machine.run(until=call, seconds=1).reason == "until"
    start, top = machine.cycle, machine.w[15]
    back = machine.peek(top - 4) | machine.peek(top - 2) << 16
    assert machine.run(until=back, seconds=1).reason == "until"
    assert machine.cycle - start <= cycles
    if call == "Sys_Send_Neighbours":
        assert machine.cycle - start == cycles
    else:
        assert bound.cycles <= cycles <= 1.6 * bound.cycles


@pytest.mark.slow
def test_everything_in_an_image_of_ours_is_bounded(image: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """Every thread, context switch, interrupt, trap and stack of an image has a bound; the kernel stack stays below
    204 bytes."""
    path = str(image("hello"))
    lets = [word for name, value in LOAD.items() for word in ("--let", f"{name}={value}")]
    gates = ["--limit", "Sys_Send_IntEvent=868", "--limit", "_T1Interrupt=2187", "--limit", "_T3Interrupt=49"]
    assert main(["bounds", path, "--json", *lets, *gates]) == 0
    report = json.loads(capsys.readouterr().out)
    rows = [row for kind in ("calls", "threads", "interrupts", "nested") for row in report[kind]]
    assert {row["name"] for row in rows} >= {"greet", "_T1Interrupt", "_T2Interrupt", "_T3Interrupt", "_StackError"}
    assert all(row["forever"] or row["cycles"] is not None for row in rows)
    assert not any(row["open"] for row in rows)
    assert all(one["cycles"] is not None for one in report["responses"])
    assert report["stacks"]["kernel stack"] <= 204
    held = [row["masked"][level][0] for row in rows if row["level"] < 4 for level in "45" if level in row["masked"]]
    assert 0 < max(held) <= DEVICES_MASKED


@pytest.fixture(scope="module")
def crowded(image: Build) -> Path:
    """Return the image that puts the kernel's data structures into their worst shapes."""
    return image("crowded", TARGET_APPS)


@pytest.mark.slow
def test_a_longer_memory_has_longer_paths(crowded: Path) -> None:
    """The bound of heap_free grows with the tree depth; without a given depth it assumes 11 nodes, enough for over 4
    kB."""
    executable = read_executable(crowded.read_bytes(), str(crowded))
    cycles = []
    for holes in ({"h": 10}, {"h": 11}, {}):
        program = Program(executable, LOAD | holes)
        cycles.append(BoundAnalysis(program).bound("heap_free", program.address("heap_free"), "call").cycles)
    assert cycles[0] < cycles[1] == cycles[2]


@pytest.mark.slow
def test_bounds_are_close_where_structures_are_at_their_worst(crowded: Path) -> None:
    """No measured call exceeds its bound when the kernel's structures have their worst shapes.

    The image runs every scene of tests/firmware/target/crowded once, and checks its effects.
    """
    _, seconds, values = IMAGES["crowded"]
    rows = {row.call: row for row in rows_of("crowded", crowded, values, seconds / 2)}
    assert all(row.seen <= row.bound for row in rows.values() if row.bound is not None)
    for call in CLOSE:
        row = rows[call]
        assert row.plain_seen <= row.plain_bound <= 1.3 * row.plain_seen, call
    for call, (text, cycles) in MEASURED.items():
        row = rows[WITH_ROW.get(call, call)]
        assert numbers("openswarm.h")[call][0] == text
        assert row.plain_seen <= cycles(**values | row.plain_limits), call
    machine = emu.load(crowded)
    machine.run(seconds=seconds / 2)
    assert (machine.peek("scenes") >= SCENES, machine.peek("failures")) == (True, 0)
