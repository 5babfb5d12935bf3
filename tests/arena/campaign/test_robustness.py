"""Robustness of runs: invalid numbers, killed processes, two runs in one folder, mixed versions."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pyarrow
import pytest
from pyarrow import parquet

from arena.campaign import campaign, cluster
from arena.campaign.campaign import Plan
from arena.cli import main
from arena.replay.live_feed import Follower, LiveFile, live_path
from arena.replay.page import page
from arena.scene.loader import load_scene, scripted
from arena.trial import versions
from arena.trial.record import RecordError, read_trial
from arena.trial.strict_json import mismatch
from tests.watchdog import HANG

ROOT = Path(__file__).resolve().parents[3]
SHORT = ["run", "clustering", "--brain", "scripted", "--minutes", "0.05", "--trials", "1", "--jobs", "1"]


def start_arena(*arguments: object) -> subprocess.Popen[str]:
    """Start `arena` in another process and return the process."""
    command = [sys.executable, "-m", "arena", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)


def wait_for(path: Path) -> None:
    end = time.monotonic() + HANG
    while not path.exists():
        assert time.monotonic() < end, f"{path} did not appear"
        time.sleep(0.02)


def wait_for_port(port: int) -> None:
    end = time.monotonic() + HANG
    while True:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return
        except OSError:
            assert time.monotonic() < end, f"no server at port {port}"
            time.sleep(0.1)


@pytest.mark.parametrize(
    "words",
    [
        ["--minutes", "inf"], ["--minutes", "nan"], ["--minutes", "0"], ["--minutes", "-1"], ["--minutes", "1e300"],
        ["--jobs", "-5"], ["--jobs", "0"], ["--jobs", "two"], ["--trials", "0"], ["--trials", "1.5"], ["--seed", "-1"],
        ["--robots", "-1"], ["--objects", "x"],
    ],
)  # fmt: skip
def test_invalid_numbers_are_refused(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An invalid number is named and ends with status 2; no folder is created."""
    assert main([*SHORT, *words, "--out", str(tmp_path / "out")]) == 2
    output = capsys.readouterr().err
    assert f"argument {words[0]}: {words[1]!r}: expected" in output
    assert not (tmp_path / "out").exists()


def test_an_arena_without_robots_and_things_is_a_trial_like_any_other(tmp_path: Path) -> None:
    """A trial of an empty arena can be run, drawn and exported as a video."""
    path, out = tmp_path / "empty.toml", tmp_path / "out"
    path.write_text('name = "empty"\n[robots]\ncount = 0\n[objects]\ncount = 0\n')
    assert main(["run", str(path), "--brain", "scripted", "--trials", "1", "--minutes", "0.02", "--out", str(out)]) == 0
    assert main(["plot", str(out), "--out", str(tmp_path / "figures")]) == 0
    assert main(["replay", str(out / "trial-0001.parquet"), "--export", str(tmp_path / "film.gif")]) == 0


def test_json_knows_no_nan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A metric that is nan is null in JSON results and in the page."""
    experiment = """from arena.experiments import Curve
CURVES = [Curve("share", "share")]
def metrics(sample): return {"share": float("nan")}
"""
    (tmp_path / "nan.py").write_text(experiment)
    path, out = tmp_path / "nan.toml", tmp_path / "out"
    path.write_text('name = "nan"\nexperiment = "nan.py"\n[[robots]]\ncount = 1\n')
    words = ["run", str(path), "--brain", "scripted", "--trials", "1", "--minutes", "0.02", "--out", str(out), "--json"]
    assert main(words) == 0

    def refuse(name: str) -> None:
        raise AssertionError(name)

    results = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert results["trials"][0]["share"] is None
    text = page(read_trial(out / "trial-0001.parquet"))
    data = text.split('id="trial">')[1].split("</script>")[0]
    assert set(json.loads(data, parse_constant=refuse)["curves"]["share"]) == {None}


@pytest.mark.parametrize("name", ["../../evil", "/evil", "a/b", "..", "", ".hidden", "x" * 65, "a\nb"])
def test_a_scene_cannot_choose_a_folder_by_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The name of a scene, which is part of the default folder, cannot contain a path."""
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    monkeypatch.chdir(inner)
    (inner / "s.toml").write_text(f"name = {json.dumps(name)}\n")
    assert main(["run", "s.toml", *SHORT[2:]]) == 2
    assert "s.toml:1: name is" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a", "b", "s.toml"]


