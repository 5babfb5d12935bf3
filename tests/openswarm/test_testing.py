"""The pytest plugin: its fixtures, the artefacts of a failure, the installation from the wheel, and the CI action."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
import yaml

from emu.host import paths
from openswarm.testing.plugin import ROBOTS, pytest_runtest_makereport
from tests.openswarm.conftest import shortened
from tests.vcd_reader import VCDVCD

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "tools"))
import first_steps  # noqa: E402

FAULTY = """
#include <p30F6014A.h>
static __attribute__((noinline)) void store(unsigned where) { *(volatile int *)where = 1; }
static void say(const char *text) { while (*text) { while (U1STAbits.UTXBF) {} U1TXREG = *text++; } }
int main(void) {
    U1BRG = 7; U1MODE = 0x8000; U1STA = 0x400;
    say("ready\\r\\n");
    while (!U1STAbits.URXDA) {}
    say("got it\\r\\n");
    while (!U1STAbits.TRMT) {}
    store(0x3001);
    for (;;) {}
}
"""
TESTS = """
import pytest
pytestmark = pytest.mark.firmware("main.c", flags=["-Os", "-g"])

def test_it_is_ready(robot):
    robot.uart.expect("ready", within_ms=50)
    assert robot.uart.said.startswith(b"ready")

@pytest.mark.robot(selector=3)
def test_the_selector_is_as_marked(robot):
    assert robot.board.selector.position == 3

def test_it_survives_an_answer(robot):
    robot.uart.expect("ready", within_ms=50)
    robot.uart.feed(b"x")
    robot.uart.expect("alive", within_ms=50)

def test_nothing_is_expected_twice(robot):
    robot.uart.expect("ready", within_ms=50)
    robot.uart.expect("ready", within_ms=50)

def test_cycles_and_lines(robot):
    with robot.measured() as measured:
        robot.run(ms=5)
    assert 0.3 < measured.coverage("main.c") < 1
    assert measured.profile.cycles == robot.cycle
    with pytest.raises(ValueError, match="was not called"):
        measured.cycles("store")
