"""Studio: an interactive trial with exact steps and rewinds, the HTTP server, and the page."""

from __future__ import annotations

import html
import io
import json
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from arena.campaign.campaign import Plan, controllers_of
from arena.cli import main
from arena.commands import studio as command
from arena.commands.studio import HEADER, StudioServer, server
from arena.robots.controller import ScriptedController
from arena.scene.loader import Scene, load_scene, scripted
from arena.studio.errors import CommandRefusedError
from arena.studio.process import Call, Studio
from arena.studio.startup import STAGES, Startup
from arena.trial import checkpoints
from arena.trial.trial import run_trial
from tests.arena.browser import BROWSER, needs_browser, probed
from tests.arena.conftest import needs_fork
from tests.arena.robot_programs import ECHO
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
SECONDS = 6.0


def scene_of(robots: int, objects: int) -> Scene:
    return load_scene("clustering").with_values(robots__count=robots, objects__count=objects)


def scripted_plan() -> Plan:
    return Plan(scripted(scene_of(2, 4)), "scripted", "A", None, 1, SECONDS, 3)


@contextmanager
def studio_of(plan: Plan) -> Iterator[Studio]:
    made = Studio(plan, plan.seed)
    try:
        yield made
    finally:
        made.close()


def wait_for_state(studio: Studio, state: str = "paused") -> dict[str, Any]:
    """Wait until the trial is in `state` or over, and return its status."""
    end = time.monotonic() + HANG
    while (now := studio.ask("status"))["state"] not in (state, "over"):
        assert time.monotonic() < end, f"still {now['state']}, not {state}"
        time.sleep(0.05)
    return now


def do(studio: Studio, name: str, *arguments: Any) -> dict[str, Any]:
    studio.ask(name, *arguments)
    return wait_for_state(studio)


def test_a_stepped_trial_has_the_rows_of_run_trial() -> None:
    """The rows of a stepped trial equal those of `run_trial`."""
    plan = scripted_plan()
    whole = run_trial(plan.scene, 3, [ScriptedController(plan.scene, 3, robot, "A") for robot in range(2)], SECONDS,
                      experiment=plan.loaded_experiment)  # fmt: skip
    with studio_of(plan) as studio:
        for quanta in (1, 7, 100, 33):
            do(studio, "step", quanta)
        studio.ask("run", 1000.0)
        assert wait_for_state(studio, "over")["state"] == "over"
        assert studio.ask("trial").columns == whole.rows.columns


def test_a_rewind_restores_the_state_to_the_byte(clustering_image: Path) -> None:
    """A rewind restores bodies, speeds and machines, by hash, for two robots with firmware and a moved object."""
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with studio_of(plan) as studio:
        do(studio, "step", 1300)
        studio.ask("move", "object", 1, 100.0, 120.0)
        here = do(studio, "step", 301)
        first, rows = studio.ask("digest"), studio.ask("trial").columns
        for _ in range(3):
            do(studio, "step", 1)
        studio.ask("move", "robot", 0, 50.0, 50.0)
        assert do(studio, "step", 1)["tick"] == here["tick"] + 4
        assert studio.ask("digest") != first
        again = do(studio, "rewind", here["tick"])
        assert (again["tick"], again["epoch"]) == (here["tick"], here["epoch"] + 1)
        assert studio.ask("digest") == first
        assert studio.ask("trial").columns == rows
        assert studio.ask("more", 2, here["epoch"])["from"] == 0, "all samples, because the epoch is another one"


def during_rewind(studio: Studio, goal: int, name: str, *arguments: Any) -> None:
    """Start a rewind to `goal`, and execute a command before the rewind has replayed an action."""
    studio.ask_all(Call("rewind", (goal,)), Call(name, arguments))


