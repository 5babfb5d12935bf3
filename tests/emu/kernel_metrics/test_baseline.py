"""Comparison of exact numbers with a baseline: which changes fail a check, limits, unreadable files, reports."""

from __future__ import annotations

import json

import pytest

from emu.kernel_metrics.baseline import Baseline, Metric, StoredRow, compare, load, save
from emu.kernel_metrics.blame import aligned, normalised, short, without_comments
from emu.kernel_metrics.check_report import CheckReport

EMPTY = Baseline("emu footprint", {"seconds": "1"}, {})


def written(tmp_path, numbers, baseline=EMPTY):
    path = tmp_path / "baseline.json"
    save(str(path), baseline, numbers)
    return path


def report(old, new, blame=None):
    return CheckReport("emu footprint", "b.json", compare(old, new), blame or {}, "emu footprint f.elf --update b.json")


def test_a_baseline_comes_back_as_it_was_written(tmp_path):
    numbers = {"yield": Metric(61, "cycles", where={"_f": {"0": 4}}), "free": Metric(3, of=10, is_gated=False)}
    path = written(tmp_path, numbers, Baseline("emu cycles", {"seconds": "0.5"}, {}, {"_f": ("nop", "return")}))
    found = load(str(path))
    assert found.rows == {"yield": StoredRow(61, {"_f": {"0": 4}}), "free": StoredRow(3, is_gated=False)}
    assert (found.command, found.conditions, found.code) == (
        "emu cycles", {"seconds": "0.5"}, {"_f": ("nop", "return")},
    )  # fmt: skip


def test_an_update_keeps_the_limits_of_the_file(tmp_path):
    old = Baseline("emu footprint", {}, {"RAM": StoredRow(5, limit="at most 9")})
    assert load(str(written(tmp_path, {"RAM": Metric(6)}, old))).rows["RAM"] == StoredRow(6, limit="at most 9")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda table: table.clear(), "schema: expected"),
        (lambda table: table.pop("rows"), "rows: is missing"),
        (lambda table: table.update(extra=1), "extra: is no key of a baseline"),
        (lambda table: table.update(version=1), "version: expected 2, not 1"),
        (lambda table: table.update(rows=[]), "rows: expected an object"),
        (lambda table: table["rows"].update(RAM=3), "rows.RAM: expected an object"),
        (lambda table: table["rows"]["RAM"].update(value="x"), "rows.RAM.value: expected a whole number, not 'x'"),
        (lambda table: table["rows"]["RAM"].update(values=3), "rows.RAM.values: is no key of a row"),
        (lambda table: table["rows"]["RAM"].pop("value"), "rows.RAM.value: expected a whole number, not None"),
        (lambda table: table["rows"]["RAM"].update(where=3), "rows.RAM.where: expected whole numbers"),
        (lambda table: table["rows"]["RAM"].update(limit="small"), "rows.RAM.limit: expected \"at least 20 %\""),
        (lambda table: table["rows"]["RAM"].update(limit="at most 5 %"), "needs a row that is part of a whole"),
        (lambda table: table.update(code={"_f": 1}), "code._f: expected a list of instructions"),
    ],
)  # fmt: skip
def test_an_unreadable_key_is_refused_with_its_name(tmp_path, change, message):
    path = written(tmp_path, {"RAM": Metric(5)})
    table = json.loads(path.read_text())
    change(table)
    path.write_text(json.dumps(table))
    with pytest.raises(ValueError, match=r"baseline\.json: ") as error:
        load(str(path))
    assert message in str(error.value)


@pytest.mark.parametrize("text", ["", "[]", "{}x", "3", '{"a": 1}', '{"a": {"value": 1, "where": {}}}'])
def test_anything_else_is_refused(tmp_path, text):
    path = tmp_path / "baseline.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"baseline\.json: "):
        load(str(path))


def test_growth_and_rows_without_a_partner_fail():
    old = {name: StoredRow(10) for name in ("grew", "fell", "same", "gone")}
    new = {"grew": Metric(11), "fell": Metric(9), "same": Metric(10), "new": Metric(5)}
    assert {row.name: row.verdict for row in compare(old, new) if row.fails} == {
        "grew": "worse", "new": "missing in the baseline", "gone": "no longer measured",
    }  # fmt: skip


