"""`emu footprint` and `emu cycles` on an application in its own folder: five threads, UART, camera (`courier`).

The expected bytes are counted by hand from the sizes in kernel.h. The expected cycles are those that the kernel's own
suite measures in another application (`firmware/baseline/cycles.json`).
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from emu.cli import main
from emu.kernel_metrics.kernel_structures import SYSTEM_EVENTS
from openswarm.testing.robot import Robot

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[2] / "firmware"
PCB, EVENT, SUBSCRIPTION, MESSAGE = 18, 6, 8, 6
"""Sizes in bytes of the kernel's records (kernel.h)."""


@pytest.fixture(scope="module")
def courier(image):
    return str(image("courier", HERE))


@pytest.fixture(scope="module")
def changed(image, tmp_path_factory):
    """Function that builds the application with replaced text: `changed(("old", "new"))`."""

    def build(*replacements, name="courier"):
        folder = tmp_path_factory.mktemp("apps")
        shutil.copytree(HERE / "courier", folder / name)
        source = folder / name / "main.c"
        text = source.read_text()
        for old, new in replacements:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        source.write_text(text)
        return str(image(name, folder))

    return build


def facts(capsys, *words):
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def baseline(courier, tmp_path_factory):
    path = str(tmp_path_factory.mktemp("baseline") / "footprint.json")
    assert main(["footprint", courier, "--seconds", "0.05", "--update", path]) == 0
    return path


def test_every_allocation_has_the_bytes_counted_by_hand(courier, capsys):
    run = facts(capsys, "footprint", courier, "--seconds", "0.05")["run"]
    stacks = {"courier": 128, "watcher": 128, "console": 200, "left": 128, "right": 128}
    system, *threads = run["threads"]
    assert {one["name"]: one["stack"] for one in threads} == stacks
    assert all(one["heap"] == one["stack"] + PCB for one in threads)
    assert all(one["used"] + one["free"] + one["guard"] == one["stack"] for one in run["threads"])
    assert (system["name"], system["pid"], system["heap"]) == ("main", 0, 0)
    assert 4 < system["used"] < system["stack"]
    heap, own = run["heap"], run["equation"]
    assert heap["threads"] == sum(stacks.values()) + len(stacks) * PCB
    assert (own["B"], own["C"], own["D"], own["E"], own["n"]) == (PCB, EVENT, SUBSCRIPTION, MESSAGE, 5)
    assert heap["events"] == EVENT * own["m"]
    assert heap["subscriptions"] == SUBSCRIPTION * own["s"]
    parcels = next(one for one in run["events"] if one["identifier"] == 0x40)
    assert (parcels["peak_messages"], parcels["peak_bytes"], parcels["sent"]) == (3, 3 * (MESSAGE + 10), 9)
    assert (own["messages"], own["payload"]) == (3, 30)
    kinds = ("threads", "events", "subscriptions", "gates", "messages", "drivers")
    assert sum(heap[kind] for kind in kinds) == heap["used"] == heap["capacity"] - heap["free"]
    assert heap["drivers"] == 0
    assert heap["peak"] == sum(heap["fullest"].values())
    by_equation = own["A"] + sum(own["stacks"].values()) + PCB * 5 + EVENT * own["m"] + SUBSCRIPTION * own["s"]
    assert own["ram"] == by_equation + MESSAGE * 3 + 30


def test_names_of_system_events_are_those_of_the_headers():
    text = "".join(path.read_text() for path in FIRMWARE.glob("openswarm/**/*.h"))
    for number, name in SYSTEM_EVENTS.items():
        assert re.search(rf"\b{name} = {number:#04x}\b", text, re.IGNORECASE), name


@pytest.mark.parametrize("stack", [1400, 2800])
def test_a_larger_stack_fails_the_check_with_its_row_and_line(changed, baseline, capsys, stack):
    """Row and line are named, also if the thread no longer fits and the firmware stops at the thread's start."""
    image = changed((".stack = 200", f".stack = {stack}"))
    capsys.readouterr()
    assert main(["footprint", image, "--seconds", "0.05", "--check", baseline]) == 1
    out = capsys.readouterr().out.splitlines()
    row = next(n for n, line in enumerate(out) if line.startswith("thread console: stack "))
    assert (f"+{stack - 200:,} bytes  WORSE" if stack < 2800 else "NO LONGER MEASURED") in out[row]
    line = (HERE / "courier/main.c").read_text().splitlines().index(
        "    SYS_ASSERT(Sys_Start_ProcessWith(&roomy));"
    ) + 1  # fmt: skip
    if stack < 2800:
        assert f"main.c:{line}" in out[row + 1]
    assert out[-1].startswith("emu footprint: FAIL: ")
    assert out[-1].endswith(f"--update {baseline}")


