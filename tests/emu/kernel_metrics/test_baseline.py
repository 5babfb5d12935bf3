"""Comparison of exact numbers with a baseline: which changes fail a check, and the printed table."""

from __future__ import annotations

import pytest

from emu.kernel_metrics.baseline import Number, Row, Sources, compare, load, save, short, table


def test_a_baseline_comes_back_as_it_was_written(tmp_path):
    path = str(tmp_path / "baseline.json")
    numbers = {"yield": Number(61, {"event.c: return m;": 4}), "send": Number(110)}
    save(path, numbers)
    assert load(path) == numbers


@pytest.mark.parametrize("text", ["", "[]", "{}x", '{"a": 1}', '{"a": {"value": "x", "where": {}}}'])
def test_anything_else_is_refused(tmp_path, text):
    path = tmp_path / "baseline.json"
    path.write_text(text)
    with pytest.raises(ValueError, match="is not a baseline written by --update"):
        load(str(path))


def test_only_growth_and_loss_are_worse():
    old = {"grew": Number(10), "fell": Number(10), "same": Number(10), "gone": Number(10)}
    new = {"grew": Number(11), "fell": Number(9), "same": Number(10), "new": Number(5)}
    rows = compare(old, new)
    assert {row.name: row.is_worse for row in rows} == {
        "grew": True, "fell": False, "same": False, "new": False, "gone": True,
    }  # fmt: skip


def test_lines_that_grew_are_named_largest_first():
    old = {"send": Number(10, {"a.c: x;": 6, "a.c: y;": 4})}
    new = {"send": Number(15, {"a.c: x;": 7, "a.c: y;": 3, "a.c: new();": 5})}
    rows = compare(old, new)
    assert rows == [Row("send", 10, 15, (("a.c: new();", 5), ("a.c: x;", 1)))]
    assert "+5 cycles  WORSE" in table(rows, "cycles")
    assert "+5 a.c: new();" in table(rows, "cycles")


def test_lines_are_named_by_their_code(tmp_path):
    source = tmp_path / "firmware" / "openswarm" / "kernel" / "sample.c"
    source.parent.mkdir(parents=True)
    source.write_text("one\n    return   m;\n")
    sources = Sources(str(tmp_path / "firmware" / "build" / "app" / "firmware.elf"))
    assert sources.name(f"{source}:2") == "kernel/sample.c: return m;"
    assert sources.name("openswarm/kernel/sample.c:2") == "kernel/sample.c: return m;"
    assert sources.name(f"{source}:9") == "kernel/sample.c: line 9"
    assert sources.name("_hal_idle") == "_hal_idle"
    assert sources.names({f"{source}:2": 3, "openswarm/kernel/sample.c:2": 4}) == {"kernel/sample.c: return m;": 7}


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/home/x/firmware/openswarm/kernel/event.c", "kernel/event.c"),
        ("openswarm/port/dspic30f/switch.S", "port/dspic30f/switch.S"),
        ("/home/x/firmware/apps/latency/main.c", "apps/latency/main.c"),
        ("/home/x/toolchain/runtime/mul.s", "runtime/mul.s"),
        ("/elsewhere/file.c", "file.c"),
    ],
)
def test_names_do_not_depend_on_where_the_checkout_lies(path, expected):
    assert short(path) == expected
