"""Cycles and bytes in the headers of the kernel's options and in their README, compared with `emu` and `toolchain`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from emu.cli import main as emu
from tests.firmware.conftest import FIRMWARE, Build
from tests.firmware.contracts import CALL, callers
from toolchain.bounds.annotations.file import read_annotation_file
from toolchain.bounds.program import Program
from toolchain.bounds.report import BoundAnalysis
from toolchain.elf.read import read_executable

INCLUDE = FIRMWARE / "openswarm" / "include"
CONTRACT = re.compile(r"/\* [MTHI]+(?:, [\w ]+)? \| [^|]* \| (?P<cycles>[^|]*) \| (?P<stack>\d+)")

CALLS = {
    "mutex": ("Sys_Lock_Mutex", "Sys_Unlock_Mutex"),
    "join": ("Sys_Start_Joinable", "Sys_Join"),
    "cleanup": ("Sys_Push_Cleanup", "Sys_Pop_Cleanup"),
    "quota": ("Sys_Limit_Event",),
    "service": ("Sys_Start_Service", "Sys_Feed_Watchdog"),
    "semaphore": ("Sys_Signal_Semaphore", "Sys_Wait_for_Semaphore"),
    "notification": ("Sys_Notify", "Sys_Wait_for_Notification"),
    "timer": ("Sys_Start_Timer", "Sys_Stop_Timer"),
    "reset": ("Sys_Get_ResetCause", "Sys_Start_HardwareWatchdog"),
}
"""Calls of each option."""

RETURN_ADDRESS = 4
VARIANTS = {
    "Sys_Lock_MutexTimeout": "Sys_Lock_Mutex",
    "Sys_JoinTimeout": "Sys_Join",
    "Sys_Wait_for_SemaphoreTimeout": "Sys_Wait_for_Semaphore",
    "Sys_Notify_Value": "Sys_Notify",
    "Sys_Keep_Latest": "Sys_Limit_Event",
}
"""Calls of options with the call that they are "the same" as, whose row is theirs too."""
OTHERS = {"compat", "config", "infrared", "interrupt", "io", "remote", "scheduler"}
"""Headers other than openswarm.h that belong to no option of the kernel."""


def declared(header: str) -> set[str]:
    """Return the names of the calls that a public header declares."""
    return set(CALL.findall((INCLUDE / header).read_text()))


def test_every_call_of_the_kernel_is_in_the_footprint() -> None:
    """The application `footprint` names every call of openswarm.h, and each has a contract line."""
    text = (FIRMWARE / "apps" / "footprint" / "main.c").read_text()
    calls = declared("openswarm.h")
    assert {call for call in calls if not re.search(rf"\b{call}\(", text)} == set()
    assert calls - set(callers("openswarm.h")) == {"Sys_Assertion_Failed"}


def test_every_call_of_an_option_has_a_row() -> None:
    """Each call of an option's header has a contract line, a cycle row and a size row of its file."""
    options = {file.stem.partition("_")[2] for file in INCLUDE.glob("openswarm_*.h")} - OTHERS
    assert options == set(CALLS)
    cycles, sizes = (
        json.loads((FIRMWARE / "baseline" / f"options-{kind}.json").read_text()) for kind in ("cycles", "footprint")
    )
    rows = {re.split(r"[ ,]", row)[0] for row in cycles["rows"]}
    for option in options:
        calls = declared(f"openswarm_{option}.h")
        assert calls == set(callers(f"openswarm_{option}.h")), option
        assert {VARIANTS.get(call, call) for call in calls} <= rows, option
        assert f"{option}: ROM" in sizes["rows"]


@pytest.fixture(scope="module")
def path(image: Build) -> Path:
    return image("options")