def test_a_sweep_cannot_choose_a_folder_by_its_values(tmp_path: Path) -> None:
    """Values become parts of folder names without characters that are special to a file system."""
    command = ["sweep", "clustering", *SHORT[2:], "--vary", "camera.sensor=PO6030K,../../../evil"]
    assert main([*command, "--out", str(tmp_path / "deep" / "deeper")]) == 0
    made = [path.parent for path in tmp_path.rglob("manifest.json")]
    assert len(made) == 2
    assert all(path.parent == tmp_path / "deep" / "deeper" for path in made)


STOPPED = """
import os, signal, sys
from arena.campaign import campaign
from arena.cli import main

run_one = campaign.run_one
def run_after_stop(plan, number, *rest, **options):
    if number == 1:
        os.kill(os.getpid(), signal.SIGSTOP)
    return run_one(plan, number, *rest, **options)

campaign.run_one = run_after_stop
sys.exit(main(sys.argv[1:]))
"""
"""The command line of `arena`, stopped before its first trial until SIGCONT."""


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    """The second run ends with status 3 and changes nothing; the first run is unaffected."""
    words = [*SHORT[:6], "--trials", "3", "--jobs", "1", "--out", str(tmp_path)]
    first = subprocess.Popen([sys.executable, "-c", STOPPED, *words], stdout=subprocess.DEVNULL, cwd=ROOT)
    wait_for(tmp_path / "manifest.json")
    second = start_arena(*SHORT, "--seed", 99, "--out", tmp_path)
    output = second.communicate(timeout=HANG)[1]
    os.waitpid(first.pid, os.WUNTRACED)
    first.send_signal(signal.SIGCONT)
    assert second.returncode == 3
    assert output.count("\n") == 1
    assert "another run is writing here" in output
    assert first.wait(HANG) == 0
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["key"]["seed"] == 1
    assert [one["trial"] for one in manifest["host"]] == [1, 2, 3]


def test_a_killed_run_leaves_the_folder_free(tmp_path: Path) -> None:
    """The lock of a folder is released when its process is killed."""
    long = ["run", "clustering", "--brain", "scripted", "--minutes", "60", "--trials", "1", "--jobs", "1"]
    first = start_arena(*long, "--out", tmp_path / "run")
    wait_for(tmp_path / "run" / "manifest.json")
    first.kill()
    first.wait()
    again = [*long[:5], "0.02", *long[6:], "--out", str(tmp_path / "run")]
    assert main(again) == 2  # refused because the duration differs, not because of a lock
    (tmp_path / "run" / "manifest.json").unlink()
    assert main(again) == 0


