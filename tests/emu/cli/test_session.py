"""Sessions: dividing a run has no effect, timestamped input reproduces a run, and the Python examples run."""

from __future__ import annotations

import doctest
import subprocess
import sys
from pathlib import Path

import pytest

import emu
import emu.api
from emu.dspic30f.jit.engine import WARM_UP
from emu.image.loader import parse_image
from emu.run import session as sessions
from emu.run.input_log import TimestampedInput
from emu.run.session import Session
from emu.run.uart_backends import ConsolePort
from tests.emu.cli.programs import ECHO, SPIN, executable

ROOT = Path(__file__).resolve().parents[3]


def machine_with(source, vectors=None, engine="plain"):
    machine = emu.Machine(engine=engine)
    machine.load(parse_image(executable(source, vectors), "program.elf"))
    return machine


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["plain", "jit"])
@pytest.mark.parametrize("length", [1, 7, 1280, 1_000_000])
def test_slices_do_not_affect_the_run(monkeypatch, length, engine):
    """The same input at the same cycles gives the same final state for any division of the run."""
    stamps = [TimestampedInput(100, 1, b"hello"), TimestampedInput(9_000, 1, b"x"), TimestampedInput(40_000, 1, b"yz")]

    def ended(slice_cycles, name):
        monkeypatch.setattr(sessions, "FIRST_SLICE", slice_cycles)
        monkeypatch.setattr(sessions, "_adapted", lambda cycles, seconds: cycles)
        machine = machine_with(ECHO, {"U1RXInterrupt": "receive"}, name)
        port = ConsolePort(None, None)
        port.capture = bytearray()
        stop, _ = Session(machine, {1: port}, limit=200_000, replay=list(stamps)).run()
        return stop, bytes(port.capture), machine.snapshot()

    stop, said, state = ended(length, engine)
    assert said == b"ifmmpyz{"
    assert (stop, said, state) == ended(333, "plain")


def test_the_first_slice_ends_before_the_translator_is_imported():
    """The output of the first slice does not wait for the import of the translator."""
    assert sessions.FIRST_SLICE <= WARM_UP


def test_a_paced_run_takes_as_long_as_the_robot(monkeypatch):
    """A paced run sleeps for the time by which simulated time is ahead of the host's clock, which the test replaces."""
    now = [0.0]
    waited = []

    def wait(ports, seconds):
        waited.append(seconds)
        now[0] += max(seconds, 0.0)
        return False

    monkeypatch.setattr(sessions, "wait_for_input", wait)
    monkeypatch.setattr(sessions.time, "perf_counter", lambda: now[0])
    stop, host_seconds = Session(machine_with(SPIN), {}, limit=147_456, realtime=True).run()
    assert stop.reason == "limit"
    assert host_seconds == pytest.approx(0.01, rel=0.01)
    assert sum(waited) == pytest.approx(0.01, rel=0.01)


def test_a_watched_variable_reports_every_change_with_its_cycle():
    machine = machine_with(SPIN)
    changes = list(emu.watch(machine, "counter", cycles=20))
    assert [(change.old, change.new) for change in changes] == [(0, 1), (1, 2), (2, 3), (3, 4)]
    assert [change.cycle for change in changes] == [5, 9, 13, 17]
    assert {change.pc for change in changes} == {0x106}


def test_memory_is_read_and_written_by_name():
    """Memory is accessible by name: registers by data-sheet name, W registers, variables by C name or object name."""
    machine = machine_with(SPIN)
    machine.poke("counter", 0x1234)
    assert machine.peek("_counter") == machine.peek(0x800) == 0x1234
    machine.poke("W5", 7)
    assert machine.w[5] == machine.peek("WREG5") == 7
    machine.write("TRISB", 0x00FF)
    assert machine.read("TRISB") == 0x00FF
    with pytest.raises(KeyError, match="no register or variable 'nothing'"):
        machine.peek("nothing")


def test_hooks_are_called_on_pc_register_and_byte():
    machine = machine_with(ECHO, {"U1RXInterrupt": "receive"})
    seen = []
    machine.hook_pc(machine.image.symbols.find("receive").address, lambda: seen.append(("pc", machine.cycle)))
    machine.hook_sfr("U1BRG", lambda is_write, word: seen.append(("sfr", is_write, word)))
    machine.uart[1].on_byte = lambda byte, cycle: seen.append(("byte", byte))
    machine.uart[1].feed(b"A")
    assert machine.run().reason == "halt"
    assert [entry[0] for entry in seen] == ["sfr", "pc", "byte"]
    assert ("sfr", True, 7) in seen
    assert ("byte", ord("B")) in seen


def test_the_documented_example_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    result = doctest.testmod(emu.api)
    assert result.attempted >= 10
    assert result.failed == 0


def test_modules_are_imported_lazily():
    """engines.md §2: tools that need only the instruction table or chip data import no other modules."""
    code = (
        "import sys, emu.chips.dspic30f6014a, emu.image.elf_facts\n"
        "print({'emu.machine.machine', 'numpy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_a_run_without_instruments_imports_no_numpy():
    """The import would take half of the CPU time from the start of `emu run` to the first byte."""
    code = (
        "import sys, emu\n"
        "machine = emu.load('tests/emu/cli/hello.hex')\n"
        "print(machine.run().reason, 'numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["halt", "False"]