@pytest.fixture
def cycles(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, int]:
    assert emu(["cycles", "--suite", str(path), "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def contract(option: str, call: str) -> tuple[list[int], int]:
    """Return the numbers of the cycles field and the stack bytes of a contract line."""
    text = (INCLUDE / f"openswarm_{option}.h").read_text()
    declared = re.search(rf"^\w[\w *]*\b{call}\(", text, re.M)
    assert declared, f"{call} is not declared"
    found = CONTRACT.match(text, text.rindex("/* ", 0, declared.start()))
    assert found, f"{call} has no contract line"
    return [int(number) for number in re.findall(r"\d+", found["cycles"])], int(found["stack"])


def sentence(option: str, begin: str) -> list[int]:
    """Return the numbers in the sentence that begins with the given text."""
    text = re.sub(r"\s+\*?\s*", " ", (INCLUDE / f"openswarm_{option}.h").read_text())
    found = re.search(re.escape(begin) + r"([^.]*)\.", text)
    assert found, begin
    return [int(number) for number in re.findall(r"\d+", re.sub(r"\([^)]*\)|\d+ (?:bytes|ms)", "", found[1]))]


@pytest.mark.slow
def test_the_cycles_in_the_headers_are_the_measured_ones(cycles: dict[str, int]) -> None:
    lock, unlock = cycles["Sys_Lock_Mutex"], cycles["Sys_Unlock_Mutex"]
    start = cycles["Sys_Start_ProcessWith, for comparison"]
    waited = cycles["Sys_Unlock_Mutex, one thread waits"]
    assert contract("mutex", "Sys_Lock_Mutex")[0] == [
        lock,
        cycles["Sys_Lock_Mutex, another thread owns another"] - lock,
        cycles["Sys_Lock_Mutex of another thread's, to the next thread"],
    ]
    assert contract("mutex", "Sys_Unlock_Mutex")[0] == [
        unlock,
        cycles["Sys_Unlock_Mutex, another thread owns another"] - unlock,
        cycles["Sys_Unlock_Mutex, fixed priorities"],
        waited,
        cycles["Sys_Unlock_Mutex, two threads wait"] - waited,
        cycles["Sys_Unlock_Mutex, one waits, another owns another"] - waited,
        cycles["Sys_Unlock_Mutex, a better thread waits, to that"],
        cycles["Sys_Unlock_Mutex, a better thread locks, unlocks, sleeps"],
    ]
    assert contract("join", "Sys_Start_Joinable")[0] == [cycles["Sys_Start_Joinable"] - start]
    assert contract("join", "Sys_Join")[0] == [
        cycles["Sys_Join of a zombie"],
        cycles["Sys_Join of a living thread, to the next thread"],
    ]
    pop = cycles["Sys_Pop_Cleanup"]
    behind_two = cycles["Sys_Pop_Cleanup, two of others are newer"] - pop
    assert contract("cleanup", "Sys_Push_Cleanup")[0] == [
        cycles["Sys_Push_Cleanup"],
        cycles["Sys_Push_Cleanup, two of others are there"],
    ]
    assert contract("cleanup", "Sys_Pop_Cleanup")[0] == [
        pop,
        behind_two // 2,
        cycles["Sys_Pop_Cleanup, an empty function is run"] - pop,
    ]
    assert contract("quota", "Sys_Limit_Event")[0] == [cycles["Sys_Limit_Event"]]
    send, limited = cycles["send 2 bytes, for comparison"], cycles["send 2 bytes, limited"]
    assert sentence("quota", "Sending the event then takes") == [
        limited - send,
        cycles["send 2 bytes, limited, dropped"] - send,
        cycles["send 2 bytes, the latest is replaced"] - send,
        (cycles["send 2 bytes, limited, four wait"] - limited) // 4,
        cycles["send 2 bytes, limited, a newer quota"] - limited,
    ]
    neighbour = cycles["send 2 bytes, another event of the bucket is limited"] - send
    assert sentence("quota", "Other events of the same bucket") == [neighbour]
    assert cycles["send 2 bytes, an event elsewhere is limited"] == send
    feed = cycles["Sys_Feed_Watchdog"]
    assert contract("service", "Sys_Start_Service")[0] == [cycles["Sys_Start_Service"] - start]
    behind_two = cycles["Sys_Feed_Watchdog, two services are newer"] - feed
    assert contract("service", "Sys_Feed_Watchdog")[0] == [feed, behind_two // 2]
    looking = cycles["1 ms clock, idle, one service"] - cycles["1 ms clock, idle, for comparison"]
    assert sentence("service", "which takes") == [looking]


@pytest.mark.slow
def test_the_cycles_of_waits_and_timers_are_the_measured_ones(cycles: dict[str, int]) -> None:
    for option, post, wait, nothing in (
        ("semaphore", "Sys_Signal_Semaphore", "Sys_Wait_for_Semaphore", "unit"),
        ("notification", "Sys_Notify", "Sys_Wait_for_Notification", "bit"),
    ):
        better = cycles[f"{post}, a better thread waits, to that"]
        assert contract(option, post)[0] == [cycles[post], better]
        assert contract(option, wait)[0] == [cycles[wait], cycles[f"{wait} without {nothing}, to the next thread"]]
    stop = cycles["Sys_Stop_Timer"]
    assert contract("timer", "Sys_Start_Timer")[0] == [
        cycles["Sys_Start_Timer"],
        cycles["Sys_Start_Timer, two others run"],
    ]
    behind_two = cycles["Sys_Stop_Timer, two others are newer"] - stop
    assert contract("timer", "Sys_Stop_Timer")[0] == [stop, behind_two // 2]
    due = cycles["1 ms clock, idle, a timer sends without listeners"] - cycles["1 ms clock, idle, for comparison"]
    assert sentence("timer", "sending takes") == [due]
    for call in CALLS["reset"]:
        assert contract("reset", call)[0] == [cycles[call]]


@pytest.mark.slow
def test_the_stack_in_the_headers_is_the_worst_case(path: Path) -> None:
    """Stack bytes in the headers equal the bounds without the frame of a switch (openswarm.h).

    `Sys_Pop_Cleanup` also runs a function of the application; its bound here is that with this application's. Threads
    and interrupts of the application need no bound.
    """
    annotations = read_annotation_file("depth _hal_block 0", "this test")
    program = Program(read_executable(path.read_bytes(), str(path)), file=annotations)
    analysis, stack = BoundAnalysis(program), {}
    for call in (call for calls in CALLS.values() for call in calls):
        bound = analysis.bound(call, program.address(call), "call")
        assert bound.stack_is_known, call
        stack[call] = bound.bytes + RETURN_ADDRESS
    stated = {call: contract(option, call)[1] for option, calls in CALLS.items() for call in calls}
    assert stack.pop("Sys_Pop_Cleanup") >= stated.pop("Sys_Pop_Cleanup")
    assert stack == stated


@pytest.mark.slow
def test_the_readme_has_the_measured_bytes(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert emu(["footprint", str(path), "--json"]) == 0
    sizes = json.loads(capsys.readouterr().out)["options"]
    rows = re.findall(
        r"^\| `(\w+)\.c` \|[^|]*\|[^|]*\| (\d+) \| (\d+) \| ?([^|]*)\|$",
        (FIRMWARE / "openswarm" / "option" / "README.md").read_text(),
        re.M,
    )
    assert {name for name, *_ in rows} == {name.partition(":")[0] for name in sizes if name.endswith(": ROM")}
    objects = {
        "mutex": [sizes["sys_mutex: RAM of one"]],
        "quota": [sizes["sys_quota: RAM of one"], sizes["a quota: heap"]],
        "join": [sizes["a zombie: heap"]],
        "cleanup": [sizes["sys_cleanup: RAM of one"]],
        "service": [sizes["sys_service: RAM of one"]],
        "semaphore": [sizes["sys_semaphore: RAM of one"]],
        "notification": [sizes["sys_notification: RAM of one"]],
        "timer": [sizes["sys_timer: RAM of one"]],
        "reset": [],
        "watchdog": [],
        "woken_first": [],
    }
    for name, rom, ram, each in rows:
        assert (int(rom), int(ram)) == (sizes[f"{name}: ROM"], sizes[f"{name}: RAM"]), name
        assert [int(number) for number in re.findall(r"\d+", each)] == objects[name], name
