"""Inputs chosen by coverage: stored corpora, a short campaign, and a fault that it must find."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from tests.fuzz.emulator import fuzz_guided
from tests.fuzz.file_formats import NAMES
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


def test_corpora_are_small_inputs_of_known_kinds(tmp_path: Path) -> None:
    stored = {path.name for path in fuzz_guided.CORPUS.iterdir()}
    kinds = [name for name in NAMES if f"{name.replace(' ', '-')}.zip" in stored]
    assert len(kinds) == len(stored) > 0
    for number, name in enumerate(kinds):
        folder = tmp_path / str(number)
        fuzz_guided.unpack(name, folder)
        assert 0 < max(path.stat().st_size for path in folder.iterdir()) <= fuzz_guided.LARGEST


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
