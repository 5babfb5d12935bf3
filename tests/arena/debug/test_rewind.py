"""A rewind of a debugged trial restores the whole world, with bodies, light and random numbers: from a checkpoint or
by running the trial again."""

from __future__ import annotations

import json
import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from arena.campaign.campaign import Plan, trial_path
from arena.cli import main
from arena.debug import trial_client as debugsession
from arena.debug import trial_process
from arena.debug.controlled_robot import OVER
from arena.debug.trial_client import DebugSession, RemoteServer
from arena.replay.live_feed import live_path
from arena.trial import checkpoints
from emu.dap.wire import Message
from emu.prompt.client import Client
from tests.arena.conftest import needs_fork
from tests.emu.dap.node import mocha, node_modules
from tests.firmware.conftest import built_once
from tests.fuzz.seeds import base_seed
from tests.fuzz.swarm.fuzz_rewind import SWARMS, Swarm, plan_of, walk

FEW = Swarm("clustering", 1.0, (), (), {"robots__count": 2, "objects__count": 2, "start__selector": 8})


@pytest.fixture
def image_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    return partial(built_once, tmp_path_factory)


class Debugger(Client):
    """Client of a debug session; it stores events and output."""

    def __init__(self, session: DebugSession) -> None:
        self.events: list[tuple[str, Any]] = []
        super().__init__(partial(RemoteServer, session), lambda text: self.events.append(("said", text)))
        self.ask("initialize", clientID="test", supportsInvalidatedEvent=True)
        self.ask("launch", stopOnEntry=True)
        self.resume("configurationDone")

    def send(self, message: Message) -> None:
        if message["type"] == "event":
            self.events.append((message["event"], message["body"]))
        super().send(message)

    def evaluate(self, text: str) -> str:
        return str(self.ask("evaluate", expression=text, context="repl")["result"])

    @property
    def cycle(self) -> int:
        """Return the cycle at which the robot is paused."""
        return int(self.evaluate("/time").removeprefix("cycle ").partition(", ")[0].replace(",", ""))

    def to(self, cycle: int) -> str:
        """Run or rewind to a cycle and return the state of the world."""
        assert self.resume("evaluate", expression=f"/goto {cycle}", context="repl")["reason"] == "goto"
        return self.evaluate("/world")


@contextmanager
def session_of(plan: Plan, folder: Path, **how: Any) -> Iterator[tuple[DebugSession, Debugger]]:
    session = DebugSession(plan, 1, folder, **{"is_recorded": False} | how)
    try:
        yield session, Debugger(session)
    finally:
        session.close()


@pytest.mark.slow
def test_random_walks_restore_equal_worlds(image_of: Callable[[str], Path]) -> None:
    """Random forward and backward runs restore equal worlds, by hash, and leave the record unaffected.

    This is a sample of the fuzz campaign; the commit determines whether its robots use cameras, infrared sensors or
    messages, or are Kilobots.
    """
    tally: Counter[str] = Counter()
    walk(5, image_of, 12, tally, SWARMS[base_seed() % len(SWARMS)])
    assert tally["met again"] >= 2
    assert tally["back"] + tally["reverse"] + tally["last write"] >= 3


@pytest.mark.slow
def test_other_robots_are_restored_in_the_middle_of_a_quantum(image_of: Callable[[str], Path]) -> None:
    """Two pauses in the middle of a quantum restore the same state of the other robots.

    With native code their progress would otherwise depend on which code is already compiled.
    """
    tally: Counter[str] = Counter()
    walk(249942260, image_of, 40, tally, SWARMS[2])
    assert tally["met again"] > 20