def test_a_file_where_the_folder_should_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If the output path is a file instead of a folder, the run ends with one line and status 2."""
    (tmp_path / "out").write_text("mine")
    assert main([*SHORT, "--out", str(tmp_path / "out")]) == 2
    assert "is not a folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "mine"


WRITER = """
import os, sys, time
from pathlib import Path
from arena.replay.live_feed import LiveFile
about = {"scene": {}, "brain": "scripted", "controller": "A", "seed": 1, "faults": []}
live = LiveFile(Path(sys.argv[1]), about)
live.write({"t": 0.0})
print("written", flush=True)
time.sleep(600)
"""


def test_a_page_that_follows_a_killed_run_says_that_it_is_gone(tmp_path: Path) -> None:
    """SIGKILL leaves the live file; the reader reports that the trial was aborted."""
    path = live_path(tmp_path, 1)
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, cwd=ROOT) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        try:
            follower = Follower(tmp_path)
            assert follower.more(99)["state"] == "running"
        finally:
            os.kill(writer.pid, signal.SIGKILL)
            writer.wait()
    assert path.exists()
    assert follower.more(99)["state"] == "aborted"


def test_a_trial_that_ends_takes_its_lock_away(tmp_path: Path) -> None:
    """A finished trial leaves neither live file nor lock."""
    live = LiveFile(live_path(tmp_path, 1), {})
    live.close()
    assert list(tmp_path.iterdir()) == []


def test_progress_without_a_terminal_is_plain_lines(tmp_path: Path) -> None:
    """Without a terminal, progress is printed as plain lines."""
    run = start_arena(*SHORT[:-4], "--trials", 3, "--jobs", 1, "--out", tmp_path)
    out, output = run.communicate(timeout=HANG)
    assert run.returncode == 0
    lines = [line for line in output.splitlines() if " at " not in line]  # a busy machine also prints partial progress
    assert [line.split(" done in ")[0] for line in lines] == ["trial 1", "trial 2", "trial 3"]
    assert lines[-1].endswith("3 of 3 (100% of all)")
    assert "done in" not in out


def test_a_record_names_what_it_depends_on(tmp_path: Path) -> None:
    """A record names the versions of emulator, arena and libraries; the manifest also names the host."""
    assert main([*SHORT, "--out", str(tmp_path)]) == 0
    about = read_trial(tmp_path / "trial-0001.parquet").about
    assert set(about["versions"]) == {"emulator", "arena", "machine", "pymunk", "numpy", "pyarrow", "llvmlite"}
    assert len(about["versions"]["emulator"]) == len(about["versions"]["arena"]) == 16
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["key"]["versions"] == about["versions"]
    assert {"python", "system"} <= set(manifest["made_on"])
    assert "made_on" not in about


@pytest.mark.parametrize("name", ["emulator", "arena", "pymunk"])
def test_versions_do_not_mix_in_a_folder(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run with another version of the emulator cannot continue in the same folder."""
    assert main([*SHORT, "--out", str(tmp_path)]) == 0
    changed = versions.versions() | {name: "another"}
    monkeypatch.setattr(campaign, "versions", lambda: changed)
    assert main([*SHORT, "--out", str(tmp_path)]) == 2
    assert f"different version of {name}" in capsys.readouterr().err


