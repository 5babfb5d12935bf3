"""Failures of the compile process, and limits of the objects on disk and in memory."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from emu.dspic30f.jit import compiler as compiler_module
from emu.dspic30f.jit.cache import ObjectCache
from emu.dspic30f.jit.compiler import MAX_DEATHS, Compiler, LoadedCode, pack_object, unpack_object
from emu.dspic30f.jit.engine import JitEngine
from emu.dspic30f.jit.worker import Backend
from emu.host.disk_cache import SHELVES
from emu.machine.machine import Machine
from tests.emu.jit.comparison.engine_pair import load
from tests.emu.jit.comparison.random_firmware import difference
from tests.emu.jit.comparison.straight_body import Shape
from tests.emu.jit.comparison.straight_firmware import straight_firmware
from tests.watchdog import HANG

IR = "define i64 @entry(ptr %rec, ptr %env) {{\n  ret i64 {}\n}}\n"


@pytest.fixture
def compiler(tmp_path: Path) -> Compiler:
    """Return a compiler with an empty cache."""
    return Compiler(ObjectCache(tmp_path))


def collect(compiler: Compiler, count: int) -> dict[object, LoadedCode]:
    """Collect compiled objects until there are `count`."""
    found: dict[object, LoadedCode] = {}
    end = time.monotonic() + HANG
    while len(found) < count and time.monotonic() < end:
        found.update(compiler.poll())
        time.sleep(0.01)
    return found


def ask(compiler: Compiler, count: int) -> None:
    """Request objects named 0 .. count - 1."""
    for number in range(count):
        compiler.request(IR.format(number), 0, compiler.key(0, b"%d" % number), (number,), number)


def test_a_process_that_is_killed_is_replaced(compiler: Compiler, capfd: pytest.CaptureFixture[str]) -> None:
    """If the compile process is killed, while it compiles or while it is idle, it is replaced, and all objects
    arrive."""
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


COPIED = """
import os, sys, time
from pathlib import Path
from emu.dspic30f.jit.cache import ObjectCache
from emu.dspic30f.jit.compiler import Compiler

IR = "define i64 @entry(ptr %rec, ptr %env) {{\\n  ret i64 {}\\n}}\\n"
compiler, found = Compiler(ObjectCache(Path(sys.argv[1]))), {}
for number in range(6):
    compiler.request(IR.format(number), 0, compiler.key(0, b"%d" % number), (number,), number)
process = compiler._process.pid
child = os.fork()
end = time.monotonic() + 3600
while len(found) < 6 and time.monotonic() < end:
    found.update(compiler.poll())
    time.sleep(0.01)
is_own = compiler._process.pid == process
if not child:
    compiler._process.kill()
    os._exit(0 if sorted(found) == list(range(6)) and not is_own else 1)
assert sorted(found) == list(range(6)) and is_own
assert os.waitpid(child, 0)[1] == 0
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system copies no processes")
def test_a_copy_of_the_process_has_a_compile_process_of_its_own(tmp_path: Path) -> None:
    """After a fork with requests in flight, both processes receive all objects, each from its own compile process."""
    words = [sys.executable, "-c", COPIED, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=HANG, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", ["/bin/false", "/no/such/program"])
def test_without_any_process_the_run_goes_on_interpreted_with_one_warning(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], command: str
) -> None:
    """If no compile process can run, the run continues in the interpreter with the state of the plain engine and one
    line on standard error."""
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
    end = time.monotonic() + HANG
    while compiler.busy and time.monotonic() < end:
        compiler.poll()
    ask(compiler, 20)
    compiler.poll()
    assert compiler.busy == 0
    assert compiler._deaths >= MAX_DEATHS
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 1, said
    assert "interpreted" in said[0]
    assert sys.executable == command


def test_a_piece_wanted_by_many_is_compiled_once_and_is_in_memory_as_long_as_one_holds_it(compiler: Compiler) -> None:
    """An object that several machines request is compiled and loaded once; it is unloaded when no machine uses it."""
    for tag in ("first", "second"):
        compiler.request(IR.format(1), 0, compiler.key(0, b"piece"), (4,), tag)
    found = collect(compiler, 2)
    assert found["first"] is found["second"]
    assert compiler.statistics.requested == compiler.statistics.compiled == compiler.statistics.loaded == 1
    assert compiler.lookup(compiler.key(0, b"piece")) is found["first"]

    def mappings() -> int:
        return len(Path("/proc/self/maps").read_text().splitlines())

    before = mappings()
    held = [compiler.compile_now(IR.format(number), 0, compiler.key(0, b"%d" % number)) for number in range(100)]
    assert mappings() >= before + 100
    assert [ctypes.CFUNCTYPE(ctypes.c_int64)(loaded.address)() for loaded in held] == list(range(100))
    held.clear()
    gc.collect()
    assert mappings() < before + 50


