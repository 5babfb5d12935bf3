"""What an interactive Python session shows of public objects: short texts, HTML tables, data frames."""

from __future__ import annotations

import re
import sys

import pytest

import emu
from emu.boards.part import BoardPart
from emu.host.result_tables import data_frame, html_table
from emu.kernel_metrics.cycle_results import ApplicationCycles, Operation
from emu.profile.cycle_shares import Profiler
from toolchain.driver import driver

LONGEST = 200
SOURCE = """\
struct robot { struct robot *next; int speed[2]; } robot = {&robot, {1, 2}};
__attribute__((noinline)) int sum(int n) { int s = 0; while (n) { s += robot.speed[n-- & 1]; } return s; }
volatile int n = 3;
int main(void) { for (;;) { n = sum(n & 7) & 7; } }
"""


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "main.c").write_text(SOURCE)
    assert driver.main(["-O1", "-g", str(folder / "main.c"), "-o", str(folder / "main.elf")]) == 0
    made = emu.load(folder / "main.elf")
    made.run(until="sum")
    return made


def test_the_text_of_every_public_object_is_short(machine):
    profiler = Profiler(machine, machine.image)
    with profiler.counting() as profile:
        stop = machine.run(cycles=1000)
    debug = machine.inspector.debug
    objects = [
        machine, machine.image, machine.image.symbols, machine.image.lines, *machine.image.sections,
        *machine.image.blocks, stop, *machine.backtrace(), machine.value("robot"), machine.value("robot").type,
        machine.inspector, debug, *debug.functions, machine.inspector.variable("robot"), profile, profiler,
        machine.board, machine.uart[1], machine.pins, machine.chip, machine.peripherals,
        Operation("x" * 500, list(range(500))), ApplicationCycles(1.0, {}),
    ]  # fmt: skip
    assert [repr(one)[:300] for one in objects if len(repr(one)) > LONGEST] == []


def test_the_text_of_a_machine_and_its_parts_says_their_state(machine):
    assert re.fullmatch(r"<Machine dsPIC30F6014A: main\.elf, at 0x\w+, cycle [\d,]+, [\d.]+ s>", repr(machine))
    assert repr(machine.uart[1]) == "<Uart 1, disabled>"
    assert repr(machine.board) == "<Epuck with <Selector at 0>, <Leds, lit: none>>"
    parts = [part for part in vars(machine.board).values() if isinstance(part, BoardPart)]
    assert len(parts) > 8
    assert [repr(part) for part in parts if " object at 0x" in repr(part)] == []


def test_results_are_tables(machine):
    profiler = Profiler(machine, machine.image)
    with profiler.counting() as profile:
        machine.run(cycles=10_000)
    page = profile._repr_html_()
    assert page.count("<tr>") == 1 + len(profile.functions)
    assert re.search(r"<td[^>]*>_sum</td>", page)
    assert sum(row["percent"] for row in profile.rows()) == pytest.approx(100)
    result = ApplicationCycles(1.0, {"yield": Operation("yield", [5, 7, 6], [5])})
    assert result.rows()[0] | {"operation": "yield", "count": 3, "min": 5, "median": 6, "max": 7} == result.rows()[0]
    assert "<td" in result._repr_html_()
    assert html_table([{"a": "<b>"}]).count("&lt;b&gt;") == 1


def test_a_frame_needs_pandas(monkeypatch):
    rows = [{"a": 1, "b": "x"}, {"a": 2, "b": "y"}]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError, match="frame\\(\\) needs pandas"):
        data_frame(rows)
    monkeypatch.undo()
    pandas = pytest.importorskip("pandas", reason="pandas is not installed (extra: test)")
    assert data_frame(rows).equals(pandas.DataFrame(rows))
