"""A debugged trial goes back as a whole: robots, bodies, light and chance; from moments that are kept, or its seed."""

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
from arena.debug import server
from arena.debug import session as debugsession
from arena.debug.controlled_robot import OVER
from arena.debug.session import DebugSession, RemoteServer
from arena.replay.live_feed import live_path
from arena.trial import checkpoints
from emu.dap.wire import Message
from emu.prompt.client import Client
from tests.emu.dap.node import mocha, node_modules
from tests.firmware.conftest import built_once
from tests.fuzz.fuzz_rewind import SWARMS, Swarm, plan_of, walk

FEW = Swarm("clustering", 1.0, (), (), {"robots__count": 2, "objects__count": 2, "start__selector": 8})
needs_copies = pytest.mark.skipif(not checkpoints.CAN_COPY, reason="moments are kept on Linux only")


@pytest.fixture
def image_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    return partial(built_once, tmp_path_factory)


class Debugger(Client):
    """A client of a session that keeps events and says nothing."""

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

    def told(self, text: str) -> str:
        return str(self.ask("evaluate", expression=text, context="repl")["result"])

    @property
    def cycle(self) -> int:
        """At which the robot stands."""
        return int(self.told("/time").removeprefix("cycle ").partition(", ")[0].replace(",", ""))

    def to(self, cycle: int) -> str:
        """Go to a cycle; the world there."""
        assert self.resume("evaluate", expression=f"/goto {cycle}", context="repl")["reason"] == "goto"
        return self.told("/world")


@contextmanager
def session_of(plan: Plan, folder: Path, **how: Any) -> Iterator[tuple[DebugSession, Debugger]]:
    session = DebugSession(plan, 1, folder, **{"is_recorded": False} | how)
    try:
        yield session, Debugger(session)
    finally:
        session.close()


@pytest.mark.parametrize("swarm", SWARMS, ids=[one.scene for one in SWARMS])
def test_random_walks_meet_the_world_that_was_there(swarm: Swarm, image_of: Callable[[str], Path]) -> None:
    """Robots with cameras that push things, robots that avoid each other, and such that talk. A sample of the
    campaign: worlds by hash at equal times, the record byte for byte."""
    tally: Counter[str] = Counter()
    walk(5, image_of, 12, tally, swarm)
    assert tally["met again"] >= 2
    assert tally["back"] + tally["reverse"] + tally["last write"] >= 3


def test_others_stand_in_the_middle_of_a_quantum_where_they_stood(image_of: Callable[[str], Path]) -> None:
    """A walk that stands there twice. Run by compiled code, others would have come as far as native code that happened
    to be ready took them."""
    tally: Counter[str] = Counter()
    walk(249942260, image_of, 40, tally)
    assert tally["met again"] > 20


