"""Run every campaign below this folder, one after the other.

Usage: `python -m tests.fuzz [--seconds S] [--seed N] [NAME...]`. With --seconds the campaigns share S seconds evenly,
otherwise each makes its own number of tries. With --jobs several campaigns run at the same time, and the output of
each is printed when it ends. A failure does not stop the others. Seeds come from the commit unless --seed gives the
first. Exit status 1 if a campaign failed.

Example: python -m tests.fuzz --seconds 600; python -m tests.fuzz --seconds 60 --seed 7 devices jit
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO

from tests.fuzz.seeds import ROOT, SKIPPED, base_seed, parser

HERE = Path(__file__).parent
PATIENCE = 600.0
"""Seconds beyond its share after which a campaign is considered hung. One try may take long, and images are built
first."""


def campaigns() -> dict[str, Path]:
    """Return the campaign scripts by name."""
    return {script.stem.removeprefix("fuzz_"): script for script in sorted(HERE.glob("*/fuzz_*.py"))}


def run(script: Path, seed: int, seconds: float | None, output: IO[bytes] | None = None) -> str:
    """Run one campaign, with its output on `output`, and return "passed", "skipped" or a description of the failure."""
    command = [sys.executable, str(script), "--seed", str(seed)]
    if seconds is not None:
        command += ["--seconds", f"{seconds:g}"]
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True, stdout=output, stderr=output)
    try:
        status = process.wait(None if seconds is None else seconds + PATIENCE)
    except subprocess.TimeoutExpired:
        return f"hung: still running {PATIENCE:g} s behind its time"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return {0: "passed", SKIPPED: "skipped"}.get(status, f"FAILED with status {status}")


def main() -> int:
    known = campaigns()
    options = parser(__doc__)
    options.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(known)} (default: all)")
    options.add_argument("--seconds", type=float, metavar="S", help="time for all of them together")
    options.add_argument("--seed", type=int, help="first seed of each (default: from the commit's hash)")
    options.add_argument("--jobs", type=int, default=1, metavar="N", help="campaigns that run at once (default 1)")
    given = options.parse_args()
    if unknown := set(given.names) - known.keys():
        options.error(f"no such campaign: {', '.join(sorted(unknown))}")
    names = given.names or list(known)
    seed = base_seed() if given.seed is None else given.seed
    share = None if given.seconds is None else given.seconds / len(names)
    results: dict[str, tuple[str, float]] = {}

    def one(name: str) -> None:
        start = time.monotonic()
        if given.jobs <= 1:
            print(f"== {name}", flush=True)
            results[name] = run(known[name], seed, share), time.monotonic() - start
            return
        with tempfile.TemporaryFile() as printed:
            results[name] = run(known[name], seed, share, printed), time.monotonic() - start
            printed.seek(0)
            print(f"== {name}\n{printed.read().decode(errors='replace')}", end="", flush=True)

    if given.jobs <= 1:
        for name in names:
            one(name)
    else:
        pool = ThreadPoolExecutor(given.jobs)
        try:
            list(pool.map(one, names))
        finally:
            pool.shutdown(cancel_futures=True)
    print(f"== summary, seed {seed}")
    for name in names:
        result, spent = results[name]
        print(f"{name:12} {spent:7.0f} s  {result}")
    failed = [name for name, (result, _) in results.items() if result not in ("passed", "skipped")]
    print(f"failed: {', '.join(failed)}" if failed else "no failure")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
