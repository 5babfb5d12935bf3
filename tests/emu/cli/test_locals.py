"""A sample of tests/fuzz/fuzz_locals.py: every local and parameter at -O0, at every line."""

from __future__ import annotations

from collections import Counter

from tests.fuzz.fuzz_locals import tried


def test_locals_and_parameters_are_right_at_every_line(tmp_path):
    tally = {"-O0": Counter(), "-Os": Counter()}
    tried(2, tmp_path, tally)
    assert tally["-O0"]["functions"] == tally["-Os"]["functions"] == 10
    assert tally["-O0"]["values"] > 300
    assert tally["-Os"]["values"] > 20 * tally["-Os"]["others"]
