"""Memory of long campaigns: many trials in one process take no more memory than a few."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.watchdog import HANG

MOST_GROWTH = 32 << 20
"""Bytes by which 180 trials may raise the memory of the process; the state of one alone takes more than a 180th."""
RUN = """
import os, sys
from pathlib import Path
from arena.cli import main
words = ["run", "clustering", "--brain", "scripted", "--robots", "2", "--objects", "2", "--minutes", "0.02"]
for trials in ("20", "200"):
    assert main([*words, "--trials", trials, "--jobs", "1", "--out", sys.argv[1]]) == 0
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    print("resident", pages * os.sysconf("SC_PAGE_SIZE"))
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux's /proc tells the resident memory")
def test_two_hundred_trials_in_one_process_take_the_memory_of_twenty(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", RUN, str(tmp_path)], capture_output=True, text=True, timeout=HANG,
                          check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    few, many = (int(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("resident "))
    assert many - few < MOST_GROWTH
    assert len(list(tmp_path.glob("trial-*.parquet"))) == 200
