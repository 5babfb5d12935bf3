"""A sample of the compiler campaign (tests/fuzz/compiler/fuzz_compiler.py); its programs have defined behaviour."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.fuzz.compiler.fuzz_compiler import SOURCES, examine
from tests.fuzz.programs.c_shapes import Program
from tests.fuzz.seeds import base_seed
from tests.watchdog import HANG


@pytest.mark.slow
def test_a_program_does_the_same_at_every_level_and_on_the_host() -> None:
    """A program has one checksum and one sequence of register accesses at every level and on the host."""
    verdict = examine(base_seed())
    assert verdict.kind in ("agreed", "skipped"), verdict.reason


def test_sanitizers_find_no_fault_in_the_programs(tmp_path: Path) -> None:
    """Sanitizers find no undefined behaviour in the generated programs, for which compilers could differ."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed (Debian package gcc)")
    for seed in range(100, 105):
        for name, text in Program(seed).files.items():
            (tmp_path / name).write_text(text)
        command = ["gcc", "-DHOST", "-O1", "-w", "-std=gnu11", "-fsanitize=address,undefined"]
        command += ["-fno-sanitize-recover=all", *(str(tmp_path / name) for name in SOURCES)]
        subprocess.run([*command, "-o", str(tmp_path / "model")], check=True)
        subprocess.run([str(tmp_path / "model")], check=True, stdout=subprocess.DEVNULL, timeout=HANG)


def test_the_same_seed_gives_the_same_program() -> None:
    """The same seed generates the same program, so that a seed suffices to report a failure."""
    assert Program(77).files == Program(77).files
    assert Program(77).files != Program(78).files
