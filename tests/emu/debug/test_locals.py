"""A sample of tests/fuzz/compiler/fuzz_locals.py: locals and parameters of random functions at every line."""

from __future__ import annotations

from collections import Counter

from tests.fuzz.compiler.fuzz_locals import check_file


def test_locals_and_parameters_are_correct_at_every_line(tmp_path):
    tally = {"-O0": Counter(), "-Os": Counter()}
    check_file(2, tmp_path, tally)
    assert tally["-O0"]["functions"] == tally["-Os"]["functions"] == 10
    assert tally["-O0"]["values"] > 300
    assert tally["-Os"]["values"] > 20 * tally["-Os"]["others"]
