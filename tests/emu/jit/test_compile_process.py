"""A compile process that dies costs speed and nothing else; the folder of objects stays within its bound."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import pytest
from random_firmware import difference
from straight_body import Shape
from straight_firmware import straight_firmware
from twins import load

from emu.dspic30f.jit import compiler as compiler_module
from emu.dspic30f.jit.cache import SHELVES, ObjectCache
from emu.dspic30f.jit.compiler import PATIENCE, Compiler
from emu.machine import Machine

IR = "define i64 @entry(ptr %rec, ptr %env) {{\n  ret i64 {}\n}}\n"


@pytest.fixture
def compiler(tmp_path: Path) -> Compiler:
    """One with a cache of its own."""
    return Compiler(ObjectCache(tmp_path))


def collect(compiler: Compiler, count: int) -> dict[object, int]:
    """What arrives within ten seconds, until there are `count`."""
    found: dict[object, int] = {}
    end = time.monotonic() + 30
    while len(found) < count and time.monotonic() < end:
        found.update(compiler.poll())
        time.sleep(0.01)
    return found


def ask(compiler: Compiler, count: int) -> None:
    """Request pieces named 0 .. count - 1."""
    for number in range(count):
        compiler.request(IR.format(number), 0, compiler.key(0, b"%d" % number), (number,), number)


def test_a_process_that_is_killed_is_replaced(compiler: Compiler, capfd: pytest.CaptureFixture[str]) -> None:
    """With a piece in it, and idle; every piece arrives."""
    ask(compiler, 6)
    assert compiler._process is not None
    os.kill(compiler._process.pid, signal.SIGKILL)
    assert set(collect(compiler, 6)) == set(range(6))
    os.kill(compiler._process.pid, signal.SIGKILL)
    compiler._process.wait()
    ask(compiler, 3)
    assert set(collect(compiler, 3)) == set(range(3))
    assert compiler.busy == 0
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("command", ["/bin/false", "/no/such/program"])
def test_without_any_process_the_run_goes_on_interpreted_with_one_warning(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], command: str
) -> None:
    """Same state as the plain interpreter, one line on standard error."""
    monkeypatch.setattr(compiler_module.sys, "executable", command)
    firmware = straight_firmware(3, Shape(instructions=100))
    machines = [Machine(engine=engine) for engine in ("plain", "jit")]
    machines[1].runner.compiler, machines[1].runner.threshold = compiler, 1
    for machine in machines:
        machine.stop_on_fault = False
        load(machine, firmware)
    for _ in range(40):
        assert machines[0].run(cycles=500) == machines[1].run(cycles=500)
        assert not difference(*machines)
    end = time.monotonic() + 30
    while compiler.busy and time.monotonic() < end:
        compiler.poll()
    ask(compiler, 20)
    compiler.poll()
    assert compiler.busy == 0
    assert compiler._deaths >= PATIENCE
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 1, said
    assert "interpreted" in said[0]
    assert sys.executable == command


def test_the_folder_keeps_what_was_used_last(tmp_path: Path) -> None:
    """One shelf with room for ten objects of some 1,000 bytes."""
    cache = ObjectCache(tmp_path, limit=10_000 * SHELVES)
    keys = [f"00{number:062x}" for number in range(40)]
    for number, key in enumerate(keys):
        cache.put(key, b"%4d" % number + bytes(960))
        os.utime(tmp_path / "00" / key, ns=(number, number))
        if number == 5:
            continue
        if number > 5:
            assert cache.get(keys[5]) is not None, "used all the time"
    assert cache.get(keys[39]) is not None
    assert cache.get(keys[0]) is None
    assert sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file()) <= 10_000


def test_an_object_larger_than_a_shelf_is_kept_alone(tmp_path: Path) -> None:
    """It was wanted just now."""
    cache = ObjectCache(tmp_path, limit=10)
    for key in ("00a", "00b"):
        cache.put(key, bytes(5_000))
    assert cache.get("00a") is None
    assert cache.get("00b") == bytes(5_000)