def test_of_free_memory_less_is_worse():
    assert compare({"free": StoredRow(10)}, {"free": Metric(9, more_is_better=True)})[0].verdict == "worse"
    assert compare({"free": StoredRow(10)}, {"free": Metric(11, more_is_better=True)})[0].verdict == "better"


def test_a_row_that_is_not_gated_fails_only_over_its_limit():
    old, new = {"file": StoredRow(10, is_gated=False)}, {"file": Metric(99, is_gated=False)}
    assert not any(row.fails for row in compare(old, new) + compare({}, new) + compare(old, {}))
    limited = {"file": StoredRow(10, limit="at most 98", is_gated=False)}
    assert [row.verdict for row in compare(limited, new) + compare(limited, {})] == [
        "over its limit", "no longer measured",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("limit", "value", "fails"),
    [
        ("at most 12", 12, False), ("at most 12", 13, True), ("at least 20 %", 20, False), ("at least 20 %", 19, True),
        ("at least 20%", 25, False), ("at most 12.5 %", 13, True), ("at least 7", 6, True),
    ],
)  # fmt: skip
def test_a_limit_replaces_the_rule_against_growth(limit, value, fails):
    assert compare({"x": StoredRow(10, limit=limit)}, {"x": Metric(value, of=100)})[0].fails == fails


def test_every_check_ends_with_one_verdict_line():
    failed = report({"a": StoredRow(1), "b": StoredRow(1)}, {"a": Metric(3), "b": Metric(2)})
    assert failed.text().splitlines()[-1] == (
        "emu footprint: FAIL: 2 of 2 rows against b.json: a; b."
        " To accept the new numbers: emu footprint f.elf --update b.json"
    )
    passed = report({"a": StoredRow(1)}, {"a": Metric(1)})
    assert passed.text() == "emu footprint: PASS: none of 1 rows is worse than in b.json"
    better = report({"a": StoredRow(2)}, {"a": Metric(1)})
    assert better.text().endswith(", 1 better; keep them with: emu footprint f.elf --update b.json")


def test_reports_hold_baseline_measurement_difference_and_lines():
    made = report({"send": StoredRow(10)}, {"send": Metric(15, "cycles")}, {"send": [("a.c:3: x | y;", 5)]})
    assert "+5 cycles  WORSE" in made.text()
    assert "+5 a.c:3: x | y;" in made.text()
    assert "| send | 10 | 15 | +5 cycles | worse | +5 `a.c:3: x \\| y;` |" in made.markdown()
    facts = made.facts()
    assert facts["verdict"] == "fail"
    assert facts["rows"][0] == {
        "name": "send", "unit": "cycles", "baseline": 10, "measured": 15, "difference": 5, "verdict": "worse",
        "limit": None, "lines": [{"line": "a.c:3: x | y;", "amount": 5}],
    }  # fmt: skip


def test_instructions_are_aligned_whatever_their_registers_and_addresses():
    old = tuple(map(normalised, ("mov.w w1, w2", "bra _f+0x8", "return")))
    new = tuple(map(normalised, ("mov.w w3, w4", "nop", "nop", "bra _f+0xc", "return")))
    assert aligned(old, new) == ({0: 0, 1: None, 2: None, 3: 1, 4: 2}, {1, 2})
    changed = tuple(map(normalised, ("mov.w w1, w2", "bra _g", "return")))
    assert aligned(old, changed) == ({0: 0, 1: 1, 2: 2}, {1})


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/home/x/firmware/openswarm/kernel/event.c", "kernel/event.c"),
        ("openswarm/port/dspic30f/switch.S", "port/dspic30f/switch.S"),
        ("/home/x/firmware/apps/latency/main.c", "apps/latency/main.c"),
        ("/home/x/toolchain/runtime/mul.s", "runtime/mul.s"),
        ("/elsewhere/file.c", "file.c"),
        ("src/drivers/file.c", "src/drivers/file.c"),
    ],
)
def test_names_do_not_depend_on_where_the_checkout_lies(path, expected):
    assert short(path) == expected


def test_the_text_of_a_line_has_no_comments():
    assert without_comments("  return   m; /* last */ // really", "a.c") == "return m;"
    assert without_comments("  bset SR, #7 ; IPL 5", "a.S") == "bset SR, #7"
