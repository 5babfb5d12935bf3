"""`emu profile --board kilobot`: exact cycles by function and line; observers do not change a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from emu.avr.observation import STOP_PLACE, STOP_STEP, STOP_WRITE, Observation
from emu.boards.kilobot.single import SingleKilobot
from emu.cli import main
from tests.emu.avr.conftest import Build
from tests.json_schemas import validated

LOOP = """
volatile uint16_t total;
static uint8_t ticks;
ISR(TIMER0_COMPA_vect) { ticks++; }
static void __attribute__((noinline, naked)) count(void) { __asm__ volatile("nop\\n nop\\n nop\\n ret"); }
int main(void) {
    OCR0A = 249; TCCR0A = 2; TCCR0B = 2; TIMSK0 = 2; sei();
    for (;;) { count(); total++; if (total == 1000) { set_sleep_mode(SLEEP_MODE_IDLE); for (;;) sleep_mode(); } }
}
"""


def test_cycles_by_function_and_line(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """A function of 7 cycles that runs 1,000 times has 7,000; functions, lines and idle time add up."""
    image = build(LOOP, "-Os", "-g")
    assert main(["profile", image.path, "--board", "kilobot", "--seconds", "0.1", "--json", "--ohc", "none"]) == 0
    report = validated("emu", "profile", capsys.readouterr().out)
    assert report["functions"]["count"]["cycles"] == 7_000
    assert report["levels"] == {}
    assert report["idle"]["cycles"] > 600_000
    assert sum(one["cycles"] for one in report["functions"].values()) == report["busy"]["cycles"]
    assert report["busy"]["cycles"] + report["idle"]["cycles"] == report["cycles"] >= 800_000
    (line,) = [number for number, text in enumerate(Path(image.path).with_name("program.c").read_text().splitlines(), 1)
               if "ISR(TIMER0" in text]  # fmt: skip
    handler = report["functions"]["__vector_14"]["cycles"]
    assert [one["cycles"] for name, one in report["lines"].items() if name.endswith(f"program.c:{line}")] == [handler]
    assert handler % 399 == 0  # as many entries, each with 4 cycles and a jump of 3
    assert handler / 399 > 7
    assert not [name for name in report["functions"] if name in ("__vectors", "__vector_default")]


def test_text_callgrind_and_refusals(build: Build, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--lines prints lines, --callgrind writes them. Options of the e-puck and unreadable files are refused."""
    image, file = build(LOOP, "-Os", "-g"), tmp_path / "out.callgrind"
    run = ["profile", image.path, "--board", "kilobot", "--seconds", "0.01"]
    assert main([*run, "--lines", "3", "--callgrind", str(file), "--group", "work=count"]) == 0
    printed = capsys.readouterr().out
    assert "program.c:" in printed
    assert "work " in printed
    assert "fn=count" in file.read_text()
    assert main([*run, "--speedscope", str(file)]) == 2
    assert capsys.readouterr().err == "emu profile: --speedscope does not apply to --board kilobot\n"
    assert main(["profile", str(file), "--board", "kilobot"]) == 2
    assert main(["profile", image.path, "--uid", "3"]) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_a_fault_ends_the_profile(build: Build, capsys: pytest.CaptureFixture[str]) -> None:
    """The counts up to the fault are printed, and the status is 1."""
    image = build("int main(void) { *(volatile uint8_t *)0x900 = 1; for (;;) ; }", "-Os", "-g")
    assert main(["profile", image.path, "--board", "kilobot", "--json"]) == 1
    printed = capsys.readouterr()
    assert "behind the end of RAM" in printed.err
    assert json.loads(printed.out)["fault"]["symbol"] == "main+0x2"


def test_an_observed_run_equals_another(build: Build) -> None:
    """Steps, breakpoints and watched bytes end an observed run; state and time are those of a plain run."""
    image = build(LOOP)
    plain, observed, watching = SingleKilobot(image), SingleKilobot(image), Observation()
    observed.swarm.observe(0, watching)
    address = image.symbols.find("count")
    total = image.symbols.find("total")
    assert address is not None
    assert total is not None
    reasons = []
    watching.places[address.address // 2] = 1
    watching.watch(total.address, 2)
    for _ in range(9):
        watching.reason = 0
        observed.run_until(40_000)
        reasons.append((watching.reason, observed.machine.peek("total", 2)))
    assert reasons[:4] == [(STOP_PLACE, 0), (STOP_WRITE, 1), (STOP_PLACE, 1), (STOP_WRITE, 2)]
    watching.reason, watching.steps = 0, 1
    observed.run_until(40_000)
    assert (watching.reason, observed.machine.pc) == (STOP_STEP, address.address + 2)
    kept = observed.snapshot()
    watching.places[address.address // 2] = watching.reason = 0
    watching.watch(0, 0)
    for until in (20_011, 40_000):
        observed.run_until(until)
        plain.run_until(until)
        assert observed.machine.cycle == plain.machine.cycle
        assert bytes(observed.machine.state.data) == bytes(plain.machine.state.data)
    observed.restore(kept)
    assert observed.machine.pc == address.address + 2
    observed.run_until(40_000)
    assert bytes(observed.machine.state.data) == bytes(plain.machine.state.data)
