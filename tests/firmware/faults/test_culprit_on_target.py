"""A fault in an OpenSwarm thread is reported with the source line and the thread that caused it, not with a kernel
line."""

from __future__ import annotations

import pytest

import emu
from emu.debug.inspector import Inspector
from emu.debug.threads import Threads
from tests.firmware.conftest import TARGET_APPS, Build


def after(image: Build, mistake: int, **options: bool) -> emu.Stop:
    machine = emu.load(image("culprit", TARGET_APPS), **options)
    assert machine.run(seconds=0.01).reason == "limit"
    machine.poke("mistake", mistake)
    return machine.run(seconds=0.2)


@pytest.mark.parametrize("strict", [False, True])
def test_a_bad_store_is_told_at_the_store_with_its_thread(image: Build, strict: bool) -> None:
    stop = after(image, 1, strict=strict)
    fault = stop.fault
    assert stop.reason == "fault"
    assert fault is not None
    assert fault.cause.startswith("address error trap: writing 2 bytes at 0x3001, an odd address")
    assert fault.thread == "thread 2 (worker)"
    assert [frame.function for frame in fault.frames] == ["store", "worker", "os_thread_start"]
    assert fault.line is not None
    assert fault.line.endswith("main.c:8")
    assert len(fault.branches) == 20


def test_a_failed_assertion_is_told_at_its_caller(image: Build) -> None:
    fault = after(image, 3).fault
    assert fault is not None
    assert (fault.function, fault.thread) == ("worker", "thread 2 (worker)")


def test_a_store_into_another_threads_stack_is_a_fault_if_strict(image: Build) -> None:
    assert after(image, 2).reason == "limit"
    fault = after(image, 2, strict=True).fault
    assert fault is not None
    assert "into the stack of another thread" in fault.cause
    assert (fault.function, fault.thread) == ("store", "thread 2 (worker)")


def test_threads_are_listed_with_stacks_and_what_they_wait_for(image: Build) -> None:
    machine = emu.load(image("culprit", TARGET_APPS))
    machine.run(seconds=0.0234)
    threads = {thread.pid: thread for thread in Threads(Inspector(machine)).all()}
    assert {pid: thread.name for pid, thread in threads.items()} == {0: "main", 1: "steady", 2: "worker"}
    for pid in (1, 2):
        thread = threads[pid]
        assert thread.state == "sleeping"
        assert [frame.function for frame in thread.frames][-2:] == [thread.name, "os_thread_start"]
        assert thread.stack is not None
        assert thread.used is not None
        assert 20 <= thread.used <= thread.stack[1] - thread.stack[0] <= 128
    before = machine.snapshot()
    Threads(Inspector(machine)).all()
    assert machine.snapshot() == before
