"""A debugger on one robot of a trial: it goes on, back and on again, and nothing of it can be seen in the record."""

from __future__ import annotations

import io
import random
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from arena.campaign.campaign import Plan, run_one
from arena.cli import main
from arena.debug.controlled_robot import ControlledRobot
from arena.scene.loader import load_scene
from tests.emu.dap.client import PATIENCE, ROOT, Client
from tests.firmware.conftest import built_once
from toolchain.driver import driver

SEED = ("--seed", "3")


def moved(client: Client, request: str, **arguments: object) -> str:
    """Let it go somewhere; the time it stands at."""
    client.send(request, threadId=1, **arguments)
    client.event("stopped")
    return str(client.ask("evaluate", expression="/time", context="repl")["result"])


def world(client: Client) -> str:
    """What there is to see of all robots at this time, with a hash of everything that lives."""
    told = str(client.ask("evaluate", expression="/world", context="repl")["result"])
    assert told.splitlines()[-1].startswith("state: ")
    return told


@pytest.mark.parametrize(
    ("scene", "brain", "robot", "place"),
    [("clustering", "", 2, "react"), ("avoidance", "avoidance", 1, "steer")],
    ids=["camera", "infrared"],
)
def test_a_record_is_the_same_with_a_debugger_on_a_robot(
    tmp_path: Path, clustering_image: Path, scene: str, brain: str, robot: int, place: str
) -> None:
    """Byte for byte, after steps, steps back, breakpoints both ways and a look at the end. Wherever it goes back to,
    the world and the other robots are as they were then."""
    trial = [scene, "--minutes", "0.02", "--brain", brain or str(clustering_image), *SEED]
    trial += ["--set", "start.selector=8"] if scene == "clustering" else []  # it does not wait for the remote control
    client = Client("arena", "debug", *trial, "--robot", str(robot), "--out", str(tmp_path / "debugged"))
    client.ask("initialize", adapterID="openswarm")
    client.ask("launch", stopOnEntry=True)
    client.ask("setFunctionBreakpoints", breakpoints=[{"name": place}])
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    first = moved(client, "continue")
    world_there = world(client)
    there = [moved(client, "next") for _ in range(3)]
    world_later = world(client)
    assert world_later != world_there
    assert moved(client, "stepBack", granularity="instruction") != there[-1]
    assert moved(client, "reverseContinue").startswith(first)
    assert world(client) == world_there
    assert "before the present" not in client.ask("evaluate", expression="/time", context="repl")["result"]
    assert [moved(client, "next") for _ in range(3)] == there
    assert world(client) == world_later
    refused = client.asked("evaluate", expression="W0 = 3", context="repl")
    assert "the trial is being recorded" in refused["message"]
    assert moved(client, "continue") != first
    client.ask("setFunctionBreakpoints", breakpoints=[])
    end = moved(client, "continue")
    world_end = world(client)
    assert moved(client, "stepBack", granularity="instruction") != end
    assert world(client) != world_end
    assert moved(client, "continue") == end
    assert world(client) == world_end
    client.close()
    assert main(["run", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
    assert records[0] == records[1]


def test_a_change_in_the_past_is_one_of_the_present_and_who_leaves_ends_the_trial(clustering_image: Path) -> None:
    """What was changed before is changed again on the way."""
    client = Client("arena", "debug", "clustering", "--minutes", "9", "--brain", str(clustering_image), "--robot", "0")
    client.ask("initialize", adapterID="openswarm", supportsInvalidatedEvent=True)
    client.ask("launch", stopOnEntry=True)
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    for _ in range(3):
        moved(client, "stepIn", granularity="instruction")
    assert client.ask("evaluate", expression="T1CON.TCKPS = 2", context="repl")["result"] == "2"
    for _ in range(2):
        moved(client, "stepIn", granularity="instruction")
    as_changed = world(client)
    moved(client, "stepIn", granularity="instruction")
    moved(client, "stepBack", granularity="instruction")
    assert world(client) == as_changed, "the world has gone back with the robot"
    scopes = client.ask("scopes", frameId=client.top()["id"])["scopes"]
    lists = {one["name"]: one["variablesReference"] for one in scopes}
    shown = client.ask("variables", variablesReference=lists["World"])["variables"]
    assert "\n".join(f"{one['name']}: {one['value']}" for one in shown) == as_changed
    w0 = client.ask("setVariable", variablesReference=lists["Registers"], name="W0", value="7")
    assert w0["value"] == client.evaluate("W0") == "7"
    assert client.evaluate("T1CON.TCKPS") == "2"
    assert world(client) != as_changed
    client.ask("terminate")
    client.close()


def test_a_client_that_leaves_in_the_middle_and_a_second_one(
    tmp_path: Path, clustering_image: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What is not a trial's is refused; who comes second too; a trial that is left while it runs goes to its end."""
    trial = ["clustering", "--minutes", "0.005", "--brain", str(clustering_image), *SEED, "--set", "start.selector=8"]
    client = Client("arena", "debug", *trial, "--robot", "1", "--out", str(tmp_path / "debugged"))
    client.ask("initialize", adapterID="openswarm")
    for name, value in (("selector", 3), ("strict", True), ("board", "epuck")):
        assert f"`{name}` is for a robot alone" in client.asked("launch", **{name: value})["message"]
    client.ask("launch", stopOnEntry=False)
    client.ask("setFunctionBreakpoints", breakpoints=[{"name": "nowhere"}])
    client.ask("configurationDone")
    client.close()
    assert main(["run", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
    assert records[0] == records[1]

    words = [sys.executable, "-m", "arena", "debug", *trial, "--robot", "1", "--port", "0"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, cwd=ROOT) as serving:
        assert serving.stderr is not None
        port = int(serving.stderr.readline().rpartition(":")[2])
        request = b'{"seq": 1, "type": "request", "command": "initialize"}'
        with socket.create_connection(("127.0.0.1", port)) as first:
            first.sendall(b"Content-Length: %d\r\n\r\n%s" % (len(request), request))
            assert first.recv(1)
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(("127.0.0.1", port))
        assert serving.wait(timeout=PATIENCE) == 0
        assert "nothing is recorded" in serving.stderr.read()

    assert main(["debug", *trial, "--minutes", "0.00001", "--robot", "1"]) == 0
    assert "robot 1 got no power before the trial was over" in capfd.readouterr().err


def test_at_a_prompt_by_a_script(
    tmp_path: Path, clustering_image: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The trial goes on without it when it is detached, ends when it is not; a command that fails is the status."""
    trial = ["--minutes", "0.01", "--brain", str(clustering_image), *SEED, "--set", "start.selector=8"]
    command = ["debug", "clustering", *trial, "--robot", "2", "--tui"]

    def played(*lines: str, more: tuple[str, ...] = ()) -> int:
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
        return main([*command, *more])

    out = ("--out", str(tmp_path / "debugged"))
    session = ("break react", "continue", "next 2", "reverse-stepi", "info locals", "threads", "detach")
    assert played(*session, more=out) == 0
    told = capsys.readouterr().out
    assert "react at " in told
    assert "thread 0 (main): " in told
    assert "None" not in told
    assert main(["run", "clustering", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
    assert records[0] == records[1]
    assert played("stepi", "frob") == 2
    assert "line 2, frob: there is no command frob" in capsys.readouterr().err
    assert played(more=("--port", "0")) == 2


def test_a_robot_that_ends_can_be_gone_back_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before its fault, at it, and when the trial is over: the way back leads to the same world."""
    source, image = tmp_path / "bad.c", tmp_path / "bad.elf"
    source.write_text("volatile int n;\nint main(void)\n{\n    n = 0x3001;\n    return *(volatile int *)n;\n}\n")
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    back = ("reverse-continue", "world")
    lines = ("break bad.c:4", "continue", "world", "continue", *back, "continue", "continue", *back, "detach")
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
    words = ["--set", "robots.count=2", "--set", "objects.count=1", "--minutes", "0.005", "--brain", str(image)]
    assert main(["debug", "clustering", "--robot", "1", "--tui", *words]) == 0
    told = capsys.readouterr().out
    assert told.count("firmware fault: address error trap") == 2
    assert "the trial is over" in told
    worlds = [part.partition("state: ")[2][:64] for part in told.split("world: t = ")[1:]]
    assert len(worlds) == 3
    assert len(set(worlds)) == 1


def test_a_robot_that_is_not_there_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["debug", "clustering", "--brain", "scripted", "--robot", "7"]) == 2
    assert "robots 0 to 4" in capsys.readouterr().err
    assert main(["debug", "clustering", "--brain", "scripted", "--robot", "1", "--minutes", "0.01"]) == 2
    assert "no firmware" in capsys.readouterr().err


def test_what_a_robot_was_shown_makes_its_past_the_same_to_the_bit(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Of the light at its infrared sensors, with what the board keeps of it, while the world stands still."""
    image = built_once(tmp_path_factory, "avoidance")
    plan = Plan(load_scene("avoidance"), "avoidance", "A", None, 1, 1.0, 3, None, (("avoidance", image),))
    rng, met = random.Random(4), []

    def debugger(debugged: ControlledRobot) -> bool:
        history = debugged.record(debugged.machine)
        states = {}
        for _ in range(40):
            history.advance(debugged.machine.cycle + rng.randrange(400_000))
            states[debugged.machine.cycle] = debugged.machine.snapshot()
        end = history.end
        for cycle in rng.sample(sorted(states), 20):
            history.seek(cycle)
            met.append(debugged.machine.snapshot() == states[cycle])
        history.seek(end)
        met.append(debugged.machine.snapshot() == states[end])
        return True

    robot = ControlledRobot(1, debugger, is_recorded=True)
    run_one(plan, 1, tmp_path, on_start=robot.attach)
    assert robot.finish()
    assert len(met) == 21
    assert all(met)
