"""Live feed of a running trial: file of rows, HTTP server, and a page that polls for new samples."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from arena.campaign.campaign import Plan, run_one, trial_path
from arena.cli import main
from arena.commands.replay import server
from arena.replay.live_feed import Follower, LiveFile, live_path
from arena.replay.page import sample_data
from arena.robots.controller import ScriptedController
from arena.scene.loader import load_scene, scripted
from arena.trial.record import RecordError, read_trial, write_trial
from arena.trial.trial import Rows, run_trial
from tests.arena.browser import BROWSER, needs_browser, probed
from tests.watchdog import HANG

PROBE = """<pre id="result"></pre><script>
const found = {before: d.t.length, title: document.title};
setTimeout(() => {
  Object.assign(found, {after: d.t.length, sample, state: document.getElementById("running").textContent,
    max: Number(scrub.max), share: d.curves.share[sample], x: d.robots[1].x[sample]});
  document.getElementById("result").textContent = JSON.stringify(found);
}, 6000);
</script></html>"""


@pytest.fixture(scope="module")
def recorded() -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return metadata and rows of a trial of six seconds with two scripted robots."""
    scene = scripted(load_scene("clustering").with_values(robots__count=2))
    plan = Plan(scene, "scripted", "A", None, 1, 6.0, 1)
    rows: list[dict[str, Any]] = []
    run_trial(scene, 1, [ScriptedController(scene, 1, robot, "A") for robot in range(2)], 6.0, on_row=rows.append)
    for row in rows:
        row["r0_strip"] = bytes(range(60))
    return plan.key() | {"seed": 1, "faults": []}, rows


def finish(folder: Path, live: LiveFile, about: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    """Write the record and close the live file, as a run does at the end of a trial."""
    columns = Rows()
    for row in rows:
        columns.add(row)
    write_trial(trial_path(folder, 1), columns, about)
    live.close()


@contextmanager
def serving(follower: Follower) -> Iterator[str]:
    with server(follower, 0) as one:
        thread = threading.Thread(target=one.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{one.server_port}"
        one.shutdown()


def test_a_follower_gets_the_samples_of_the_finished_file_piece_by_piece(
    tmp_path: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]
) -> None:
    """The state is running, then done; an incomplete line is read when it is complete."""
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    for row in rows[:4]:
        live.write(row)
    with live_path(tmp_path, 1).open("a") as file:
        file.write('{"t": 2.0, "o0')
    follower = Follower(tmp_path)
    first = follower.more(0)
    assert (first["state"], len(first["t"])) == ("running", 4)
    assert follower.more(4) == {"state": "running"}
    finish(tmp_path, live, about, rows)
    rest = follower.more(4)
    assert rest["state"] == "done"
    assert not live_path(tmp_path, 1).exists()
    whole = sample_data(read_trial(trial_path(tmp_path, 1)))
    assert first["t"] + rest["t"] == whole["t"]
    assert first["robots"][0]["strip"] + rest["robots"][0]["strip"] == whole["robots"][0]["strip"]
    assert first["objects"] + rest["objects"] == whole["objects"]


def test_a_run_that_is_ended_is_reported(tmp_path: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]) -> None:
    """The state is aborted when the live file disappears and there is no record."""
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    live.write(rows[0])
    follower = Follower(tmp_path)
    live.close()
    assert follower.more(0) == {"state": "aborted"}
    with pytest.raises(RecordError, match="no trial is running here"):
        Follower(tmp_path)


def test_a_disk_too_full_for_the_rows_does_not_stop_the_trial(
    tmp_path: Path, full_disk: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]
) -> None:
    """If every write of the live file fails with ENOSPC, the trial continues."""
    live_path(tmp_path, 1).symlink_to(full_disk)
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    for row in rows:
        live.write(row)
    live.close()
    assert not live_path(tmp_path, 1).is_symlink()


def test_a_trial_with_firmware_can_be_followed_while_it_runs(talking_image: Path, tmp_path: Path) -> None:
    """The rows of a running trial equal those of its record; the record has the fault."""
    scene = load_scene("clustering").with_values(robots__count=1, objects__count=3)
    plan = Plan(scene, "talking", "A", talking_image, 1, 3.0, 1)
    seen: list[dict[str, Any]] = []
    run_one(plan, 1, tmp_path, lambda _trial, _seconds: seen.append(Follower(tmp_path).more(0)))
    assert [len(one["t"]) for one in seen] == [3, 5, 7]
    assert {one["state"] for one in seen} == {"running"}
    whole = sample_data(read_trial(trial_path(tmp_path, 1)))
    assert seen[-1]["t"] == whole["t"]
    assert seen[-1]["log"] == whole["log"]
    assert [line["text"] for row in whole["log"] for line in row] == ["hi"]
    assert list(tmp_path.glob("*.live")) == []


def test_the_server_answers_its_two_places_only(
    tmp_path: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]
) -> None:
    """The server answers unknown paths with status 404, and a request before the first sample with status 503."""
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    with serving(Follower(tmp_path)) as address:
        for place, status in (("/", 503), ("/etc/passwd", 404), ("/more?from=-1", 404)):
            with pytest.raises(urllib.error.HTTPError) as error:
                urllib.request.urlopen(address + place, timeout=HANG)
            assert error.value.code == status
        foreign = urllib.request.Request(address + "/more?from=0", headers={"Host": "example.org"})
        with pytest.raises(urllib.error.HTTPError) as error:
            urllib.request.urlopen(foreign, timeout=HANG)
        assert error.value.code == 403
        live.write(rows[0])
        with urllib.request.urlopen(address + "/more?from=0", timeout=HANG) as answer:
            assert len(json.load(answer)["t"]) == 1
    live.close()


def test_the_command_serves_until_it_is_interrupted(
    tmp_path: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]
) -> None:
    """`arena replay --live` prints its address and ends without a message on Ctrl-C."""
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    live.write(rows[0])
    command = [sys.executable, "-m", "arena", "replay", str(tmp_path), "--live", "--port", "0"]
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stdout.readline().split()[0]
        with urllib.request.urlopen(address, timeout=HANG) as answer:
            assert 'id="trial"' in answer.read().decode()
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == ""
    assert process.returncode == 0
    live.close()


def test_live_needs_a_run_that_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`arena replay --live` for a folder without a running trial ends with exit status 2."""
    assert main(["replay", str(tmp_path), "--live"]) == 2
    assert "no trial is running here" in capsys.readouterr().err


@needs_browser
def test_the_page_grows_in_a_browser(tmp_path: Path, recorded: tuple[dict[str, Any], list[dict[str, Any]]]) -> None:
    """The page starts with four samples and polls until the trial is done."""
    about, rows = recorded
    live = LiveFile(live_path(tmp_path, 1), about)
    for row in rows[:4]:
        live.write(row)

    class Going(Follower):
        asked = 0

        def page(self) -> str:
            return probed(super().page(), PROBE)

        def more(self, first: int) -> dict[str, Any]:
            self.asked += 1
            if self.asked == 2:
                for row in rows[4:8]:
                    live.write(row)
            if self.asked == 3:
                finish(tmp_path, live, about, rows)
            return super().more(first)

    with serving(Going(tmp_path)) as address:
        command = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=12000",
                   f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", address + "/"]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False)
    match = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.S)
    assert match is not None, done.stderr[-2000:]
    found = json.loads(match.group(1))
    record = read_trial(trial_path(tmp_path, 1))
    last = len(record.times) - 1
    assert (found["before"], found["after"], found["sample"], found["max"]) == (4, last + 1, last, last)
    assert found["state"] == "done"
    assert found["x"] == record.columns["r1_x"][last]