def test_main_and_a_thread_that_never_ran_have_rows(courier, changed, baseline, capsys):
    """The frame of a new thread takes ten words (hal_stack_init); an array in `main` counts in full."""
    image = changed(
        ("static void left(void)", "static void never(void)\n{\n}\n\nstatic void left(void)"),
        ("    Sys_Init_Kernel();\n", "    Sys_Init_Kernel();\n    volatile uint16 room[40];\n"
         "    for (uint16 i = 0; i < 40; i++) {\n        room[i] = i;\n    }\n"),
        ("    Sys_Start_Kernel();\n", "    Sys_Kill_Process(Sys_Start_Process(never));\n    Sys_Start_Kernel();\n"),
    )  # fmt: skip
    before = facts(capsys, "footprint", courier, "--seconds", "0.05")["run"]["threads"][0]
    threads = {one["name"]: one for one in facts(capsys, "footprint", image, "--seconds", "0.05")["run"]["threads"]}
    assert threads["main"]["used"] >= before["used"] + 80
    never = threads["never"]
    assert (never["stack"], never["used"], never["started"], never["heap"]) == (128, 20, 1, 128 + PCB)
    start = (HERE / "courier/main.c").read_text().splitlines().index("    Sys_Start_Kernel();") + 1
    assert never["line"].endswith(f"main.c:{start + 8}")
    assert main(["footprint", image, "--seconds", "0.05", "--check", baseline]) == 1
    rows = capsys.readouterr().out.splitlines()
    failed = [line for line in rows if "WORSE" in line or "NOT IN THE BASELINE" in line]
    assert any(line.startswith("thread main: stack used ") for line in failed)
    assert not any(line.startswith("thread main: stack ") and "stack used" not in line for line in failed)


def test_a_limit_of_a_row_is_checked(courier, baseline, tmp_path, capsys):
    table = json.loads(Path(baseline).read_text())
    table["rows"]["thread watcher: stack free"]["limit"] = "at least 60 %"
    table["rows"]["thread console: stack free"]["limit"] = "at least 99 %"
    path = tmp_path / "limits.json"
    path.write_text(json.dumps(table))
    words = ["footprint", courier, "--seconds", "0.05"]
    assert main([*words, "--check", str(path), "--json"]) == 1
    check = json.loads(capsys.readouterr().out)["check"]
    assert [row["name"] for row in check["rows"] if row["verdict"] == "over its limit"] == [
        "thread console: stack free"
    ]  # fmt: skip
    assert main([*words, "--update", str(path)]) == 0
    assert json.loads(path.read_text())["rows"]["thread watcher: stack free"]["limit"] == "at least 60 %"


def test_other_conditions_than_those_of_the_baseline_are_refused(courier, baseline, capsys):
    assert main(["footprint", courier, "--seconds", "0.06", "--check", baseline]) == 2
    assert "measured with --seconds 0.05, this run has --seconds 0.06" in capsys.readouterr().err
    assert main(["cycles", courier, "--check", baseline]) == 2
    assert "written by `emu footprint`, not by `emu cycles`" in capsys.readouterr().err


def test_a_picture_shows_all_of_the_memory(courier, tmp_path, capsys):
    words = ["footprint", courier, "--seconds", "0.02", "--picture"]
    for name in ("memory.svg", "memory.html"):
        assert main([*words, str(tmp_path / name)]) == 0
    capsys.readouterr()
    picture = (tmp_path / "memory.svg").read_text()
    sizes = [int(size.replace(",", "")) for size in re.findall(r"<title>[^<]*: ([\d,]+) bytes</title>", picture)]
    assert sum(sizes) == 144 * 1024 + 8192
    assert "console: stack free" in picture
    page = (tmp_path / "memory.html").read_text()
    assert picture in page
    assert "http" not in page.replace("http://www.w3.org", "")
    assert main([*words, str(tmp_path / "memory.png")]) == 2


@pytest.fixture(scope="module")
def suite():
    rows = json.loads((FIRMWARE / "baseline/cycles.json").read_text())["rows"]
    return {name: row["value"] for name, row in rows.items()}


def test_switches_take_the_cycles_that_the_kernels_suite_measures(courier, suite, capsys):
    words = ["cycles", courier, "--seconds", "0.025", "--function", "on_parcel"]
    found = facts(capsys, *words)["operations"]
    yields = found["yield: left -> right"]
    assert yields["undisturbed_min"] == suite["Sys_Yield to a yielded thread"]
    assert yields["count"] > 1000
    assert found["event 0x40: send to on_parcel"]["count"] == 3
    assert found["handler on_parcel"] == found["function on_parcel"]
    assert found["handler on_parcel"]["min"] == 1 + 1 + 3  # MOV, ADD, RETLW (isa.md §13.1)
    assert found["interrupt T1: request to entry"]["min"] == 4  # isa.md §14.2


def test_the_scheduler_is_not_charged_for_the_idle_loop(image):
    """A call of os_schedule that waits in hal_idle counts only its work before the first and after the last wait."""
    robot = Robot(image("hello"))
    robot.run(ms=5)
    with robot.measured() as measured:
        robot.run(ms=1100)
    waiting = measured.cycles("hal_idle")
    assert waiting.calls > 100
    assert measured.cycles("os_schedule").total < waiting.total