def test_commands_during_a_rewind_discard_later_actions() -> None:
    """Two objects are moved at quanta 20 and 300. A pause of a rewind at quantum 0 discards both actions."""
    plan = scripted_plan()
    with studio_of(plan) as untouched:
        do(untouched, "step", 1)
        first = untouched.ask("digest")
        do(untouched, "step", 399)
        last = untouched.ask("digest")

    def moved(studio: Studio) -> None:
        do(studio, "step", 20)
        studio.ask("move", "object", 1, 100.0, 120.0)
        do(studio, "step", 280)
        studio.ask("move", "object", 2, 200.0, 120.0)
        do(studio, "step", 110)

    with studio_of(plan) as studio:
        moved(studio)
        with pytest.raises(CommandRefusedError, match="rewinding; pause it first"):
            during_rewind(studio, 400, "move", "object", 0, 50.0, 50.0)
        wait_for_state(studio)
        during_rewind(studio, 390, "pause")
        do(studio, "step", 400)
        assert studio.ask("digest") == last
    with studio_of(plan) as studio:
        moved(studio)
        during_rewind(studio, 400, "step", 1)
        assert wait_for_state(studio)["tick"] == 1
        assert studio.ask("digest") == first
        do(studio, "step", 399)
        assert studio.ask("digest") == last
    with studio_of(plan) as studio:
        moved(studio)
        during_rewind(studio, 400, "rewind", 10)
        assert wait_for_state(studio)["tick"] == 10
        do(studio, "step", 390)
        assert studio.ask("digest") == last, "later actions are discarded"


