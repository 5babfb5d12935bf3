"""Run the commands of docs/tour.md and store their current output on the page: `python docs/tools/tour.py`.

A block that begins with `$ ` is a session. Each line that begins with `$ ` is a command; a shell runs it in the
checkout, and its standard output and standard error follow it on the page. A line `...` stands for omitted lines; the
page keeps as many lines before and after it as it had. With --check the page is not written, and the status is 1 if
a line differs in more than its speed.
"""

from __future__ import annotations

import argparse
import difflib
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tour.md"
CUT = "..."
SPEED = re.compile(r"[\d.e-]+ x real time")
"""Speed of a run, which depends on the computer."""


def output_of(command: str) -> list[str]:
    """Return the output of a shell command; paths in this checkout are made relative to it."""
    done = subprocess.run(
        ["bash", "-c", command], cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, timeout=600, check=False,
    )  # fmt: skip
    if done.returncode == 127 or "Traceback" in done.stdout:
        sys.exit(f"{command}: {done.stdout}")
    return done.stdout.replace(f"{ROOT}/", "").splitlines()


def shorten(new: list[str], old: list[str]) -> list[str]:
    """Return the lines `new`, shortened at the position at which `old` was shortened."""
    if CUT not in old:
        return new
    before = old.index(CUT)
    behind = len(old) - before - 1
    return [*new[:before], CUT, *(new[len(new) - behind :] if behind else [])]


def run_session(block: str) -> str:
    """Run the commands of a session and return it with their current output."""
    parts: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            parts.append((line, []))
        else:
            parts[-1][1].append(line)
    lines: list[str] = []
    for command, old in parts:
        lines += [command, *(line.rstrip() for line in shorten(output_of(command[2:]), old))]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare the page with the output, write nothing")
    options = parser.parse_args()
    text = PAGE.read_text(encoding="utf-8")
    fresh = re.sub(r"(?<=```\n)(\$ .*?)(?=```)", lambda found: run_session(found[1]), text, flags=re.DOTALL)
    if not options.check:
        PAGE.write_text(fresh, encoding="utf-8")
        return 0
    was, now = (SPEED.sub("x real time", one).splitlines() for one in (text, fresh))
    differences = list(difflib.unified_diff(was, now, "docs/tour.md", "output", lineterm="", n=0))
    print(*differences, sep="\n", end="\n" if differences else "")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
