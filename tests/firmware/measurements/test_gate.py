"""Planted regressions fail `emu footprint` and `emu cycles` with the right row and line; harmless changes pass.

Regressions that do not touch the same row are planted together in four images. The commit determines the two of them
that are built.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from emu.cli import main
from tests.fuzz.seeds import base_seed

HERE = Path(__file__).parent
SOURCE = HERE / "gate" / "main.c"
SECONDS = "0.05"
FOOTPRINT = ["footprint", "--seconds", SECONDS]
CYCLES = ["cycles", "--seconds", SECONDS, "--function", "weigh"]


@dataclass(frozen=True)
class Change:
    """Replacement of text, the row that must fail, and a part of the line that its report must name first."""

    old: str
    new: str
    row: str = ""
    line: str = ""


REGRESSIONS = (
    (
        Change(".stack = 160", ".stack = 256", "thread loader: stack", "Sys_Start_ProcessWith(&of_loader);"),
        Change("deck[16];", "deck[48];", "RAM", "deck[48];"),
        Change(
            "    bells++;",
            "    bells++; deck[bells & 7] += bells * 3;",
            "interrupt INT1: entry to exit, max",
            "bells * 3",
        ),
        Change(
            "crate + i);", "crate + i), Sys_Send_IntEvent(EVENT_LOAD, i);", "event 0x40: queued messages", "crate + i"
        ),
        Change("i < 4;", "i < 12;", "handler on_done, max", "deck[i] ="),
    ),
    (
        Change(".stack = 144", ".stack = 400", "thread unloader: stack", "Sys_Start_ProcessWith(&of_unloader);"),
        Change("weights[16] = {3,", "weights[48] = {3,", "ROM", "weights[48]"),
        Change("deck, 8);", "deck, 20);", "event 0x41: queued bytes", "deck, 20);"),
        Change("    return weight;", "    return weight / (total + 3);", "function weigh, max", "weight / (total + 3)"),
        Change(
            "    Sys_Register_Event(EVENT_DONE);",
            "    Sys_Register_Event(EVENT_DONE), Sys_Register_Event(0x55);",
            "event 0x55: subscriptions",
            "0x55",
        ),
    ),
    (
        Change(
            "        total = 0;\n",
            "        for (uint16 i = 0; i < 400; i++) { deck[i & 15]++; } total = 0;\n",
            "interrupts masked at 1, max",
            "deck[i & 15]++",
        ),
        Change(
            "    Sys_Push_Cleanup(&tidy[0], nothing, NULL);",
            "    Sys_Push_Cleanup(&tidy[0], nothing, NULL), Sys_Push_Cleanup(&tidy[1], nothing, NULL);",
            "thread unloader: cleanup nodes",
            "Sys_Start_ProcessWith(&of_unloader);",
        ),
        Change(
            "    Sys_Start_ProcessWith(&of_keeper);",
            "    Sys_Start_ProcessWith(&of_keeper), Sys_Start_ProcessWith(&of_keeper);",
            "threads at once",
        ),
        Change(
            "total += weigh(data->value);",
            "total += weigh(data->value) + weigh(total);",
            "handler on_load, max",
            "weigh(total)",
        ),
        Change(
            "    Sys_Subscribe_to_Event(EVENT_DONE, 0, on_done, NULL);",
            "    Sys_Subscribe_to_Event(EVENT_DONE, 0, on_done, NULL),"
            " Sys_Subscribe_to_Event(EVENT_DONE, 0, on_load, NULL);",
            "event 0x41: subscriptions",
            "EVENT_DONE, 0, on_load",
        ),
    ),
    (
        Change(
            "        Sys_Sleep(3);", "        Sys_Sleep(3), Sys_Register_Event(0x60 + crate);", "heap: used at the end"
        ),
        Change(
            "        Sys_Unlock_Mutex(&ramp);\n",
            "",
            "thread loader: mutexes owned",
            "Sys_Start_ProcessWith(&of_loader);",
        ),
        Change(
            "    Sys_Push_Cleanup(&tidy[0], nothing, NULL);\n",
            "    volatile uint16 room[16];\n    room[total & 15] = 1;\n"
            "    Sys_Push_Cleanup(&tidy[0], nothing, NULL);\n",
            "thread unloader: stack used",
            "Sys_Start_ProcessWith(&of_unloader);",
        ),
        Change(
            "    uint16 weight = weights[crate % 16];\n",
            "    uint16 weight = weights[crate % 16];\n    if (total > 2) { done = weight; }\n",
            "function weigh, min",
            "total > 2",
        ),
        Change("static sys_cleanup tidy[3];", "static sys_cleanup tidy[9];", "RAM", "tidy[9]"),
    ),
)
HARMLESS = (
    Change("/* Returns the weight of a crate. */", "/* The weight\n * of a crate. */"),
    Change("enum { EVENT_LOAD = SYS_FIRST_USER_EVENT,", "enum { EVENT_LOAD = 0x40,"),
    Change(
        "static volatile uint16 total, bells, done;",
        "static volatile uint16 total;\nstatic volatile uint16 bells, done;",
    ),
    Change("deck[16];", "deck[4 * 4];"),
    Change("static sys_mutex ramp = SYS_MUTEX(0);", "static sys_mutex ramp = SYS_MUTEX(0); /* one lane */"),
    Change("    uint16 weight = weights[crate % 16];\n    return weight;", "    return weights[crate & 15];"),
    Change("    total += weigh(data->value);", "    total += (weigh((data->value)));"),
    Change("for (uint16 i = 0; i < 4; i++) {", "for (uint16 i = 0; i != 4; ++i) {"),
    Change("    bells++;", "    ++bells;"),
    Change(
        "static void nothing(void *unused)\n{\n    (void)unused;\n}",
        "static void nothing(void *ignored)\n{\n    (void)ignored;\n}",
    ),
    Change("for (uint16 crate = 0;; crate++) {", "for (uint16 crate = 0; true; crate += 1) {"),
    Change("Sys_Send_IntEvent(EVENT_LOAD, crate + i);", "Sys_Send_IntEvent(EVENT_LOAD, (uint16)(i + crate));"),
    Change("        Sys_Sleep(3);", "        Sys_Sleep(2 + 1);"),
    Change("        total = 0;", "        total = (uint16)0u;"),
    Change("        done += data->value;", "        uint16 value = data->value;\n        done += value;"),
    Change(".stack = 144", ".stack = 0x90"),
    Change("int main(void)", "static int unused_helper(int a) { return a + 1; }\n\nint main(void)"),
    Change("    Sys_Init_Kernel();\n", "    (void)unused_helper;\n    Sys_Init_Kernel();\n"),
    Change(
        "    Sys_Register_Event(EVENT_LOAD);\n", "    bool made = Sys_Register_Event(EVENT_LOAD);\n    (void)made;\n"
    ),
    Change(
        "#include <openswarm_cleanup.h>\n#include <openswarm_interrupt.h>\n",
        "#include <openswarm_interrupt.h>\n\n#include <openswarm_cleanup.h>\n",
    ),
)


@pytest.fixture(scope="module")
def built(image, tmp_path_factory):
    """Function that builds the application with changes; returns image and text of the source."""

    def build(changes: tuple[Change, ...]) -> tuple[str, str]:
        folder = tmp_path_factory.mktemp("apps")
        shutil.copytree(SOURCE.parent, folder / "gate")
        text = SOURCE.read_text()
        for change in changes:
            assert text.count(change.old) == 1, change.old
            text = text.replace(change.old, change.new)
        (folder / "gate" / "main.c").write_text(text)
        return str(image("gate", folder)), text

    return build


@pytest.fixture(scope="module")
def baselines(built, tmp_path_factory):
    folder = tmp_path_factory.mktemp("baselines")
    elf, _ = built(())
    assert main([*FOOTPRINT, elf, "--update", str(folder / "footprint.json")]) == 0
    assert main([*CYCLES, elf, "--update", str(folder / "cycles.json")]) == 0
    return folder


def rows_of(elf: str, baselines: Path, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, list[str]], list[int]]:
    """Return the lines named by each row that fails, and the exit statuses of both checks."""
    failed, statuses = {}, []
    for words, name in ((FOOTPRINT, "footprint.json"), (CYCLES, "cycles.json")):
        capsys.readouterr()
        statuses.append(main([*words, elf, "--check", str(baselines / name), "--json"]))
        for row in json.loads(capsys.readouterr().out)["check"]["rows"]:
            if row["verdict"] not in ("same", "better"):
                failed[row["name"]] = [line["line"] for line in row["lines"]]
    return failed, statuses


@pytest.mark.slow
@pytest.mark.parametrize("number", range(base_seed() % 2, len(REGRESSIONS), 2))
def test_a_planted_regression_fails_with_its_row_and_line(built, baselines, capsys, number):
    elf, text = built(REGRESSIONS[number])
    failed, statuses = rows_of(elf, baselines, capsys)
    assert 1 in statuses
    for change in REGRESSIONS[number]:
        assert change.row in failed, (change.row, failed)
        if change.line:
            wanted = next(n for n, line in enumerate(text.splitlines(), 1) if change.line in line)
            lines = failed[change.row][:2]
            assert any(f"main.c:{wanted}" in line for line in lines), (change, wanted, failed[change.row])


@pytest.mark.slow
def test_harmless_changes_pass(built, baselines, capsys):
    elf, _ = built(HARMLESS)
    assert len(HARMLESS) == 20
    assert rows_of(elf, baselines, capsys) == ({}, [0, 0])


def test_there_are_twenty_regressions():
    assert sum(map(len, REGRESSIONS)) == 20
