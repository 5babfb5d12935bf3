"""The fixture `robot` is an `emu.Machine`: the same names, units and behaviours; failures begin with the assertion."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import emu
from emu.peripherals.uart.expect import ExpectError
from openswarm.testing.robot import FirmwareFault, Robot

PROGRAM = """
#include <p30F6014A.h>
volatile unsigned count, limit = 3;
static int twice(int n) { return 2 * n; }
__attribute__((noinline)) int thrice(int n) { return 3 * n; }
static void say(const char *text) { while (*text) { while (U1STAbits.UTXBF) {} U1TXREG = *text++; } }
int main(void) {
    U1BRG = 7; U1MODE = 0x8000; U1STA = 0x400;
    say("ready\\n");
    for (;;) {
        count = thrice(count) + twice(limit);
        if (U1STAbits.URXDA) {
            char c = U1RXREG;
            say(c == 'x' ? "crash\\n" : "ok\\n");
            if (c == 'x') { *(volatile int *)0x3001 = 1; }
        }
    }
}
"""


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("robot")
    (folder / "main.c").write_text(PROGRAM)
    return emu.build(folder / "main.c", output=folder / "main.elf")


@pytest.fixture
def robot(image) -> Robot:
    return Robot(image)


def test_every_public_name_of_the_machine_is_the_robot_s(robot):
    names = [name for name in dir(emu.Machine) if not name.startswith("_")]
    assert [name for name in names if not hasattr(robot, name) or name not in dir(robot)] == []
    for name in ("run", "step"):
        mine = inspect.signature(getattr(robot, name)).parameters
        assert (
            list(inspect.signature(getattr(robot.machine, name)).parameters)
            == list(mine)[: len(mine) - (name == "run")]
        )


def test_state_calls_hooks_and_variables(robot):
    robot.uart[1].expect("ready\n", within=5)
    state = robot.snapshot()
    cycle = robot.cycle
    robot.set_var("count", 7)
    assert (robot.var("count"), robot.call("thrice", 5)) == (7, 15)
    seen = []
    remove = robot.hook_pc("thrice", lambda: seen.append(robot.cycle))
    robot.run(cycles=1000)
    remove()
    assert len(seen) > 10
    robot.restore(state)
    assert robot.cycle == cycle
    assert robot.threads() == []
    robot.pc = robot.program_address("main")
    assert robot.machine.pc == robot.program_address("main")


def test_times_have_the_same_units_under_old_and_new_names(robot):
    start = robot.cycle
    robot.run(ms=2)
    assert robot.cycle - start == pytest.approx(robot.cycles_in(0.002), abs=5)
    with pytest.raises(ValueError, match="give seconds or ms, not both"):
        robot.run(ms=1, seconds=1)
    robot.uart.expect("ready", within_ms=5)
    for name in ("within", "within_ms"):
        start = robot.cycle
        with pytest.raises(ExpectError, match="within 3 ms"):
            robot.uart[1].expect("never", **{name: 3})
        assert robot.cycle - start == pytest.approx(robot.cycles_in(0.003), abs=5)
    with pytest.raises(TypeError, match="within=MILLISECONDS"):
        robot.uart.expect("never")


def test_a_fault_fails_the_call_in_which_it_occurs(robot):
    robot.uart[1].feed("y")
    robot.uart.expect("ok", within=5)
    robot.uart[1].feed(b"x")
    with pytest.raises(FirmwareFault, match="address error trap"):
        robot.run(seconds=0.01)


def test_an_inlined_function_is_explained(robot):
    for work in (
        lambda: robot.call("twice", 1),
        lambda: robot.hook_pc("twice", print),
        lambda: robot.run(until="twice"),
    ):
        with pytest.raises(KeyError, match=r"no function or label 'twice': inlined into main; add __attribute__"):
            work()
    with pytest.raises(KeyError, match=r"no function or label 'nothing'\"$"):
        robot.call("nothing")
    with robot.measured() as measured:
        robot.run(ms=1)
    assert measured.cycles("thrice").calls > 10
    with pytest.raises(KeyError, match="inlined into main"):
        measured.cycles("twice")


def test_text_that_is_no_latin_1_is_refused(robot):
    with pytest.raises(ValueError, match="latin-1"):
        robot.uart[1].feed("\u20ac")


def test_reports_begin_with_the_assertion(image, tmp_path):
    test = f"""
import pytest
pytestmark = pytest.mark.firmware({str(image)!r})
def test_it(robot):
    robot.run(ms=1)
    wanted = 3
    assert robot.var("limit") - 3 == wanted
"""
    (tmp_path / "test_it.py").write_text(test)
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", "--junitxml", "out.xml", "-o",
             "junit_family=xunit1"]  # fmt: skip
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout
    report = (tmp_path / "robot-artefacts" / "test_it.py_test_it" / "report.txt").read_text()
    assert report.startswith("assert (3 - 3) == 3")
    assert report.index("test_it.py:7") < report.index("the test failed;")
    done = subprocess.run(
        [sys.executable, "-m", "openswarm.testing.summary", "out.xml"], cwd=tmp_path, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert "```\nassert (3 - 3) == 3" in done.stdout
    assert "Reports and waveform: `" in done.stdout