def test_the_hash_of_sources_sees_code_and_not_where_it_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The version hash depends on every byte of code, but not on the location of the sources or on the replay page."""

    def hashed(root: Path) -> str:
        monkeypatch.setattr(versions, "ROOT", root)
        versions.sources_hash.cache_clear()
        return versions.sources_hash("arena")

    for root in ("one", "two/deeper"):
        for part in ("world", "replay"):
            (tmp_path / root / "arena" / part).mkdir(parents=True)
        (tmp_path / root / "arena" / "world" / "physics.py").write_text("x = 1\n")
        (tmp_path / root / "arena" / "replay" / "page.py").write_text("y = 1\n")
    before = hashed(tmp_path / "one")
    assert before == hashed(tmp_path / "two/deeper")
    (tmp_path / "one" / "arena" / "replay" / "page.py").write_text("y = 2\n")
    assert before == hashed(tmp_path / "one")
    (tmp_path / "one" / "arena" / "world" / "physics.py").write_text("x = 2\n")
    assert before != hashed(tmp_path / "one")
    versions.sources_hash.cache_clear()


def test_a_worker_of_another_version_is_refused() -> None:
    """A worker of another version is refused, and the message names the versions."""
    plan = Plan(scripted(load_scene("clustering")), "scripted", "A", None, 1, 1.0, 1)
    wanted = versions.versions() | {"pymunk": "0.1"}
    with pytest.raises(ValueError, match=r"worker on .* has pymunk .* instead of 0\.1"):
        cluster.run_remote_trial(plan, cluster.InputFiles(None, None, [], []), 1, wanted)


@pytest.mark.slow
def test_a_scheduler_that_dies_is_one_line_and_what_is_finished_stays(tmp_path: Path) -> None:
    """A lost scheduler is status 3; the same command without the cluster continues."""
    pytest.importorskip("distributed", reason="Dask is not installed (extra: cluster)")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = subprocess.Popen(dask, **quiet)  # type: ignore[call-overload]
    worker = subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_worker", f"tcp://127.0.0.1:{port}",
                               "--nthreads", "1", "--no-dashboard", "--no-nanny", "--death-timeout", "60"],
                              cwd=ROOT, **quiet)  # type: ignore[call-overload]  # fmt: skip
    arguments = [*SHORT[:4], "--minutes", "3", "--trials", "40", "--jobs", "1", "--out", str(tmp_path)]
    try:
        wait_for_port(port)
        run = start_arena(*arguments, "--scheduler", f"tcp://127.0.0.1:{port}")
        wait_for(tmp_path / "trial-0001.parquet")
        scheduler.kill()
        output = run.communicate(timeout=HANG)[1]
        assert run.returncode == 3, output
        lines = [line for line in output.splitlines() if not line.startswith("trial ")]
        assert len(lines) == 1, output
        assert "lost while trials ran" in lines[0]
        assert read_trial(tmp_path / "trial-0001.parquet").about["seed"] == 1
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()


@pytest.mark.parametrize(
    ("value", "wrong"),
    [
        ({"seed": 3, "faults": [[0, 1.5, "a trap"]]}, ""),
        ({"seed": 3, "faults": [], "note": None}, ""),
        ([], "it is []; expected a table"),
        ({"faults": []}, "seed is None; expected int"),
        ({"seed": True, "faults": []}, "seed is True; expected int"),
        ({"seed": 1, "faults": {}}, "faults is {}; expected a list"),
        ({"seed": 1, "faults": [[0, 1.5]]}, "faults[0] is [0, 1.5]; expected a list of 3"),
        ({"seed": 1, "faults": [[0, 1, ""], [0, "1", ""]]}, "faults[1][1] is '1'; expected float"),
        ({"seed": 1, "faults": [], "note": 5}, "note is 5; expected str"),
    ],
)
def test_the_first_thing_that_is_wrong_with_a_json_text(value: object, wrong: str) -> None:
    """For invalid metadata of a record, the message names the first wrong value."""
    assert mismatch(value, {"seed": int, "faults": [(int, float, str)], "note?": str}) == wrong


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("r0_x", ["left"] * 2, "has gaps or is not of type double"),
        ("r0_x", [1.0, None], "has gaps or is not of type double"),
        ("r0_x", [1.0, float("nan")], "expected numbers below 1e+07"),
        ("r0_x", [1.0, 1e308], "expected numbers below 1e+07"),
        ("r0_seen", pyarrow.array([0, 7], pyarrow.int16()), "expected -1 to 2"),
        ("log", [[], [{"robot": 0, "cycle": None, "text": "x"}]], "has gaps or is not of type list<"),
    ],
)
def test_a_record_with_a_damaged_column_is_refused(column: str, values: list[object], message: str,
                                                   tmp_path: Path) -> None:  # fmt: skip
    """A record with a damaged column is refused; the message names the file and the column."""
    assert main([*SHORT, "--robots", "1", "--objects", "0", "--out", str(tmp_path)]) == 0
    path = tmp_path / "trial-0001.parquet"
    table = parquet.read_table(path).slice(0, 2)
    place = table.column_names.index(column)
    parquet.write_table(table.set_column(place, column, pyarrow.array(values)), path)
    with pytest.raises(RecordError, match=f"column {column}") as refused:
        read_trial(path)
    assert message in str(refused.value)