"""


@pytest.fixture
def tests(tmp_path: Path) -> Path:
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "main.c").write_text(FAULTY)
    (folder / "test_it.py").write_text(TESTS)
    return folder


def run_pytest(folder: Path, *words: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", *words],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("how", [(), ("-n", "2", "--dist", "load")], ids=["one process", "xdist"])
def test_a_failure_says_where_and_leaves_a_waveform(tests, how):
    said = run_pytest(tests, "--junitxml", "out.xml", "-o", "junit_family=xunit1", *how)
    assert "2 failed, 3 passed" in said
    assert "FirmwareFault: UART1 did not send b'alive' within 50 ms; it sent" in said
    assert re.search(r"address error trap: writing 2 bytes at 0x3001.*\(store\+0x\w+, .*main\.c:3\)", said)
    assert "did not send b'ready' within 50 ms; it sent '\\r\\n'" in said
    assert "the test failed; at" in said
    assert "wait.py:" not in said  # a traceback ends at the line of the test
    assert re.search(r"within 50 ms; it sent.*\n  at test_it\.py:\d+\n", said)
    folder = tests / "robot-artefacts" / "test_it.py_test_it_survives_an_answer"
    assert f"waveform: {folder / 'waves.vcd'}" in said
    assert "last branches" in (folder / "report.txt").read_text()
    assert (folder / "uart1.txt").read_bytes() == b"ready\r\ngot it\r\n"
    waves = VCDVCD(str(folder / "waves.vcd"))
    sent = [int(value, 2) for _, value in waves["uart1.tx"].tv]
    assert bytes(sent[1:]) == b"\r\ngot it\r\n"  # sent since the last input
    cases = {case.get("name"): case for case in ElementTree.parse(tests / "out.xml").getroot().iter("testcase")}
    properties = {one.get("name"): one.get("value") for one in cases["test_it_survives_an_answer"].iter("property")}
    assert properties["robot_artefacts"] == str(folder)
    assert int(properties["robot_cycles"]) > 1_000
    assert sorted(path.name for path in (tests / "robot-artefacts").iterdir()) == [
        "test_it.py_test_it_survives_an_answer",
        "test_it.py_test_nothing_is_expected_twice",
    ]


def test_without_firmware_it_says_what_to_write(tests):
    (tests / "test_it.py").write_text("def test_it(robot): pass\n")
    assert "no firmware: mark the test @pytest.mark.firmware(...) or set `firmware` in pytest.ini" in run_pytest(tests)


@pytest.mark.slow
def test_a_compiler_s_message_reaches_the_report(tests):
    (tests / "main.c").write_text("int main(void) { return nothing; }\n")
    assert re.search(r"main\.c:1:25: error: use of undeclared identifier", run_pytest(tests))


@pytest.mark.skipif(shutil.which("git") is None or not (ROOT / ".git").exists(), reason="not a clone, or no git")
@pytest.mark.slow
def test_the_action_s_steps_as_they_are_from_the_wheel(wheel, baselines, tmp_path):
    """The steps of the CI action work in an environment that contains only the wheel.

    A new project passes. With a mistake in its C source, the summary names thread and line, and there is a waveform.
    """
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    environment = first_steps.install_wheel(wheel, tmp_path / "venv") | {"OPENSWARM_CACHE": str(paths.cache())}
    words = ["openswarm", "new", "robot", "--no-baselines"]
    subprocess.run(words, cwd=tmp_path, env=environment, check=True, capture_output=True)
    shortened(tmp_path / "robot")
    for name, content in baselines.items():
        (tmp_path / "robot" / name).write_bytes(content)
    source = tmp_path / "robot" / "src" / "main.c"

    def play() -> tuple[list[int], str]:
        inputs = {name: one["default"] for name, one in action["inputs"].items()} | {"project": "robot"}
        outputs, summary, statuses = tmp_path / "outputs", tmp_path / "summary", []
        for file in (outputs, summary):
            file.write_text("")
        for step in action["runs"]["steps"]:
            if step["name"] == "Install":  # replaced by the installation above, which needs no network
                continue
            values = {f"inputs.{name}": value for name, value in inputs.items()}
            told = dict(line.split("=", 1) for line in outputs.read_text().splitlines())
            values |= {f"steps.test.outputs.{name}": value for name, value in told.items()}
            own = {name: values[text[4:-3]] for name, text in step.get("env", {}).items()}  # each is one ${{ }}
            assert step["shell"] == "bash"
            done = subprocess.run(
                ["bash", "-e", "-o", "pipefail", "-c", step["run"]], cwd=tmp_path, check=False, capture_output=True,
                env=environment | own | {"GITHUB_OUTPUT": str(outputs), "GITHUB_STEP_SUMMARY": str(summary)},
            )  # fmt: skip
            statuses.append(done.returncode)
        assert Path(told["results"]).is_file()
        return statuses, summary.read_text()

    statuses, summary = play()
    assert statuses == [0, 0, 0, 0]
    assert summary.count("PASS: none of") == 2
    assert summary.count("| passed |") == 4
    right = source.read_text()
    source.write_text(right.replace("Sys_Sleep(1000);", "Sys_Sleep(1000); *(volatile int *)0x3001 = 1;", 1))
    statuses, summary = play()
    assert statuses == [0, 1, 2, 0]
    assert "| failed |" in summary
    line = right.splitlines().index("        Sys_Sleep(1000);") + 1
    assert re.search(rf"\(greet\+0x\w+, src/main\.c:{line}\) in thread 1 \(greet\)", summary)
    left = tmp_path / "robot" / "robot-artefacts"
    assert os.listdir(left)
    assert VCDVCD(str(next(left.glob("*/waves.vcd"))), only_sigs=True).signals


@pytest.mark.parametrize(("when", "noted"), [("call", True), ("setup", False), ("teardown", False)])
def test_the_report_of_a_call_has_the_cycles_of_each_robot(when: str, noted: bool) -> None:
    """The hook adds the cycles of each robot to the properties of its test once, after the call."""
    item = SimpleNamespace(stash={ROBOTS: [SimpleNamespace(cycle=5), SimpleNamespace(cycle=7)]}, user_properties=[])
    hook = pytest_runtest_makereport(item, SimpleNamespace(excinfo=None))
    next(hook)
    with pytest.raises(StopIteration):
        hook.send(SimpleNamespace(when=when, failed=False))
    assert item.user_properties == ([("robot_cycles", 5), ("robot1_cycles", 7)] if noted else [])
