"""Runs the commands of docs/tour.md again and stores their present output on the page: `python docs/tools/tour.py`.

A block that begins with `$ ` is a session: a shell in the checkout runs every line that begins so, and both output
streams follow it. A line `...` stands for omitted lines; the page keeps as many lines before and after it as it had.
With --check nothing is written, and the status is 1 if a command failed to run.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tour.md"
CUT = "..."


def output_of(command: str) -> list[str]:
    """What a shell prints for `command`; paths of this checkout are shown relative to it."""
    done = subprocess.run(
        ["bash", "-c", command], cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, timeout=600, check=False,
    )  # fmt: skip
    if done.returncode == 127 or "Traceback" in done.stdout:
        sys.exit(f"{command}: {done.stdout}")
    return done.stdout.replace(f"{ROOT}/", "").splitlines()


def shortened(new: list[str], old: list[str]) -> list[str]:
    """`new`, cut where `old` was."""
    if CUT not in old:
        return new
    before = old.index(CUT)
    behind = len(old) - before - 1
    return [*new[:before], CUT, *(new[len(new) - behind :] if behind else [])]


def replayed(block: str) -> str:
    """A session with fresh output."""
    parts: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            parts.append((line, []))
        else:
            parts[-1][1].append(line)
    lines: list[str] = []
    for command, old in parts:
        lines += [command, *(line.rstrip() for line in shortened(output_of(command[2:]), old))]
    return "\n".join(lines) + "\n"


def main() -> int:
    text = PAGE.read_text(encoding="utf-8")
    fresh = re.sub(r"(?<=```\n)(\$ .*?)(?=```)", lambda found: replayed(found[1]), text, flags=re.DOTALL)
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(fresh, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