@pytest.mark.slow
@needs_fork
def test_an_editor_client_moves_the_whole_world(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, clustering_image: Path
) -> None:
    """The protocol's test-support package rewinds and runs the whole world; the record equals that of an undebugged
    trial."""
    modules = node_modules(tmp_path_factory.mktemp("npm"))
    trial = ["clustering", "--minutes", "0.02", "--brain", str(clustering_image), "--seed", "3",
             "--set", "start.selector=8"]  # fmt: skip
    launcher, debugged = tmp_path / "launcher.py", tmp_path / "debugged"
    words = ["debug", *trial, "--robot", "2", "--out", str(debugged)]
    launcher.write_text(
        f"import sys\nfrom arena.cli import main\nif __name__ == '__main__':\n    sys.exit(main({words}))\n"
    )
    output = mocha(modules, Path(__file__).with_name("rewinding.js"), EMU_LAUNCHER=str(launcher))
    assert "1 passing" in output
    assert main(["run", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    assert trial_path(debugged, 1).read_bytes() == trial_path(tmp_path / "alone", 1).read_bytes()


@needs_fork
def test_without_checkpoints_a_trial_runs_again(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """If no checkpoint is left, a rewind runs the trial again from its seed and reaches an equal world."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path, every_s=0.03) as (session, debugger):
        seen = {cycle: debugger.to(cycle) for cycle in (3_000_000, 6_000_000, 9_000_000)}
        assert session.checkpoint_count == checkpoints.MAX_CHECKPOINTS
        assert debugger.to(6_000_000) == seen[6_000_000]
        assert not [text for kind, text in debugger.events if kind == "said" and "replaying the trial" in text]
        session._checkpoints.discard_after(-1)
        assert debugger.to(3_000_000) == seen[3_000_000]
        assert [text for kind, text in debugger.events if kind == "said" and "replaying the trial" in text]
        assert session.checkpoint_count > 0, "the replay takes checkpoints"
        assert debugger.to(9_000_000) == seen[9_000_000]
        assert debugger.to(2_999_000) != debugger.to(3_000_001)


@needs_fork
def test_changes_are_repeated_after_a_checkpoint(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """A rewind repeats changes made before and after its checkpoint; changes made after its target are discarded."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path, every_s=0.1) as (session, debugger):
        plain = debugger.to(4_000_000)
        debugger.to(1_000_000)
        assert debugger.evaluate("T1CON.TCKPS = 2") == "2"
        assert debugger.to(4_000_000) != plain
        debugger.ask("writeMemory", memoryReference="0x1f00", data="AQI=")
        changed = debugger.to(8_000_000)
        debugger.to(5_000_000)
        assert debugger.evaluate("*(unsigned *)0x1f00") == "513"
        assert debugger.to(8_000_000) == changed
        debugger.to(4_000_001)
        assert debugger.to(8_000_000) == changed
        debugger.to(3_999_999)
        assert debugger.to(8_000_000) != changed
        debugger.to(999_999)
        assert debugger.to(4_000_000) == plain
        assert session.checkpoint_count > 1


@needs_fork
def test_rows_of_a_rewound_trial_are_written_once(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """The live file has increasing times after each rewind, so each row is written once."""
    plan = plan_of(FEW, 7, image_of)
    with session_of(plan, tmp_path, every_s=0.1) as (_, debugger):
        for cycle in (12_000_000, 5_000_000, 11_000_000, 2_000_000, 12_500_000):
            debugger.to(cycle)
            rows = [json.loads(line) for line in live_path(tmp_path, 1).read_text().splitlines()[1:]]
            assert rows
            assert all(one["t"] < other["t"] for one, other in pairwise(rows))


def test_the_end_is_restored(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """A rewind to the end restores the effects of the last sample, which reads the motor positions."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path) as (_, debugger):
        halt = debugger.resume("continue", threadId=1)
        assert halt["description"] == OVER
        end, cycle = debugger.evaluate("/world"), debugger.cycle
        assert debugger.to(cycle) == end
        assert debugger.to(cycle - 500_000) != end
        assert debugger.resume("continue", threadId=1)["description"] == OVER
        assert debugger.evaluate("/world") == end


def test_without_fork_the_world_goes_back_on_inspection(
    tmp_path: Path, image_of: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without fork, a rewind restores only the debugged robot; the trial runs again when the world is inspected or
    the past is changed."""
    monkeypatch.setattr(trial_process, "CAN_FORK", False)
    monkeypatch.setattr(debugsession, "context", partial(multiprocessing.get_context, "fork"))
    with session_of(plan_of(FEW, 7, image_of), tmp_path) as (session, debugger):
        first = debugger.to(3_000_000)
        assert debugger.evaluate("T1CON.TCKPS = 2") == "2"
        second = debugger.to(5_000_000)
        for _ in range(2):
            debugger.resume("evaluate", expression="/goto 3000000", context="repl")
            assert "before the present" in debugger.evaluate("/time")
            assert not [kind for kind, _ in debugger.events if kind == "invalidated"]
        assert debugger.evaluate("/world") != first, "the change is repeated"
        assert [kind for kind, _ in debugger.events if kind == "invalidated"]
        assert "before the present" not in debugger.evaluate("/time")
        assert debugger.to(5_000_000) == second
        debugger.resume("evaluate", expression="/goto 2000000", context="repl")
        assert debugger.evaluate("T1CON.TCKPS = 1") == "1"
        assert debugger.to(3_000_000) != first
        assert session.checkpoint_count == 0


@needs_fork
def test_a_rewind_can_be_paused(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """`pause` stops a rewind between checkpoint and target, and the trial continues from that time."""
    plan = plan_of(Swarm("clustering", 60.0, (), (), FEW.values), 7, image_of)
    with session_of(plan, tmp_path, every_s=1000.0) as (session, debugger):
        early = debugger.to(10_000_000)
        debugger.to(200_000_000)
        pause: Message = {"type": "request", "seq": 0, "command": "pause"}
        receive = session.receive

        def receive_and_pause() -> tuple[Any, ...]:
            received = receive()
            if received[0] == "rewind":
                debugger.inbox.put(pause)
            return received

        session.receive = receive_and_pause  # type: ignore[method-assign]
        halt = debugger.resume("evaluate", expression="/goto 199000000", context="repl")
        assert (halt["reason"], halt["description"]) == ("pause", "interrupted while rewinding")
        assert debugger.cycle < 199_000_000
        assert debugger.to(10_000_000) == early
