"""`emu footprint` and `emu cycles` on the kernel's measuring applications, compared with the committed baselines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from emu.cli import main
from tests.json_schemas import validated

HERE = Path(__file__).parent
BASELINES = HERE.parents[2] / "firmware" / "baseline"


@pytest.mark.slow
def test_the_memory_equation_fits_every_load_exactly(image, capsys):
    """The memory equation of kernel.md §5 equals the bytes that the emulator and the allocator count at every load.

    After the load all memory is free again.
    """
    assert main(["footprint", str(image("footprint")), "--json"]) == 0
    equation = validated("emu", "footprint", capsys.readouterr().out)["equation"]
    assert equation["largest_residual"] == 0
    assert len(equation["cases"]) >= 60
    assert all(case["taken"] == case["counted"] and case["left"] == 0 for case in equation["cases"])
    assert {case["load"]["threads"] for case in equation["cases"]} >= set(range(9))
    assert {case["load"]["events"] for case in equation["cases"]} >= set(range(17))
    assert {case["load"]["subscriptions"] for case in equation["cases"]} >= set(range(17))
    assert equation["A"] == sum(equation["constant"].values())


@pytest.mark.slow
def test_footprint_and_cycles_have_not_grown(image, capsys):
    """Footprint and cycles equal the committed baselines.

    Refresh them with --update if a number fell, or with a reason if one rose.
    """
    for words, app, name in (
        (["footprint"], "footprint", "footprint"),
        (["footprint"], "options", "options-footprint"),
        (["cycles", "--suite"], "options", "options-cycles"),
    ):
        status = main([*words, str(image(app)), "--check", str(BASELINES / f"{name}.json")])
        assert status == 0, capsys.readouterr().out


@pytest.mark.slow
def test_the_one_number_that_grew_fails_the_check_and_names_the_lines(image, tmp_path, capsys):
    """One kernel cycle above the baseline fails the check, and the message names this number and its lines only."""
    table = json.loads((BASELINES / "cycles.json").read_text())
    name = "Sys_Yield to a yielded thread"
    function, parts = max(table["rows"][name]["where"].items(), key=lambda item: sum(item[1].values()))
    parts[max(parts, key=parts.get)] -= 1
    table["rows"][name]["value"] -= 1
    path = tmp_path / "cycles.json"
    path.write_text(json.dumps(table))
    assert main(["cycles", "--suite", str(image("latency")), "--check", str(path), "--json"]) == 1
    check = validated("emu", "cycles-suite", capsys.readouterr().out)["check"]
    (row,) = [row for row in check["rows"] if row["verdict"] not in ("same", "better")]
    assert (row["name"], row["difference"]) == (name, 1)
    assert [line["amount"] for line in row["lines"]] == [1], function


@pytest.mark.slow
def test_an_update_holds_what_was_measured(image, tmp_path, capsys):
    path = tmp_path / "cycles.json"
    assert main(["cycles", "--suite", str(image("options")), "--update", str(path), "--json"]) == 0
    table = json.loads(path.read_text())["rows"]
    assert {name: row["value"] for name, row in table.items()} == validated(
        "emu", "cycles-suite", capsys.readouterr().out
    )


def test_the_suite_needs_one_of_its_applications(image, capsys):
    assert main(["cycles", "--suite", str(image("hello"))]) == 2
    assert "is not the application `latency`" in capsys.readouterr().err
