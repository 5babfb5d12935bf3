"""Infrared messages and shared events with random frames, noise and ambient light.

Usage: `python tests/fuzz/kernel/fuzz_infrared.py [--tries N] [--seconds S]`. Each seed makes RUNS runs of the host
test `anything_seen_and_asked_is_survived` (tests/firmware/host/infrared_noise.c), built with the address and
undefined-behaviour sanitizers. The test feeds intact, damaged, truncated and overlapping frames, noise and ambient
light, while the program makes every call. The seed selects tables and queues of the default size, of one entry, or of
many.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.fuzz.seeds import SKIPPED, Campaign, parser  # noqa: E402

HOST = ROOT / "tests/firmware/host"
RUNS = 50
TEST = "anything_seen_and_asked_is_survived"
SANITIZE = "-fsanitize=address,undefined -fno-sanitize-recover=undefined"
SIZES = (
    "",
    "-DSYS_NEIGHBOURS=1 -DSYS_INFRARED_QUEUE=1 -DSYS_REMOTE_EVENTS=1 -DSYS_REMOTE_MEMORY=1",
    "-DSYS_NEIGHBOURS=64 -DSYS_INFRARED_QUEUE=32 -DSYS_REMOTE_EVENTS=64 -DSYS_REMOTE_MEMORY=100",
)


def build(sizes: str, out: Path) -> Path:
    """Build the kernel's host tests with other table and queue sizes and return the program."""
    words = ["make", "-s", "-j2", "-C", str(HOST), f"OUT={out}", f"SANITIZE={SANITIZE} {sizes}".strip()]
    subprocess.run(words, check=True)
    return out / "kernel_tests"


def main() -> int:
    campaign = Campaign(parser(__doc__), "tries", 30, f"times {RUNS} runs")
    campaign.parse()
    if shutil.which("gcc") is None:
        print("skipped: gcc is not installed")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        programs: dict[str, Path] = {}
        for seed in campaign:
            sizes = SIZES[seed % len(SIZES)]
            if sizes not in programs:
                programs[sizes] = build(sizes, Path(folder, str(len(programs))))
            for run in range(RUNS):
                words = [programs[sizes], TEST, str(seed * RUNS + run)]
                done = subprocess.run(words, capture_output=True, text=True, check=False)
                if done.returncode != 0:
                    return campaign.failed(f"run {words[2]} with {sizes or 'the usual sizes'}: {done.stderr.strip()}")
    return campaign.ended("nothing wrong arrived, everything was given back")


if __name__ == "__main__":
    sys.exit(main())
