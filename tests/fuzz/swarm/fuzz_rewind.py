"""Debug one robot of a swarm with random forward and reverse commands.

Usage: `python tests/fuzz/swarm/fuzz_rewind.py [--walks N] [--seed N] [--seconds S]`. A sample of this campaign is
tests/arena/debug/test_rewind.py. A walk debugs one robot of a trial whose robots push objects, avoid each other by
infrared, or exchange messages. It steps, continues and rewinds to breakpoints, last writes and earlier times.
Whenever a time is reached again, the world (bodies with their speeds, whole state of all robots) must be equal; in a
crowd of Kilobots, the time and the place and whole state of the debugged one must be. After the debugger detaches, the
record must equal, byte for byte, that of a trial without a debugger.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from shutil import which
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from arena.campaign.campaign import Plan, run_one, trial_path  # noqa: E402
from arena.debug.trial_client import DebugSession, RemoteServer  # noqa: E402
from arena.robots.images import image_for  # noqa: E402
from arena.scene.loader import load_scene  # noqa: E402
from arena.scene.robot_kind import KILOBOT  # noqa: E402
from emu.prompt.client import Client  # noqa: E402
from tests.fuzz.seeds import Campaign, parser  # noqa: E402


@dataclass(frozen=True)
class Swarm:
    """A scene with changed values, and names in its firmware: functions for breakpoints, and variables that change."""

    scene: str
    seconds: float
    functions: tuple[str, ...]
    variables: tuple[str, ...]
    values: dict[str, Any] = field(default_factory=dict)
    is_exact: bool = True
    """Whether the other robots are in the same state whenever the world is at the same time; not in a crowd."""


SWARMS = (
    Swarm("clustering", 1.5, ("react", "Sys_Send_Event"), ("clock_phase",),
          {"robots__count": 3, "objects__count": 4, "start__selector": 8}),
    Swarm("avoidance", 1.2, ("steer",), ("clock_phase",)),
    Swarm("average", 1.2, ("Sys_Sleep",), ("clock_phase",)),
    *([Swarm("orbit", 2.5, ("received", "set_motors"), ("kilo_ticks",), is_exact=False)] if which("avr-gcc") else []),
)  # fmt: skip
"""The last one has Kilobots."""
EVERY_S = 0.2
"""Simulated seconds between checkpoints; short, so that a short trial has many."""


def plan_of(swarm: Swarm, seed: int, image_of: Callable[[str], Path]) -> Plan:
    """Return the plan of a trial of the swarm."""
    scene = load_scene(swarm.scene).with_values(**swarm.values)
    own = {one.image: one.kind for one in scene.groups if one.image}
    image = image_of(swarm.scene) if not own else None
    images = tuple((one, image_for(one, kind=kind) if kind == KILOBOT.name else image_of(one))
                   for one, kind in sorted(own.items()))  # fmt: skip
    return Plan(scene, swarm.scene, "A", image, 1, swarm.seconds, seed, None, images)


class Walk:
    """Debug client of one robot, which executes random commands."""

    def __init__(self, session: DebugSession, swarm: Swarm, rng: random.Random, tally: Counter[str]) -> None:
        self._client = Client(partial(RemoteServer, session), lambda _text: None)
        self._swarm, self._rng, self._tally = swarm, rng, tally
        self.seen: dict[int, str] = {}
        """State of the world by cycle of the robot."""
        self._client.ask("initialize", clientID="walk")
        self._client.ask("launch", stopOnEntry=True)
        self._client.resume("configurationDone")
        self._check_world()

    def _evaluate(self, text: str) -> str:
        return str(self._client.ask("evaluate", expression=text, context="repl")["result"])

    def _cycle(self) -> int:
        time = self._evaluate("/time")
        assert "before the present" not in time
        return int(time.removeprefix("cycle ").partition(", ")[0].replace(",", ""))

    def _check_world(self) -> None:
        cycle, world = self._cycle(), self._evaluate("/world")
        if not self._swarm.is_exact:
            first, *rows = world.splitlines()
            world = "\n".join([first, *(row for row in rows if "(this one)" in row or "state of robot" in row)])
        if cycle in self.seen:
            self._tally["met again"] += 1
            assert world == self.seen[cycle], f"at cycle {cycle}: {_differing_rows(self.seen[cycle], world)}"
        self.seen[cycle] = world

    def _go(self, kind: str, request: str, **arguments: Any) -> None:
        self._tally[kind] += 1
        self._client.resume(request, threadId=1, **arguments)

    def _console(self, kind: str, text: str) -> None:
        self._go(kind, "evaluate", expression=text, context="repl")

    def step(self) -> None:
        """Execute a random command and check the world."""
        rng = self._rng
        kind = rng.choice(["forward", "forward", "on", "back", "back", "reverse", "last write", "again", "again"])
        fine = {"granularity": "instruction"} if rng.random() < 0.5 else {}
        now = self._cycle()
        if kind == "forward":
            for _ in range(rng.randrange(1, 4)):
                self._go(kind, rng.choice(["next", "stepIn", "stepOut"]), **fine)
        elif kind == "on":
            if rng.random() < 0.5:
                self._console(kind, f"/goto {now + rng.randrange(5_000_000)}")
            else:
                self._stop_at(rng.choice(self._swarm.functions))
                self._go(kind, "continue")
        elif kind == "back":
            for _ in range(rng.randrange(1, 4)):
                self._go(kind, "stepBack", **fine)
        elif kind == "reverse":
            self._stop_at(rng.choice(self._swarm.functions))
            self._go(kind, "reverseContinue")
        elif kind == "last write":
            self._console(kind, f"/lastwrite {rng.choice(self._swarm.variables)}")
        else:
            self._stop_at()
            self._console(kind, f"/goto {rng.choice(sorted(self.seen))}")
        self._check_world()

    def _stop_at(self, *functions: str) -> None:
        self._client.ask("setFunctionBreakpoints", breakpoints=[{"name": one} for one in functions])

    def leave(self) -> None:
        """Disconnect, so that the trial finishes without a debugger."""
        self._stop_at()
        self._client.ask("disconnect", terminateDebuggee=False)


def _differing_rows(before: str, now: str) -> str:
    """Return the rows in which two states of the world differ."""
    rows = zip(before.splitlines(), now.splitlines(), strict=False)
    return "; ".join(f"{one} <> {other}" for one, other in rows if one != other)


def walk(
    seed: int, image_of: Callable[[str], Path], steps: int, tally: Counter[str], swarm: Swarm | None = None
) -> None:
    """Run one walk. Raises AssertionError."""
    rng = random.Random(seed)
    swarm = swarm or SWARMS[seed % len(SWARMS)]
    plan = plan_of(swarm, rng.randrange(1000), image_of)
    robot = rng.randrange(plan.scene.robots.count)
    with tempfile.TemporaryDirectory() as folder:
        alone, debugged = Path(folder) / "alone", Path(folder) / "debugged"
        alone.mkdir()
        debugged.mkdir()
        run_one(plan, 1, alone)
        session = DebugSession(plan, robot, debugged, is_recorded=True, every_s=EVERY_S)
        try:
            made = Walk(session, swarm, rng, tally)
            for _ in range(steps):
                made.step()
            made.leave()
            session.finish()
        finally:
            session.close()
        tally[swarm.scene] += 1
        assert trial_path(debugged, 1).read_bytes() == trial_path(alone, 1).read_bytes(), "the records differ"


def main() -> int:
    campaign = Campaign(parser(__doc__), "walks", 12, "walks")
    campaign.parse()
    tally: Counter[str] = Counter()
    for seed in campaign:
        try:
            walk(seed, image_for, 40, tally)
        except AssertionError as error:
            return campaign.failed(error)
    counts = ", ".join(f"{count:,} {kind}" for kind, count in sorted(tally.items()))
    return campaign.ended(f"{counts}: every world as before, every record as without a debugger")


if __name__ == "__main__":
    sys.exit(main())
