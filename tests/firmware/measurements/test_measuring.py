"""`emu footprint` and `emu cycles` on the kernel's measuring applications, compared with the committed baselines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from emu.cli import main
from emu.image.loader import load_image

HERE = Path(__file__).parent
BASELINES = HERE.parents[2] / "firmware" / "baseline"


@pytest.fixture(scope="module")
def footprint(image, tmp_path_factory):
    """Return the JSON output of `emu footprint` for the application `footprint`."""
    out = tmp_path_factory.mktemp("footprint")
    return str(image("footprint")), out


@pytest.mark.slow
def test_the_memory_equation_fits_every_load_exactly(footprint, capsys):
    """The memory equation of kernel.md §5 equals the bytes that the emulator and the allocator count at every load.

    After the load all memory is free again.
    """
    assert main(["footprint", footprint[0], "--json"]) == 0
    equation = json.loads(capsys.readouterr().out)["equation"]
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
    for command, app, name in (
        ("footprint", "footprint", "footprint"),
        ("footprint", "options", "options-footprint"),
        ("cycles", "options", "options-cycles"),
    ):
        status = main([command, str(image(app)), "--check", str(BASELINES / f"{name}.json")])
        assert status == 0, capsys.readouterr().out


@pytest.mark.slow
def test_the_one_number_that_grew_fails_the_check_and_names_the_lines(image, tmp_path, capsys):
    """One kernel cycle above the baseline fails the check, and the message names this number and its lines only."""
    table = json.loads((BASELINES / "cycles.json").read_text())
    name = "Sys_Yield to a yielded thread"
    place = max(table[name]["where"], key=table[name]["where"].get)
    table[name]["value"] -= 1
    table[name]["where"][place] -= 1
    path = tmp_path / "cycles.json"
    path.write_text(json.dumps(table))
    assert main(["cycles", str(image("latency")), "--check", str(path)]) == 1
    out = capsys.readouterr().out
    assert out.count("WORSE") == 1, out
    assert "+1 cycles  WORSE" in out
    assert f"+1 {place}" in out


@pytest.mark.slow
def test_an_update_holds_what_was_measured(image, tmp_path, capsys):
    path = tmp_path / "cycles.json"
    assert main(["cycles", str(image("options")), "--update", str(path), "--json"]) == 0
    table = json.loads(path.read_text())
    assert {name: row["value"] for name, row in table.items()} == json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("command", ["cycles"])
def test_another_application_is_refused(image, capsys, command):
    assert main([command, str(image("hello"))]) == 2
    assert "is not the application `latency`" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-O1", "-O2"])
def test_what_cycles_are_counted_from_stands_at_higher_levels_too(image, level):
    """`emu cycles` finds Sys_Yield at every optimisation level: it is not inlined."""
    symbols = load_image(str(image("latency", None, f"OPTIMISE={level}"))).symbols
    stops = ("Sys_Yield", "Sys_Send_Event", "hal_idle", "_T1Interrupt", "_T2Interrupt", "latency_handler")
    assert [name for name in stops if symbols.find(name) is None] == []
