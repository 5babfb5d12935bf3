"""A robot of the studio in a debugger's hands: it begins at the present moment, the world stands, the page lives on."""

from __future__ import annotations

import socket
import threading
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any

import pytest

from arena.campaign import Plan, brains_of
from arena.studio import RefusedError, Studio
from arena.trial import run_trial
from tests.arena.test_studio import do, scene_of, scripted_plan, settled, studio_of
from tests.emu.dap.client import Client

SECONDS = 2.0


class Connected(Client):
    """The client on a TCP port."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        streams = {"stdin": self.socket.makefile("wb"), "stdout": self.socket.makefile("rb")}
        self.process: Any = SimpleNamespace(**streams)
        self.inbox: Queue[dict[str, Any]] = Queue()
        self.events: list[dict[str, Any]] = []
        self.seq = 0
        threading.Thread(target=self._listen, daemon=True).start()


def given(studio: Studio, robot: int) -> Connected:
    """A client that has a robot, which stands."""
    studio.ask(lambda: studio.debug(robot))
    client = Connected(studio.ask(studio.now)["debugger"]["port"])
    client.ask("initialize", adapterID="openswarm")
    client.ask("attach", stopOnEntry=True)
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    return client


def test_a_robot_is_debugged_from_the_present_on(clustering_image: Path) -> None:
    """Breakpoint, a step back, what is refused meanwhile; left alone, the trial is recorded as ever."""
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with brains_of(plan, 3, 1) as (brains, _, ether):
        whole = run_trial(plan.scene, 3, brains, SECONDS, ether=ether, experiment=plan.to_do)
    with studio_of(plan) as studio:
        do(studio, lambda: studio.step(1100))
        client = given(studio, 1)
        now = studio.ask(studio.now)
        assert (now["tick"], now["state"]) == (1100, "in a debugger")
        assert (now["debugger"]["robot"], now["debugger"]["is_met"]) == (1, True)
        for act in (studio.go, studio.stand, studio.step, lambda: studio.back(0)):
            with pytest.raises(RefusedError, match="a debugger has robot 1; let it leave first"):
                studio.ask(act)
        assert studio.ask(lambda: studio.inside(1))["pc"] == int(client.top()["instructionPointerReference"], 16)
        client.ask("setFunctionBreakpoints", breakpoints=[{"name": "Sys_Send_Event"}])
        client.send("continue", threadId=1)
        assert client.event("stopped")["reason"] == "breakpoint"
        assert client.top()["name"].startswith("Sys_Send_Event")
        assert studio.ask(studio.now)["tick"] >= 1100
        client.send("stepBack", threadId=1, granularity="instruction")
        client.event("stopped")
        refused = client.asked("evaluate", expression="W0 = 1", context="repl")
        assert not refused["success"]
        assert "the other robots have seen what came of it" in refused["message"]
        client.ask("disconnect")
        assert settled(studio)["debugger"] is None
        studio.ask(lambda: studio.go(1000.0))
        settled(studio, "over")
        assert studio.ask(studio.trial).columns == whole.rows.columns
        with pytest.raises(RefusedError, match="the trial is over"):
            studio.ask(lambda: studio.debug(0))


def test_a_robot_is_taken_back_whether_a_client_came_or_not(clustering_image: Path) -> None:
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with studio_of(plan) as studio:
        do(studio, lambda: studio.step(200))
        studio.ask(lambda: studio.debug(0))
        assert studio.ask(studio.now)["debugger"]["is_met"] is False
        assert do(studio, lambda: studio.debug(0))["debugger"] is None
        given(studio, 1)
        assert do(studio, lambda: studio.debug(1))["debugger"] is None
        given(studio, 0)  # and the studio is closed while a client has a robot


def test_a_script_is_not_debugged() -> None:
    with studio_of(scripted_plan()) as studio, pytest.raises(RefusedError, match="robot 0 is a script"):
        studio.ask(lambda: studio.debug(0))
