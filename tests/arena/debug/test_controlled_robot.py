"""Debugger on one robot of a trial: it runs forward and backward, and the record is unaffected."""

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
from tests.fuzz.seeds import base_seed
from toolchain.driver import driver

SEED = ("--seed", "3")


def execute(client: Client, request: str, **arguments: object) -> str:
    """Send a request that runs, steps or rewinds the machine, and return the time at which it pauses."""
    client.send(request, threadId=1, **arguments)
    client.event("stopped")
    return str(client.ask("evaluate", expression="/time", context="repl")["result"])


def world(client: Client) -> str:
    """Return the state of all robots and objects, including a hash of the whole state."""
    output = str(client.ask("evaluate", expression="/world", context="repl")["result"])
    assert output.splitlines()[-1].startswith("state: ")
    return output


@pytest.mark.slow
def test_a_record_is_the_same_with_a_debugger_on_a_robot(tmp_path: Path, clustering_image: Path) -> None:
    """The record is equal to the byte after steps, reverse steps, and breakpoints in both directions.

    A rewind restores the world and the other robots together with the debugged robot. The commit determines whether
    the robots use cameras or infrared sensors.
    """
    scene, brain, robot, place = (("clustering", "", 2, "react"), ("avoidance", "avoidance", 1, "steer"))[
        base_seed() % 2
    ]
    trial = [scene, "--minutes", "0.02", "--brain", brain or str(clustering_image), *SEED]
    trial += ["--set", "start.selector=8"] if scene == "clustering" else []  # starts without the remote control
    client = Client("arena", "debug", *trial, "--robot", str(robot), "--out", str(tmp_path / "debugged"))
    client.ask("initialize", adapterID="openswarm")
    client.ask("launch", stopOnEntry=True)
    client.ask("setFunctionBreakpoints", breakpoints=[{"name": place}])
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    first = execute(client, "continue")
    world_there = world(client)
    there = [execute(client, "next") for _ in range(3)]
    world_later = world(client)
    assert world_later != world_there
    assert execute(client, "stepBack", granularity="instruction") != there[-1]
    assert execute(client, "reverseContinue").startswith(first)
    assert world(client) == world_there
    assert "before the present" not in client.ask("evaluate", expression="/time", context="repl")["result"]
    assert [execute(client, "next") for _ in range(3)] == there
    assert world(client) == world_later
    refused = client.asked("evaluate", expression="W0 = 3", context="repl")
    assert "the trial is being recorded" in refused["message"]
    assert execute(client, "continue") != first
    client.ask("setFunctionBreakpoints", breakpoints=[])
    end = execute(client, "continue")
    world_end = world(client)
    assert execute(client, "stepBack", granularity="instruction") != end
    assert world(client) != world_end
    assert execute(client, "continue") == end
    assert world(client) == world_end
    client.close()
    assert main(["run", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
    assert records[0] == records[1]


def test_a_change_in_the_past_becomes_the_present(clustering_image: Path) -> None:
    """A step back repeats a change that was made before its target; `terminate` ends the trial."""
    client = Client("arena", "debug", "clustering", "--minutes", "9", "--brain", str(clustering_image), "--robot", "0")
    client.ask("initialize", adapterID="openswarm", supportsInvalidatedEvent=True)
    client.ask("launch", stopOnEntry=True)
    client.ask("configurationDone")
    assert client.event("stopped")["reason"] == "entry"
    for _ in range(3):
        execute(client, "stepIn", granularity="instruction")
    assert client.ask("evaluate", expression="T1CON.TCKPS = 2", context="repl")["result"] == "2"
    for _ in range(2):
        execute(client, "stepIn", granularity="instruction")
    as_changed = world(client)
    execute(client, "stepIn", granularity="instruction")
    execute(client, "stepBack", granularity="instruction")
    assert world(client) == as_changed, "the world goes back with the robot"
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


@pytest.mark.slow
def test_a_client_that_disconnects_and_a_second_client(
    tmp_path: Path, clustering_image: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Launch arguments of `emu debug` and a second client are refused; the trial continues after a disconnect."""
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
        assert "no record was written" in serving.stderr.read()

    assert main(["debug", *trial, "--minutes", "0.00001", "--robot", "1"]) == 0
    assert "robot 1 was not switched on before the end of the trial" in capfd.readouterr().err


def test_the_prompt_executes_a_script(
    tmp_path: Path, clustering_image: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After a script with `detach` the trial continues, otherwise it ends; a failed command sets the exit status."""
    trial = ["--minutes", "0.01", "--brain", str(clustering_image), *SEED, "--set", "start.selector=8"]
    command = ["debug", "clustering", *trial, "--robot", "2", "--tui"]

    def play(*lines: str, more: tuple[str, ...] = ()) -> int:
        monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
        return main([*command, *more])

    out = ("--out", str(tmp_path / "debugged"))
    session = ("break react", "continue", "next 2", "reverse-stepi", "info locals", "threads", "detach")
    assert play(*session, more=out) == 0
    output = capsys.readouterr().out
    assert "react at " in output
    assert "thread 0 (main): " in output
    assert "None" not in output
    assert main(["run", "clustering", *trial, "--trials", "1", "--jobs", "1", "--out", str(tmp_path / "alone")]) == 0
    records = [(tmp_path / name / "trial-0001.parquet").read_bytes() for name in ("debugged", "alone")]
    assert records[0] == records[1]
    assert play("stepi", "frob") == 2
    assert "line 2, frob: there is no command frob" in capsys.readouterr().err
    assert play(more=("--port", "0")) == 2


def test_a_rewind_from_a_fault_and_from_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A rewind from a fault, and one from the end of the trial, restore the same world."""
    source, image = tmp_path / "bad.c", tmp_path / "bad.elf"
    source.write_text("volatile int n;\nint main(void)\n{\n    n = 0x3001;\n    return *(volatile int *)n;\n}\n")
    assert driver.main(["-g", "-O0", str(source), "-o", str(image)]) == 0
    back = ("reverse-continue", "world")
    lines = ("break bad.c:4", "continue", "world", "continue", *back, "continue", "continue", *back, "detach")
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines)))
    words = ["--set", "robots.count=2", "--set", "objects.count=1", "--minutes", "0.005", "--brain", str(image)]
    assert main(["debug", "clustering", "--robot", "1", "--tui", *words]) == 0
    output = capsys.readouterr().out
    assert output.count("firmware fault: address error trap") == 2
    assert "the trial is over" in output
    worlds = [part.partition("state: ")[2][:64] for part in output.split("world: t = ")[1:]]
    assert len(worlds) == 3
    assert len(set(worlds)) == 1


def test_an_unknown_robot_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["debug", "clustering", "--brain", "scripted", "--robot", "7"]) == 2
    assert "robots 0 to 4" in capsys.readouterr().err
    assert main(["debug", "clustering", "--brain", "scripted", "--robot", "1", "--minutes", "0.01"]) == 2
    assert "no firmware" in capsys.readouterr().err


@pytest.mark.slow
def test_logged_inputs_reproduce_the_past_to_the_bit(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Logged inputs reproduce a robot's past to the bit: levels of the infrared sensors and the stored light."""
    image = built_once(tmp_path_factory, "avoidance")
    plan = Plan(load_scene("avoidance"), "avoidance", "A", None, 1, 1.0, 3, None, (("avoidance", image),))
    rng, is_equal = random.Random(4), []

    def debugger(controlled: ControlledRobot) -> bool:
        history = controlled.record(controlled.machine)
        states = {}
        for _ in range(40):
            history.advance(controlled.machine.cycle + rng.randrange(400_000))
            states[controlled.machine.cycle] = controlled.machine.snapshot()
        end = history.end
        for cycle in rng.sample(sorted(states), 20):
            history.seek(cycle)
            is_equal.append(controlled.machine.snapshot() == states[cycle])
        history.seek(end)
        is_equal.append(controlled.machine.snapshot() == states[end])
        return True

    robot = ControlledRobot(1, debugger, is_recorded=True)
    run_one(plan, 1, tmp_path, on_start=robot.attach)
    assert robot.finish()
    assert len(is_equal) == 21
    assert all(is_equal)