@needs_fork
def test_a_checkpoint_restores_the_state_to_the_byte(clustering_image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a checkpoint is restored, the trial continues as in the first pass, with an object moved after each
    checkpoint.

    A rewind discards later checkpoints and actions, and keeps breakpoints. All processes end with the studio.
    """
    closed, close = [], checkpoints.PipeEnd.close
    monkeypatch.setattr(checkpoints.PipeEnd, "close", lambda end: closed.append(close(end)))
    monkeypatch.setattr(checkpoints, "EVERY_S", 1e9)
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with studio_of(plan) as studio:
        seen = {}
        for quanta in (900, 100, 100, 100):
            tick = do(studio, "step", quanta)["tick"]
            with monkeypatch.context() as now:
                now.setattr(checkpoints, "EVERY_S", 0.0)
                studio.ask("status")
            studio.ask("move", "object", 1, 100.0 + tick / 50, 120.0)
            seen[tick] = studio.ask("digest"), studio.ask("trial").columns
        do(studio, "step", 10)
        studio.ask("toggle_breakpoint", 1, "main")
        for tick, kept in ((1200, 4), (1150, 3), (1000, 2), (1000, 2)):
            begun = studio.ask("status")
            now = do(studio, "rewind", tick)
            assert (now["tick"], studio.checkpoint_count, now["breakpoints"]) == (tick, kept, ["1 main"])
            assert now["epoch"] == begun["epoch"] + (tick < begun["tick"])
            if tick in seen:
                assert (studio.ask("digest"), studio.ask("trial").columns) == seen[tick]
        do(studio, "step", 100)
        assert studio.ask("digest") != seen[1100][0], "later actions are discarded"
        studio.ask("toggle_breakpoint", 1, "Sys_Send_Event")
        assert do(studio, "rewind", 900)["breakpoints"] == ["1 main", "1 Sys_Send_Event"]
        assert studio.ask("digest") == seen[900][0]
        studio.ask("run", 1000.0)
        assert wait_for_state(studio, "at a breakpoint")["hit"] == "robot 1 is at Sys_Send_Event"
    assert len(closed) == 9
    assert all(closed), "four checkpoints, four abandoned processes, and the last one"


def test_older_checkpoints_have_larger_distances() -> None:
    """The pool of checkpoints has a limit; older checkpoints are farther apart, and evicted ones are closed."""
    pool, ends = checkpoints.CheckpointPool(), []
    for ten in range(1, 61):
        assert pool.is_due(10.0 * ten)
        assert not pool.is_due(10.0 * ten - 1)
        here, there = checkpoints.pipe()
        there.drop()
        ends.append(here)
        pool.add(checkpoints.Checkpoint(ten * 1000, 10.0 * ten, here))
    assert len(pool) == checkpoints.MAX_CHECKPOINTS
    assert sum(end.fileno() >= 0 for end in ends) == checkpoints.MAX_CHECKPOINTS
    found = [pool.latest_before(tick) for tick in range(0, 60001, 500)]
    times = [checkpoint.seconds for checkpoint in found if checkpoint is not None]
    ages = sorted({600.0 - one for one in times})
    assert ages[:3] == [0.0, 10.0, 20.0]
    assert all(far - near <= max(far * 0.6, 10.0) for near, far in pairwise(ages)), ages


def test_a_breakpoint_pauses_the_whole_world(clustering_image: Path) -> None:
    """A breakpoint of one robot pauses the whole world, which can then be inspected; the record is unaffected."""
    plan = Plan(scene_of(2, 4), "openswarm", "A", clustering_image, 1, SECONDS, 3)
    with controllers_of(plan, 3) as (controllers, channel):
        whole = run_trial(plan.scene, 3, controllers, SECONDS, channel=channel, experiment=plan.loaded_experiment)
    with studio_of(plan) as studio:
        do(studio, "step", 1100)
        studio.ask("toggle_breakpoint", 1, "Sys_Send_Event")
        with pytest.raises(CommandRefusedError, match="robot 0"):
            studio.ask("toggle_breakpoint", 0, "no_such_function")
        studio.ask("run", 1000.0)
        now = wait_for_state(studio, "at a breakpoint")
        assert now["hit"] == "robot 1 is at Sys_Send_Event"
        inside = studio.ask("inspect", 1)
        assert inside["place"] == "_Sys_Send_Event"
        assert any("Sys_Send_Event" in frame for frame in inside["frames"])
        assert len(inside["w"]) == 16
        with pytest.raises(CommandRefusedError, match="run the trial first"):
            studio.ask("move", "object", 0, 50.0, 50.0)
        time.sleep(0.2)
        assert studio.ask("status")["tick"] == now["tick"]
        studio.ask("toggle_breakpoint", 1, "Sys_Send_Event")
        studio.ask("run", 1000.0)
        wait_for_state(studio, "over")
        assert studio.ask("trial").columns == whole.rows.columns


def test_bluetooth_text_arrives(assembled: Callable[[str], Path]) -> None:
    """Text sent by Bluetooth arrives at a robot that echoes it."""
    plan = Plan(scene_of(1, 0), "echo", "A", assembled(ECHO), 1, SECONDS, 1)
    with studio_of(plan) as studio:
        do(studio, "step", 100)
        studio.ask("send", 0, "hello\r")
        with pytest.raises(CommandRefusedError, match="Latin-1"):
            studio.ask("send", 0, "\u20ac")
        do(studio, "step", 500)
        assert [line["text"] for row in studio.ask("trial").columns["log"] for line in row] == ["hello"]


def test_a_trial_can_be_rewound_after_its_supervisor_fails(tmp_path: Path) -> None:
    """After its supervisor has failed, which is reported, the trial can be inspected and rewound but not run."""
    own = tmp_path / "own.py"
    own.write_text(FAILING)
    plan = Plan(scripted(scene_of(2, 4)), "scripted", "A", None, 1, SECONDS, 3, own)
    with studio_of(plan) as studio:
        studio.ask("run", 1000.0)
        while (now := studio.ask("status"))["state"] == "running":
            time.sleep(0.05)
        assert now["state"].startswith("failed: ")
        assert "ouch" in now["state"]
        assert now["t"] == pytest.approx(1.1, abs=0.02)
        with pytest.raises(CommandRefusedError, match="rewind first"):
            studio.ask("step", 1)
        assert do(studio, "rewind", 50)["tick"] == 50


FAILING = """
from arena.experiments import Curve

CURVES = [Curve("t", "time")]


def metrics(sample):
    return {"t": 1.0}


def step(world):
    if world.seconds > 1:
        raise ValueError("ouch")
"""


# -- the server ------------------------------------------------------------------------------------------------------


@contextmanager
def serving(plan: Plan | None = None) -> Iterator[StudioServer]:
    with studio_of(plan or scripted_plan()) as studio, server(studio, 0) as one:
        threading.Thread(target=one.serve_forever, daemon=True).start()
        yield one
        one.shutdown()


def asked(one: StudioServer, path: str, body: bytes | None = None, **headers: str) -> tuple[int, str]:
    given = {HEADER: one.token} | {name.replace("_", "-"): value for name, value in headers.items()}
    request = urllib.request.Request(f"http://{one.hosts[0]}{path}", body, given)
    try:
        with urllib.request.urlopen(request, timeout=HANG) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_unauthorised_requests_are_refused() -> None:
    """Requests with another origin, another host name or without the token get status 403 and have no effect."""
    step = json.dumps({"do": "step", "quanta": 5}).encode()
    with serving() as one:
        assert asked(one, "/", **{HEADER: ""})[0] == 403
        assert asked(one, f"/?token={one.token}", **{HEADER: ""})[0] == 200
        assert asked(one, f"/more?from=0&epoch=1&token={one.token}", **{HEADER: ""})[0] == 403
        for foreign in ({HEADER: ""}, {HEADER: one.token[:-1]}, {"Origin": "http://example.org"}, {"Origin": "null"},
                        {"Host": f"example.org:{one.server_port}"}):  # fmt: skip
            status, text = asked(one, "/do", step, **foreign)
            assert status == 403, foreign
            assert text.endswith("use the address that `arena studio` printed")
        assert json.loads(asked(one, "/more?from=0&epoch=1")[1])["now"]["tick"] == 0
        status, text = asked(one, "/do", step, Origin=f"http://{one.hosts[1]}")
        assert (status, json.loads(text)["state"]) == (200, "running")


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"{", "not valid JSON"), (b"[" * 5000, "not valid JSON"), (b"[]", "expected an object"),
        (b'{"do": "__init__"}', "expected an object"), (b'{"do": "run"}', "run: expected pace"),
        (b'{"do": "run", "pace": 0}', "expected a positive number"), (b'{"do": "run", "pace": NaN}', "pace is nan"),
        (b'{"do": "step", "quanta": true}', "quanta is True"), (b'{"do": "step", "quanta": 1.5}', "quanta is 1.5"),
        (b'{"do": "rewind", "tick": -1}', "quantum -1"), (b'{"do": "rewind", "tick": 1e400}', "tick is inf"),
        (b'{"do": "move", "kind": "wall", "number": 0, "x": 1, "y": 1}', "cannot be moved"),
        (b'{"do": "move", "kind": "robot", "number": 9, "x": 1, "y": 1}', "there is no robot 9"),
        (b'{"do": "move", "kind": "robot", "number": 0, "x": 1e9, "y": 1}', "outside the walls"),
        (b'{"do": "send", "robot": -1, "text": ""}', "there is no robot -1"),
        (b'{"do": "toggle_breakpoint", "robot": 0, "place": "main"}', "robot 0 is scripted"),
        (b'{"do": "pause", "more": 1}', "expected no parameters"),
    ],
)  # fmt: skip
def test_bad_requests_are_reported_in_one_line(body: bytes, said: str) -> None:
    """A bad request gets status 409 and one line, and the studio continues."""
    with serving() as one:
        status, text = asked(one, "/do", body)
        assert (status, text.count("\n")) == (409, 0)
        assert said in text
        assert asked(one, "/inspect?robot=7")[0] == asked(one, "/more?from=-1&epoch=1")[0] == 409
        assert asked(one, "/elsewhere")[0] == 404
        assert json.loads(asked(one, "/inspect?robot=1")[1]) == {"robot": 1, "script": True}


def test_a_long_request_is_refused_before_it_is_read() -> None:
    """A body above 64 KiB is refused by its announced length."""
    request = SimpleNamespace(headers={"Content-Length": "65537"}, rfile=io.BytesIO(b"{}"))
    with pytest.raises(CommandRefusedError, match="request of 65537 bytes; expected at most 65536"):
        command._StudioHandler._body(request)


@pytest.mark.slow
def test_the_command_ends_with_ctrl_c() -> None:
    """`arena studio` prints its address and ends on Ctrl-C; a bad scene is one line and status 2."""
    words = [sys.executable, "-m", "arena", "studio", "clustering", "--brain", "scripted", "--port", "0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().split()[0]
        end = time.monotonic() + HANG
        while 'id="studio"' not in (text := urllib.request.urlopen(address, timeout=HANG).read().decode()):
            assert "check the scene" in text
            assert time.monotonic() < end
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == ""
    assert process.returncode == 0
    bad = [sys.executable, "-m", "arena", "studio", "nowhere"]
    done = subprocess.run(bad, capture_output=True, text=True, cwd=ROOT, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_the_page_is_served_before_the_trial_is_ready() -> None:
    """While the trial is created, `/` is a page that lists what it waits for, `/progress` names the stage, and commands
    are refused with it. Then the same address is the page of the trial."""
    may_go_on = threading.Event()

    def slow_plan() -> Plan:
        assert may_go_on.wait(HANG)
        return scripted_plan()

    startup = Startup(slow_plan)
    with StudioServer(startup, 0) as one:
        threading.Thread(target=one.serve_forever, daemon=True).start()
        startup.start(one.shutdown)
        try:
            address = f"/?token={one.token}"
            status, text = asked(one, address)
            assert (status, 'id="studio"' in text) == (200, False)
            assert all(stage in text for stage in STAGES)
            assert json.loads(asked(one, "/progress")[1]) == {"is_ready": False, "stage": 0}
            assert asked(one, "/progress", **{HEADER: ""})[0] == 403
            refused = 409, f"the trial is not ready: it must {STAGES[0]}"
            assert asked(one, "/more?from=0&epoch=1") == asked(one, "/do", b'{"do": "pause"}') == refused
            may_go_on.set()
            end = time.monotonic() + HANG
            while not json.loads(asked(one, "/progress")[1])["is_ready"]:
                assert time.monotonic() < end
                time.sleep(0.05)
            assert 'id="studio"' in asked(one, address)[1]
            assert json.loads(asked(one, "/do", b'{"do": "pause"}')[1])["tick"] == 0
        finally:
            may_go_on.set()
            one.shutdown()
            startup.close()


def test_a_trial_that_cannot_be_created_ends_the_server(capsys: pytest.CaptureFixture[str]) -> None:
    """A scene without room for its robots is found after the address is printed: one line, and status 2."""
    words = ["studio", "clustering", "--brain", "scripted", "--port", "0", "--set", "arena.width_cm=40"]
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.out.startswith("http://127.0.0.1:")
    assert printed.err.startswith("arena: ")
    assert printed.err.count("\n") == 1


# -- the page --------------------------------------------------------------------------------------------------------

PROBE = """<pre id="result"></pre><script>
const found = {}, rest = ms => new Promise(done => setTimeout(done, ms));
const until = async seen => { while (!seen()) { await ask("inspect?robot=0"); await rest(10); } };
const still = async () => { await rest(100); await until(() => d.studio.now.state === "paused"); };
(async () => {
  found.first = d.studio.now.tick; found.label = el("running").textContent;
  el("step").click(); await until(() => d.studio.now.tick); await still(); found.stepped = d.studio.now.tick;
  el("speed").value = "4"; el("run").click(); await until(() => d.studio.now.tick > 11);
  el("run").click(); await still();
  found.ran = d.studio.now.tick; found.before = (await ask("digest")).digest;
  const [x, y] = d.studio.now.objects[0], at = (x, y) => ({offsetX: X(x), offsetY: Y(y)});
  canvas.onpointerdown(at(x, y)); canvas.onpointermove(at(200, 150));
  canvas.onpointerup(); canvas.onclick(at(200, 150));
  do found.moved = (await ask("digest")).digest; while (found.moved === found.before);
  found.dragged = d.studio.now.objects[0];
  await act({do: "step", quanta: 20}); await still();
  await act({do: "rewind", tick: found.ran}); await still();
  found.backTick = d.studio.now.tick; found.back = (await ask("digest")).digest;
  choose(1); await until(() => el("inspector").textContent); found.inside = el("inspector").textContent;
  el("breakpoint").value = "main"; el("breakpoint").dispatchEvent(new Event("change"));
  await until(() => el("error").textContent);
  found.refused = el("error").textContent; found.samples = d.t.length;
  document.getElementById("result").textContent = JSON.stringify(found);
  window.setTimeout = () => 0;           // ends the virtual time of the browser
})().catch(error => { document.getElementById("result").textContent = JSON.stringify({error: error.stack}); });
</script></html>"""


@needs_browser
def test_the_page_controls_the_trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page can step, run, pause, drag an object, rewind, inspect a robot, and show why a command is refused."""
    with serving(replace(scripted_plan(), seconds=600.0)) as one:  # long enough to be paused
        found = run_probe(one, PROBE, tmp_path, monkeypatch)
    assert (found["first"], found["stepped"]) == (0, 1)
    assert found["label"] == "", "the label of a live page says `running` beside a paused trial"
    assert found["ran"] > 10
    assert found["backTick"] == found["ran"]
    assert found["dragged"] == pytest.approx([200, 150], abs=1.5)
    assert found["before"] != found["moved"] == found["back"]
    assert found["inside"] == "scripted robot: no firmware"
    assert "robot 1 is scripted" in found["refused"]


def run_probe(one: StudioServer, probe: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Open the studio's page with a probe script, and return the result of the probe.

    The browser's timers run in virtual time; requests do not."""
    plain = command.page
    monkeypatch.setattr(command, "page", lambda *given, **more: probed(plain(*given, **more), probe))
    words = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
             f"--user-data-dir={folder}", "--virtual-time-budget=60000", "--dump-dom", one.address]  # fmt: skip
    done = subprocess.run(words, capture_output=True, text=True, timeout=HANG, check=False)
    found = json.loads(html.unescape(done.stdout.split('<pre id="result">')[1].split("</pre>")[0]))
    assert "error" not in found, found
    return found
