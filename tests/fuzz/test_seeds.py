"""Campaigns start at the seed of the commit, end in time, and name the seed of a failure."""

from __future__ import annotations

import runpy
import sys

import pytest

from tests.cases import check_all
from tests.fuzz.__main__ import campaigns
from tests.fuzz.seeds import ROOT, Campaign, base_seed, parser


def test_the_first_seed_follows_from_the_commit() -> None:
    """The first seed is the same for one commit, and small enough for generators with 31-bit seeds."""
    assert base_seed() == base_seed()
    assert 0 < base_seed() < 1 << 28


def campaign(*words: str) -> Campaign:
    """Return a campaign with at most three tries by default."""
    made = Campaign(parser("text"), "tries", 3, "tries")
    made.parse(list(words))
    return made


def test_a_course_has_as_many_seeds_as_asked_for_or_as_fit_into_its_time() -> None:
    """A campaign counts from the first seed to the number of tries or until the time is over; it tries at least one
    seed."""
    assert list(campaign("--seed", "7")) == [7, 8, 9]
    assert list(campaign("--seed", "7", "--tries", "2")) == [7, 8]
    assert list(campaign("--seed", "7", "--seconds", "0")) == [7]
    endless = iter(campaign("--seed", "7", "--seconds", "1000"))
    assert [next(endless) for _ in range(9)] == list(range(7, 16))


def test_a_long_campaign_tells_where_it_is(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress lines name the next seed, with which the campaign resumes; standard output contains only results."""
    monkeypatch.setattr("tests.fuzz.seeds.REPORT_EVERY", 0.0)
    assert list(campaign("--seed", "7", "--tries", "2")) == [7, 8]
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines()[-1].startswith("1 of 2 tries, ")
    assert said.err.splitlines()[-1].endswith("at seed 8")


def test_a_failure_names_its_seed_and_how_to_see_it_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure prints its seed and a command that repeats it, with the options of the run but without its limits."""
    monkeypatch.setattr(sys, "argv", [str(ROOT / "tests/fuzz/fuzz_x.py"), "--engine", "jit", "--seconds", "5"])
    failing = campaign("--seed", "40")
    for seed in failing:
        if seed == 41:
            break
    assert failing.failed("it differs") == 1
    said = capsys.readouterr().out
    assert "seed 41: it differs" in said
    assert "again: python tests/fuzz/fuzz_x.py --engine jit --seed 41 --tries 1" in said


def test_every_campaign_takes_a_seed_and_a_time(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every campaign accepts --seed and --seconds, which `python -m tests.fuzz` passes."""

    def check(name: str) -> None:
        monkeypatch.setattr(sys, "argv", [str(campaigns()[name]), "--help"])
        with pytest.raises(SystemExit, match="0"):
            runpy.run_path(str(campaigns()[name]), run_name="__main__")
        usage = capsys.readouterr().out
        assert "--seed " in usage
        assert "--seconds " in usage

    check_all(check, sorted(campaigns()))
