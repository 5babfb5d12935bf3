"""Debugger attached to a robot of a studio trial: debugging starts at the current time, and the studio stays
responsive."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any

import pytest

from arena.campaign.campaign import Plan, controllers_of
from arena.studio.errors import CommandRefusedError
from arena.studio.process import Studio
from arena.trial.trial import run_trial
from tests.arena.browser import needs_browser
from tests.arena.studio.test_studio import do, run_probe, scene_of, scripted_plan, serving, studio_of, wait_for_state
from tests.emu.dap.client import Client

SECONDS = 2.0


class Connected(Client):
    """Client of the Debug Adapter Protocol on a TCP port."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        streams = {"stdin": self.socket.makefile("wb"), "stdout": self.socket.makefile("rb")}
        self.process: Any = SimpleNamespace(**streams)
        self.inbox: Queue[dict[str, Any]] = Queue()
        self.events: list[dict[str, Any]] = []
        self.seq = 0
        threading.Thread(target=self._listen, daemon=True).start()


def attached_client(studio: Studio, robot: int) -> Connected:
    """Attach a debugger to a robot and return its client; the robot is paused."""
    studio.ask("debug", robot)
    client = Connected(studio.ask("status")["debugger"]["port"])
    client.ask("initialize", adapterID="openswarm")
    client.ask("attach", stopOnEntry=True)
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    return client


def test_a_robot_can_be_debugged_from_the_present_on(clustering_image: Path) -> None:
    """A robot can be debugged from the current time on: breakpoints and reverse steps work, invalid commands are
    refused, and the record is unaffected."""
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with controllers_of(plan, 3) as (controllers, channel):
        whole = run_trial(plan.scene, 3, controllers, SECONDS, channel=channel, experiment=plan.loaded_experiment)
    with studio_of(plan) as studio:
        do(studio, "step", 1100)
        client = attached_client(studio, 1)
        now = studio.ask("status")
        assert (now["tick"], now["state"]) == (1100, "in a debugger")
        assert (now["debugger"]["robot"], now["debugger"]["is_connected"]) == (1, True)
        for act in (("run",), ("pause",), ("step",), ("rewind", 0)):
            with pytest.raises(CommandRefusedError, match="robot 1 is in a debugger; detach the debugger first"):
                studio.ask(*act)
        assert studio.ask("inspect", 1)["pc"] == int(client.top()["instructionPointerReference"], 16)
        client.ask("setFunctionBreakpoints", breakpoints=[{"name": "Sys_Send_Event"}])
        client.send("continue", threadId=1)
        assert client.event("stopped")["reason"] == "breakpoint"
        assert client.top()["name"].startswith("Sys_Send_Event")
        assert studio.ask("status")["tick"] >= 1100
        client.send("stepBack", threadId=1, granularity="instruction")
        client.event("stopped")
        refused = client.asked("evaluate", expression="W0 = 1", context="repl")
        assert not refused["success"]
        assert "the other robots have seen what came of it" in refused["message"]
        client.ask("disconnect")
        assert wait_for_state(studio)["debugger"] is None
        studio.ask("run", 1000.0)
        wait_for_state(studio, "over")
        assert studio.ask("trial").columns == whole.rows.columns
        with pytest.raises(CommandRefusedError, match="the trial is over"):
            studio.ask("debug", 0)


def test_the_debugger_is_detached_with_and_without_a_client(clustering_image: Path) -> None:
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with studio_of(plan) as studio:
        do(studio, "step", 200)
        studio.ask("debug", 0)
        assert studio.ask("status")["debugger"]["is_connected"] is False
        assert do(studio, "debug", 0)["debugger"] is None
        attached_client(studio, 1)
        assert do(studio, "debug", 1)["debugger"] is None
        attached_client(studio, 0)  # the studio is closed while this client is attached


def test_a_scripted_robot_cannot_be_debugged() -> None:
    with studio_of(scripted_plan()) as studio, pytest.raises(CommandRefusedError, match="robot 0 is scripted"):
        studio.ask("debug", 0)


PROBE = """<pre id="result"></pre><script>
const found = {}, rest = ms => new Promise(done => setTimeout(done, ms));
const until = async seen => { while (!seen()) { await ask("inspect?robot=0"); await rest(10); } };
const word = id => el(id).textContent;
(async () => {
  found.button = word("debug");
  el("debug").click(); await until(() => word("error")); found.none = word("error");
  choose(1); el("debug").click(); await until(() => d.studio.now.debugger);
  found.waits = word("status"); found.port = d.studio.now.debugger.port; found.back = word("debug");
  await until(() => d.studio.now.debugger.is_connected && word("inspector").includes("Sys_Send_Event"));
  found.has = word("status"); found.inside = word("inspector");
  el("step").click(); await until(() => word("error")); found.refused = word("error");
  el("debug").click(); await until(() => !d.studio.now.debugger); found.given = word("status");
  found.tick = d.studio.now.tick; found.again = word("debug");
  el("step").click(); await until(() => d.studio.now.tick > found.tick); found.stepped = d.studio.now.tick;
  document.getElementById("result").textContent = JSON.stringify(found);
  window.setTimeout = () => 0;           // ends the virtual time of the browser
})().catch(error => { document.getElementById("result").textContent = JSON.stringify({error: error.stack}); });
</script></html>"""


@needs_browser
def test_the_page_attaches_and_detaches_a_debugger(
    clustering_image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page attaches a debugger, shows its port and the paused robot, and detaches it again."""
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with serving(plan) as one:
        studio = one.studio
        do(studio, "step", 1100)

        def debugs() -> None:
            while (attached := studio.ask("status")["debugger"]) is None:
                time.sleep(0.05)
            client = Connected(attached["port"])
            client.ask("initialize", adapterID="openswarm")
            client.ask("attach", stopOnEntry=False)
            client.ask("setFunctionBreakpoints", breakpoints=[{"name": "Sys_Send_Event"}])
            client.ask("configurationDone")

        threading.Thread(target=debugs, daemon=True).start()
        found = run_probe(one, PROBE, tmp_path, monkeypatch)
    assert (found["button"], found["none"]) == ("Attach debugger", "select a robot first")
    assert found["back"] == "Detach debugger"
    assert found["waits"].endswith(f"waits for a client of the Debug Adapter Protocol on 127.0.0.1:{found['port']}")
    assert found["has"].startswith("in a debugger, quantum 1")
    assert "robot 1 has a client" in found["has"]
    assert "Sys_Send_Event" in found["inside"].splitlines()[0]
    assert found["refused"] == "robot 1 is in a debugger; detach the debugger first"
    assert found["given"].startswith("paused, quantum")
    assert (found["again"], found["stepped"]) == ("Attach debugger", found["tick"] + 1)
