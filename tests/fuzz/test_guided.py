"""Inputs chosen by coverage: stored corpora, a short campaign, and a fault that it must find."""

from __future__ import annotations

import importlib.util
import random
from pathlib import Path

import pytest

from tests.fuzz.emulator import fuzz_guided
from tests.fuzz.file_formats import NAMES, Bench
from tests.fuzz.seeds import base_seed

KIND = "HEX for AVR"
FAULT = """
import emu.cli
real = emu.cli.main
def main(words):
    if "kilobot" in words and b"0" not in open(words[1], "rb").read():
        raise ValueError("planted")
    return real(words)
emu.cli.main = main
"""


def test_a_corpus_is_stored_as_equal_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz_guided, "CORPUS", tmp_path / "corpus")
    (tmp_path / "found").mkdir()
    for name, data in (("b", b"\x00one"), ("a", b"two" * 400)):
        (tmp_path / "found" / name).write_bytes(data)
    assert fuzz_guided.pack("a kind", tmp_path / "found") == 2
    stored = (tmp_path / "corpus" / "a-kind.zip").read_bytes()
    fuzz_guided.unpack("a kind", tmp_path / "again")
    assert sorted(path.read_bytes() for path in (tmp_path / "again").iterdir()) == [b"\x00one", b"two" * 400]
    fuzz_guided.pack("a kind", tmp_path / "again")
    assert (tmp_path / "corpus" / "a-kind.zip").read_bytes() == stored


def test_every_kind_of_file_has_a_small_corpus() -> None:
    assert {fuzz_guided.archive_of(name) for name in NAMES} == set(fuzz_guided.CORPUS.iterdir())
    for name in NAMES:
        assert 0 < fuzz_guided.archive_of(name).stat().st_size <= fuzz_guided.MOST_STORED
        assert 0 < max(map(len, fuzz_guided.stored_inputs(name))) <= fuzz_guided.LARGEST


def test_a_corpus_has_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shortest inputs are stored."""
    monkeypatch.setattr(fuzz_guided, "CORPUS", tmp_path / "corpus")
    (tmp_path / "found").mkdir()
    rng = random.Random(1)
    for number in range(1, 21):
        (tmp_path / "found" / str(number)).write_bytes(rng.randbytes(100 * number))
    kept = fuzz_guided.pack("a kind", tmp_path / "found")
    assert 10 < kept < 20
    assert max(map(len, fuzz_guided.stored_inputs("a kind"))) == 100 * kept
    assert fuzz_guided.archive_of("a kind").stat().st_size <= fuzz_guided.MOST_STORED


@pytest.mark.slow
def test_stored_inputs_end_with_a_documented_status(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every commit tries two other inputs of each kind."""
    bench, rng = Bench(tmp_path), random.Random(base_seed())
    monkeypatch.chdir(tmp_path)
    for kind in bench.formats:
        stored = fuzz_guided.stored_inputs(kind.name)
        for data in rng.sample(stored, min(2, len(stored))):
            bench.attempt(kind, data)


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="atheris is not installed (extra: test)")
@pytest.mark.parametrize("planted", [False, True])
def test_a_fault_of_a_reader_is_found(planted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if planted:
        (tmp_path / "sitecustomize.py").write_text(FAULT)
        monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{fuzz_guided.ROOT}")
    tried, failure = fuzz_guided.explore(KIND, base_seed(), 60 if planted else 1, keep=False)
    if planted:
        assert failure.startswith(f"{KIND}: b'")
        assert "planted" in failure
    else:
        assert not failure
        assert tried > 1