@needs_copies
def test_an_editors_client_takes_the_whole_world_back(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, clustering_image: Path
) -> None:
    """The protocol's own test-support package; the record afterwards is that of a trial nobody debugged."""
    modules = node_modules(tmp_path_factory.mktemp("npm"))
    trial = ["clustering", "--minutes", "0.02", "--brain", str(clustering_image), "--seed", "3",
             "--set", "start.selector=8"]  # fmt: skip
    launcher, debugged = tmp_path / "launcher.py", tmp_path / "debugged"
    words = ["debug", *trial, "--robot", "2", "--out", str(debugged)]
    launcher.write_text(
        f"import sys\nfrom arena.cli import main\nif __name__ == '__main__':\n    sys.exit(main({words}))\n"
    )
    told = mocha(modules, Path(__file__).with_name("rewinding.js"), EMU_LAUNCHER=str(launcher))
    assert "1 passing" in told
    assert main(["run", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    assert trial_path(debugged, 1).read_bytes() == trial_path(tmp_path / "alone", 1).read_bytes()


@needs_copies
def test_without_its_moments_a_trial_begins_again(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """Not more are kept than so many; the same worlds from the seed when they are lost."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path, every_s=0.03) as (session, debugger):
        seen = {cycle: debugger.to(cycle) for cycle in (3_000_000, 6_000_000, 9_000_000)}
        assert session.checkpoint_count == checkpoints.KEPT
        assert debugger.to(6_000_000) == seen[6_000_000]
        assert not [text for kind, text in debugger.events if kind == "said" and "run again" in text]
        session._checkpoints.forget(-1)
        assert debugger.to(3_000_000) == seen[3_000_000]
        assert [text for kind, text in debugger.events if kind == "said" and "run again" in text]
        assert session.checkpoint_count > 0, "they are kept on the way"
        assert debugger.to(9_000_000) == seen[9_000_000]
        assert debugger.to(2_999_000) != debugger.to(3_000_001)


@needs_copies
def test_what_was_changed_is_changed_again_on_the_way_from_a_moment(
    tmp_path: Path, image_of: Callable[[str], Path]
) -> None:
    """Changes before and after a moment; of the past they are, when it is gone back behind, never made."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path, every_s=0.1) as (session, debugger):
        plain = debugger.to(4_000_000)
        debugger.to(1_000_000)
        assert debugger.told("T1CON.TCKPS = 2") == "2"
        assert debugger.to(4_000_000) != plain
        debugger.ask("writeMemory", memoryReference="0x1f00", data="AQI=")
        changed = debugger.to(8_000_000)
        debugger.to(5_000_000)
        assert debugger.told("*(unsigned *)0x1f00") == "513"
        assert debugger.to(8_000_000) == changed
        debugger.to(4_000_001)
        assert debugger.to(8_000_000) == changed
        debugger.to(3_999_999)
        assert debugger.to(8_000_000) != changed
        debugger.to(999_999)
        assert debugger.to(4_000_000) == plain
        assert session.checkpoint_count > 1


@needs_copies
def test_rows_of_a_trial_that_goes_back_are_written_once(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """Whoever follows the running trial reads what its file has at the moment."""
    plan = plan_of(FEW, 7, image_of)
    with session_of(plan, tmp_path, every_s=0.1) as (_, debugger):
        for cycle in (12_000_000, 5_000_000, 11_000_000, 2_000_000, 12_500_000):
            debugger.to(cycle)
            rows = [json.loads(line) for line in live_path(tmp_path, 1).read_text().splitlines()[1:]]
            assert rows
            assert all(one["t"] < other["t"] for one, other in pairwise(rows))


def test_the_end_is_met_again(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """With what the last sample did to the robot: it looked how far the motors had come."""
    with session_of(plan_of(FEW, 7, image_of), tmp_path) as (_, debugger):
        halt = debugger.resume("continue", threadId=1)
        assert halt["description"] == OVER
        end, cycle = debugger.told("/world"), debugger.cycle
        assert debugger.to(cycle) == end
        assert debugger.to(cycle - 500_000) != end
        assert debugger.resume("continue", threadId=1)["description"] == OVER
        assert debugger.told("/world") == end


def test_where_no_moments_are_kept_the_world_follows_who_looks(
    tmp_path: Path, image_of: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot goes back alone; the trial is run again when the world is looked at, or the past changed."""
    monkeypatch.setattr(server, "CAN_COPY", False)
    monkeypatch.setattr(debugsession, "context", partial(multiprocessing.get_context, "fork"))
    with session_of(plan_of(FEW, 7, image_of), tmp_path) as (session, debugger):
        first = debugger.to(3_000_000)
        assert debugger.told("T1CON.TCKPS = 2") == "2"
        second = debugger.to(5_000_000)
        for _ in range(2):
            debugger.resume("evaluate", expression="/goto 3000000", context="repl")
            assert "before the present" in debugger.told("/time")
            assert not [kind for kind, _ in debugger.events if kind == "invalidated"]
        assert debugger.told("/world") != first, "what was changed is"
        assert [kind for kind, _ in debugger.events if kind == "invalidated"]
        assert "before the present" not in debugger.told("/time")
        assert debugger.to(5_000_000) == second
        debugger.resume("evaluate", expression="/goto 2000000", context="repl")
        assert debugger.told("T1CON.TCKPS = 1") == "1"
        assert debugger.to(3_000_000) != first
        assert session.checkpoint_count == 0


@needs_copies
def test_it_can_be_told_to_stand_on_the_way_back(tmp_path: Path, image_of: Callable[[str], Path]) -> None:
    """Between the moment and the time wanted; from there it goes on as ever."""
    plan = plan_of(Swarm("clustering", 60.0, (), (), FEW.values), 7, image_of)
    with session_of(plan, tmp_path, every_s=1000.0) as (session, debugger):
        early = debugger.to(10_000_000)
        debugger.to(200_000_000)
        pause: Message = {"type": "request", "seq": 0, "command": "pause"}
        hear = session.receive

        def heard() -> tuple[Any, ...]:
            told = hear()
            if told[0] == "rewind":
                debugger.inbox.put(pause)
            return told

        session.receive = heard  # type: ignore[method-assign]
        halt = debugger.resume("evaluate", expression="/goto 199000000", context="repl")
        assert (halt["reason"], halt["description"]) == ("pause", "interrupted while rewinding")
        assert debugger.cycle < 199_000_000
        assert debugger.to(10_000_000) == early
