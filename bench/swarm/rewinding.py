"""Measure time and memory of stepping a debugged swarm backwards (Linux).

    python -m bench.swarm.rewinding [--minutes M] [--json]

Robot 2 of `clustering` (five robots with cameras) is debugged for M simulated minutes (default 2). Wall-clock seconds
are measured for: the first step back with the whole world and the fastest of the next ten; a run back to the previous
breakpoint; a rewind by a minute; and the same minute forward in a plain trial. Memory in MB is measured after half the
time and at the end: the trial's process with all checkpoints, shared pages counted once, and the mean per checkpoint.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from arena.campaign.campaign import Plan
from arena.debug.trial_client import DebugSession, RemoteServer
from arena.robots.images import image_for
from arena.scene.loader import FCY, load_scene
from emu.prompt.client import Client

ROOT = Path(__file__).resolve().parents[2]
ROBOT = 2


def timed(client: Client, request: str, **arguments: Any) -> float:
    """Return host seconds until the swarm is paused again."""
    start = time.perf_counter()
    client.resume(request, threadId=1, **arguments)
    return time.perf_counter() - start


def memory_mb(pid: int, *kinds: str) -> float:
    """Return the memory of a process in MB, as reported by Linux."""
    rows = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return sum(int(row.split()[1]) for row in rows if row.startswith(kinds)) / 1024


def children(pid: int) -> list[int]:
    """Return the live child processes of a process."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(one) for one in found if Path(f"/proc/{one}/maps").read_text()]


def measure(minutes: float) -> dict[str, float]:
    """Return all figures by label."""
    scene = load_scene("clustering").with_values(start__selector=8)
    plan = Plan(scene, "openswarm", "A", image_for("openswarm"), 1, 60 * minutes + 10, 1)
    found: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        session = DebugSession(plan, ROBOT, Path(folder), is_recorded=False)
        client = Client(partial(RemoteServer, session), lambda _text: None)
        client.ask("initialize")
        client.ask("launch", stopOnEntry=True)
        client.resume("configurationDone")

        def to(seconds: float) -> float:
            return timed(client, "evaluate", expression=f"/goto {round(seconds * FCY)}", context="repl")

        for part in (0.5, 1.0):
            to(60 * minutes * part)
            trial = session.process_id
            copies = children(trial)
            after = f"after {minutes * part:g} min, MB"
            found[f"trial with {len(copies)} moments {after}"] = sum(memory_mb(one, "Pss:") for one in (trial, *copies))
            found[f"private memory of a checkpoint {after}"] = sum(
                memory_mb(one, "Private_") for one in copies
            ) / len(copies)
        fine = {"granularity": "instruction"}
        found["first step back, s"] = timed(client, "stepBack", **fine)
        found["another, s"] = min(timed(client, "stepBack", **fine) for _ in range(10))
        client.ask("setFunctionBreakpoints", breakpoints=[{"name": "react"}])
        found["back to a breakpoint, s"] = timed(client, "reverseContinue")
        client.ask("setFunctionBreakpoints", breakpoints=[])
        found["back by a minute, s"] = to(60 * minutes - 60)
        found["forward by 10 s, s"] = to(60 * minutes - 50)
        session.close()
    return found


def main() -> int:
    """Measure and print the table."""
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=2, help="simulated time, at least 1 (default 2)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    found = measure(max(options.minutes, 1.0))
    if options.json:
        print(json.dumps(found))
    else:
        for name, number in found.items():
            print(f"{name:52} {number:8.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
