"""`make check`: lint, types of changed packages and quick tests of every package, in at most five minutes.

Runs ruff over all files, mypy over the packages that differ from the main branch's last commit (over all packages after
a commit), and the tests without the marker `slow`. Exit status 0 if all three pass, otherwise 1.

Example: python -m tests.check --jobs 2
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
TYPED: Final = ("emu", "toolchain", "arena", "openswarm")
LINTED: Final = (*TYPED, "firmware", "tests", "bench", "docs", "setup.py")


def changed_packages(listed: str) -> list[str]:
    """Return the typed packages that an output of `git status --porcelain` names; all of them if it names none."""
    named = {line[3:].split(" -> ")[-1].strip('"').split("/")[0] for line in listed.splitlines()}
    return [package for package in TYPED if package in named] or list(TYPED)


def main() -> int:
    """Run the three checks and return the exit status."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--jobs", default="2", metavar="N", help="worker processes of pytest (default 2)")
    options.add_argument("tests", nargs="*", default=["tests"], help="files or folders of tests (default: all)")
    wanted = options.parse_args()
    status = subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True, check=False)
    packages = changed_packages(status.stdout)
    lint = subprocess.run([sys.executable, "-m", "ruff", "check", *LINTED], cwd=ROOT, check=False)
    types = subprocess.Popen([sys.executable, "-m", "mypy", *packages], cwd=ROOT, stdout=subprocess.PIPE,
                             stderr=subprocess.STDOUT, text=True)  # fmt: skip
    command = [sys.executable, "-m", "pytest", "-n", wanted.jobs, "--dist", "worksteal", *wanted.tests]
    tests = subprocess.run(command, cwd=ROOT, check=False)
    said, _ = types.communicate()
    print(f"mypy {' '.join(packages)}: {said}", end="")
    results = {"lint": lint.returncode, "types": types.returncode, "tests": tests.returncode}
    print("check: " + ", ".join(f"{name} {'failed' if failed else 'passed'}" for name, failed in results.items()))
    return 1 if any(results.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