def test_the_code_of_a_machine_goes_with_it(compiler: Compiler) -> None:
    """The code of two machines is shared, and it is unloaded when both machines are deleted."""
    machines = []
    for _ in range(2):
        machines.append(Machine(engine="jit"))
        machines[-1].stop_on_fault = False
        runner = machines[-1].runner
        assert isinstance(runner, JitEngine)
        runner.compiler, runner.threshold, runner.wait = compiler, 1, True
        load(machines[-1], straight_firmware(3, Shape(instructions=100)))
        machines[-1].run(cycles=20_000)
        if len(machines) == 1:
            loaded = compiler.statistics.loaded
    assert compiler.statistics.loaded == loaded == len(compiler._loaded)
    machines[0].run(cycles=20_000)
    machines[1].run(cycles=20_000)
    assert not difference(*machines)
    machines.clear()
    del runner
    gc.collect()
    assert not compiler._loaded


def test_code_arrives_while_no_address_is_missed(compiler: Compiler) -> None:
    """Compiled code becomes available during a run that reaches no uncompiled address."""
    machine = Machine(engine="jit")
    runner = machine.runner
    assert isinstance(runner, JitEngine)
    runner.compiler, runner.threshold = compiler, 1
    load(machine, straight_firmware(3, Shape(instructions=100)))
    machine.stop_on_fault = False
    machine.run(cycles=2000)
    assert compiler.busy
    missed, end = runner._miss, time.monotonic() + HANG
    runner._miss = lambda limit: runner._run_cold(limit)  # type: ignore[method-assign]
    while compiler.busy and time.monotonic() < end:
        machine.run(cycles=100)
        time.sleep(0.02)  # leave the processor to the compile process
    assert not compiler.busy
    runner._miss = missed  # type: ignore[method-assign]


FRAGMENTED = """
import ctypes, mmap
from pathlib import Path
from emu.native_library import DOUBLE, INT, functions

c = ctypes.CDLL(None)
c.mmap.restype = ctypes.c_void_p
c.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
c.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]

def reserve(size):
    return c.mmap(None, size, 0, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | 0x4000, -1, 0)

source = Path({source!r})
functions(source, {{"scaled": (DOUBLE, [DOUBLE, INT])}})  # all libraries are there now
pages = [reserve(4096) for _ in range(20_000)]
wall = reserve(5 << 30)
for size in (1 << 20, 1 << 16, 1 << 14, 1 << 13, 1 << 12):
    while reserve(size) > wall:
        pass
c.munmap(pages[15_000], 4096)  # one hole, 5 GB away from all other room
scaled = functions(source, {{"scaled": (DOUBLE, [DOUBLE, INT])}})["scaled"]
print([scaled(2.0, number) for number in range(4)])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="builds its address space with Linux's mmap")
def test_a_fragmented_process_can_load_native_code(tmp_path: Path) -> None:
    """Native code can be loaded into a process with a fragmented address space, because the linker places code and
    constants together."""
    source = tmp_path / "scaled.c"
    source.write_text("""
static const double factors[] = {1.5, 2.5, 3.5, 4.5};
static int calls;
double scaled(double value, long which) { calls++; return value * factors[which & 3] + 0.25 * (calls > 0); }
""")
    run = [sys.executable, "-c", FRAGMENTED.format(source=str(source))]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "[3.25, 5.25, 7.25, 9.25]\n"), done.stderr


def test_objects_are_compressed() -> None:
    """A packed object has at most half the size of its code, and unpacks to the same code and entries."""
    code = Backend().compile(IR.format(1), 0)
    packed = pack_object([0x100, 0x8000], code)
    assert len(packed) < len(code) / 2
    assert unpack_object(packed) == ([0x100, 0x8000], code)


@pytest.mark.parametrize("stored", [b"", b"\x01\0\0\0", b"\0\0\0\0\x7fELF"])
def test_an_object_of_another_form_is_compiled_again(stored: bytes, compiler: Compiler) -> None:
    """An object in an unknown format is compiled again: another version of the sources may have stored it."""
    compiler.cache.put("a", stored)
    assert compiler.lookup("a") is None
    assert compiler.compile_now(IR.format(1), 0, "a").address


def test_the_folder_keeps_what_was_used_last(tmp_path: Path) -> None:
    """A shelf of the cache with room for ten objects of about 1,000 bytes keeps the objects that were used last."""
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
    """An object larger than a shelf is stored and evicts all others."""
    cache = ObjectCache(tmp_path, limit=10)
    for key in ("00a", "00b"):
        cache.put(key, bytes(5_000))
    assert cache.get("00a") is None
    assert cache.get("00b") == bytes(5_000)
