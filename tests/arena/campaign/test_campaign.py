"""Command line of the arena: files do not depend on the number of workers, runs can be resumed, bad input is reported
(docs/experiment.md)."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from arena.analysis import plots
from arena.analysis.report import BEGIN, END
from arena.cli import main
from arena.trial.record import RecordError, read_trial, trials_in, write_trial
from arena.trial.trial import Rows
from tests.watchdog import HANG

SHORT = ["--brain", "scripted", "--minutes", "0.1", "--controller", "A"]


def run(*arguments: object) -> int:
    return main(["run", "clustering", *SHORT, *map(str, arguments)])


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_one_worker_two_workers_and_a_second_run_write_the_same_bytes(tmp_path: Path) -> None:
    """Runs with one worker, with two workers and a second run write the same bytes."""
    for folder, jobs in (("one", 1), ("two", 2), ("again", 1)):
        assert run("--trials", 3, "--jobs", jobs, "--out", tmp_path / folder) == 0
    assert len(contents(tmp_path / "one")) == 3
    assert contents(tmp_path / "one") == contents(tmp_path / "two") == contents(tmp_path / "again")


def test_finished_trials_are_kept_and_an_unfinished_one_starts_from_its_seed(tmp_path: Path) -> None:
    """An interrupted run, with one record missing and one partial record, continues with the missing trial and keeps
    the others."""
    run("--trials", 3, "--jobs", 1, "--out", tmp_path / "a")
    before = contents(tmp_path / "a")
    kept = tmp_path / "a" / "trial-0001.parquet"
    stamp = kept.stat().st_mtime_ns
    (tmp_path / "a" / "trial-0002.parquet").unlink()
    (tmp_path / "a" / ".trial-0002.parquet.x.part").write_bytes(b"half")
    assert run("--trials", 3, "--jobs", 1, "--out", tmp_path / "a") == 0
    assert contents(tmp_path / "a") == before
    assert kept.stat().st_mtime_ns == stamp


def test_a_folder_of_another_run_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run with another seed in the same folder is refused with status 2."""
    run("--trials", 1, "--jobs", 1, "--out", tmp_path)
    assert run("--trials", 1, "--jobs", 1, "--seed", 9, "--out", tmp_path) == 2
    assert "holds another run (different seed)" in capsys.readouterr().err


def test_a_trial_says_what_it_was_made_from(tmp_path: Path) -> None:
    """A record holds seed, scene, controller and versions of its trial."""
    run("--trials", 1, "--jobs", 1, "--seed", 7, "--robots", 2, "--objects", 3, "--out", tmp_path)
    (trial,) = trials_in(tmp_path)
    assert trial.about["seed"] == 7
    assert trial.about["scene"]["robots"]["count"] == 2
    assert trial.objects.shape == (len(trial.times), 3, 2)
    assert trial.times[-1] == pytest.approx(6.0, abs=0.01)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["key"]["controller"] == "A"
    assert manifest["key"]["versions"]["pymunk"]
    assert manifest["host"][0]["trial"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nowhere", *SHORT], "there is no scene 'nowhere'; known: aggregation, average, avoidance, "),
        (["run", "clustering", *SHORT, "--objects", "200"], "no room: 205 robots and objects on 165 marks"),
        (["run", "clustering", "--brain", "lost.elf"], "no such file"),
        (["run", "clustering", "--brain", __file__], "test_campaign.py"),
        (["run", "clustering", *SHORT, "--set", "range=3"], "expected SECTION.KEY=VALUE"),
        (["run", "clustering", *SHORT, "--set", "camera.range_cm=far"], "camera.range_cm is 'far'; expected float"),
        (["run", "clustering", *SHORT, "--set", f"camera.range_cm={'[' * 2000}"], "expected float"),
        (["run", "clustering", *SHORT, "--trials", "0"], "expected a whole number of 1 or more"),
        (["run", "clustering", *SHORT, "--processes", "2"], "the option no longer exists: use `--jobs N`"),
        (["compare", "nowhere", "elsewhere"], "no finished trials"),
        (["replay", "nowhere.parquet"], "no such file"),
        (["replay", __file__], "is not a recorded trial"),
        (["sweep", "clustering", *SHORT, "--vary", "camera"], "expected SECTION.KEY=V1,V2"),
    ],
)
def test_bad_input_is_explained_without_a_traceback(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Invalid arguments end with exit status 2 and a message without a traceback."""
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 3", "unexpected 'name'"),
        ("", "a scene needs a name"),
        ('name = "x"\n[robots]\nwheels = 2', "unknown key robots.wheels"),
        ('name = "x"\n[clock]\nquantum_ms = 50', "clock.quantum_ms is 50.0; expected 0.1 to 20"),
        ('name = "x"\nrobots = \n', "line 2"),
    ],
)
def test_scene_files_with_mistakes_are_named(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For an invalid scene file the message names file, key and expected value."""
    path = tmp_path / "my.toml"
    path.write_text(text)
    assert main(["run", str(path), *SHORT]) == 2
    error = capsys.readouterr().err
    assert "my.toml" in error
    assert message in error


def test_a_new_scene_needs_no_code(tmp_path: Path) -> None:
    """A scene file outside the package works like a built-in scene."""
    path = tmp_path / "small.toml"
    path.write_text('name = "small"\n[robots]\ncount = 1\n[objects]\ncount = 2\n')
    assert main(["run", str(path), *SHORT, "--trials", "1", "--out", str(tmp_path / "out")]) == 0
    assert trials_in(tmp_path / "out")[0].about["scene"]["name"] == "small"


def test_a_full_disk_is_reported_and_leaves_no_file(tmp_path: Path, unwritable: set[str]) -> None:
    """If every write of a record fails with ENOSPC, the message names the record, and no file is left."""
    unwritable.add("trial-0001.parquet")
    rows = Rows()
    rows.add({"t": 0.0, "log": []})
    with pytest.raises(RecordError, match=r"trial-0001\.parquet: cannot be written: .*[Nn]o space"):
        write_trial(tmp_path / "trial-0001.parquet", rows, {})
    assert list(tmp_path.iterdir()) == []


def test_compare_finds_a_run_equivalent_to_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`compare` of a run with itself finds only differences of 0."""
    run("--trials", 2, "--jobs", 1, "--out", tmp_path)
    capsys.readouterr()
    assert main(["compare", str(tmp_path), str(tmp_path), "--at", "5", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert all(row["equivalent"] and row["mean"] == 0 and row["wilcoxon_p"] == 1 for row in result["measures"])
    assert main(["compare", str(tmp_path), str(tmp_path)]) == 2  # trials of 6 s are too short for the default --at
    assert "less than --at 600" in capsys.readouterr().err


def test_compare_tells_how_far_robots_of_one_seed_are_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`compare` reports 0 cm between robots of equal runs, and a positive distance for a run with another quantum."""
    run("--trials", 2, "--jobs", 1, "--out", tmp_path / "a")
    run("--trials", 2, "--jobs", 1, "--set", "clock.scripted_quantum_ms=2", "--out", tmp_path / "b")
    apart = []
    for other in ("a", "b"):
        capsys.readouterr()
        assert main(["compare", str(tmp_path / "a"), str(tmp_path / other), "--at", "5", "--json"]) == 0
        apart.append(json.loads(capsys.readouterr().out)["apart"])
    assert [one["seconds"] for one in apart[0]] == [2.0, 5.0]  # trials last 6 s
    assert [one["max_cm"] for one in apart[0]] == [0.0, 0.0]
    assert 0 < apart[1][1]["median_cm"] <= apart[1][1]["max_cm"] < 5


@pytest.mark.slow
def test_report_writes_tables_and_figures_into_a_document(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The report replaces the text between its marks; a document without marks is not changed."""
    document = tmp_path / "docs" / "page.md"
    document.parent.mkdir()
    document.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    for name, quantum in (("one", 10), ("two", 5)):
        setting = f"clock.scripted_quantum_ms={quantum}"
        assert run("--trials", 3, "--jobs", 1, "--set", setting, "--out", tmp_path / name) == 0
    command = ["report", str(tmp_path / "one"), str(tmp_path / "two"), "--at", "5", "--document", str(document),
               "--figures", str(tmp_path / "docs" / "figures")]  # fmt: skip
    assert main(command) == 0
    text = document.read_text()
    assert text.startswith("before\n")
    assert text.endswith(f"{END}\nafter\n")
    assert "old" not in text
    assert "### Controller A" in text
    assert "| one | 3 |" in text
    assert "| one - two, 3 | share at 5 s |" in text
    assert "(figures/A-curves.png)" in text
    assert (tmp_path / "docs" / "figures" / "A-snapshots.png").stat().st_size > 5000
    assert main(command) == 0
    assert document.read_text() == text
    document.write_text("no marks")
    assert main(command) == 2
    assert "has no marks for results" in capsys.readouterr().err
    assert document.read_text() == "no marks"


def test_sweeps_run_every_combination(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sweep over two values of each of two keys makes four runs."""
    vary = ["--vary", "robots.count=1,2", "--vary", "camera.range_cm=100,inf"]
    out = ["--trials", "1", "--jobs", "1", "--out", str(tmp_path)]
    assert main(["sweep", "clustering", *SHORT, *vary, *out]) == 0
    assert len(list(tmp_path.glob("*/trial-0001.parquet"))) == 4
    assert read_trial(tmp_path / "robots.count=2-camera.range_cm=inf" / "trial-0001.parquet").robots.shape[1] == 2
    assert "robots.count=2, camera.range_cm=inf" in capsys.readouterr().out
    assert main(["sweep", "clustering", *SHORT, *vary, *out, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["sweep"]
    assert [row["values"][0] for row in rows] == ["robots.count=1"] * 2 + ["robots.count=2"] * 2


def test_plot_draws_the_figures(tmp_path: Path) -> None:
    """`plot` draws snapshots, curves and trajectories, and CPU load only for firmware."""
    run("--trials", 2, "--jobs", 1, "--out", tmp_path / "run")
    assert main(["plot", str(tmp_path / "run"), "--out", str(tmp_path / "figures")]) == 0
    names = {path.name for path in (tmp_path / "figures").iterdir() if path.stat().st_size > 5000}
    assert names == {"snapshots.png", "curves.png", "trajectories.png"}  # scripted robots have no CPU load


def test_one_command_draws_all_figures_of_a_study(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One command draws one set of figures per controller and one for the scripted runs."""
    for controller in "AB":
        command = ["run", "clustering", "--brain", "scripted", "--minutes", "0.05", "--controller", controller]
        assert main([*command, "--trials", "2", "--jobs", "1", "--out", str(tmp_path / f"scripted-{controller}")]) == 0
    assert main(["figures", str(tmp_path), "--out", str(tmp_path / "f"), "--no-film"]) == 0
    names = {path.name for path in (tmp_path / "f").iterdir() if path.stat().st_size > 5000}
    kinds = ("snapshots", "curves", "trajectories")
    assert names == {f"{c}-{kind}.png" for c in "AB" for kind in kinds} | {
        "scripted-snapshots.png",
        "scripted-curves.png",
    }
    assert main(["figures", str(tmp_path / "none"), "--no-film"]) == 2
    assert "no folder of a run" in capsys.readouterr().err


def test_figures_show_what_is_there(tmp_path: Path) -> None:
    """Clusters of one object are not filled, deviations are clipped to possible values, and a scale bar is drawn."""
    run("--trials", 3, "--jobs", 1, "--out", tmp_path / "run")
    trials = trials_in(tmp_path / "run")
    picture = plots.snapshots({"run": trials})
    filled = [
        patch for axis in picture.axes for patch in axis.patches if patch.get_facecolor()[:3] == to_rgb("tab:red")
    ]
    clusters = [trials[0].experiment.groups(trials[0].scene, trials[0].objects[at]) for at in (0, -1)]
    sizes = [max(map(one.count, one)) for one in clusters]
    assert len(filled) == sum(size for size in sizes if size > 1)
    assert any(text.get_text() == "100 cm" for axis in picture.axes for text in axis.texts)
    curves = plots.curves({"run": trials})
    shares = np.array([100 * trial.series.curves["share"] for trial in trials])
    above = curves.axes[0].lines[1].get_ydata()
    assert above == pytest.approx(np.minimum(shares.mean(axis=0) + shares.std(axis=0, ddof=1), 100))
    assert "86.5 %" in curves.axes[0].get_title()
    assert plots.cpu_load({"run": trials}) is None
    plain = tmp_path / "plain.toml"
    plain.write_text('name = "plain"\n')
    assert main(["run", str(plain), *SHORT, "--trials", "2", "--jobs", "1", "--out", str(tmp_path / "other")]) == 0
    other = trials_in(tmp_path / "other")
    assert "86.5" not in "".join(axis.get_title() for axis in plots.curves({"other": other}).axes)
    with pytest.raises(ValueError, match="several experiments"):
        plots.draw_all({"run": trials, "other": other}, tmp_path, "png")


def test_sensitivity_prints_and_saves_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sensitivity table has one row per variant and one column per controller; finished trials are kept
    (experiment-contract.md §5)."""
    command = ["sensitivity", "clustering", "--trials", "2", "--minutes", "0.05", "--jobs", "1", "--only", "axle",
               "--only", "mirrored", "--out", str(tmp_path / "runs"), "--save", str(tmp_path / "table.md")]  # fmt: skip
    assert main(command) == 0
    text = capsys.readouterr().out
    assert text == (tmp_path / "table.md").read_text()
    rows = [line for line in text.splitlines() if "±" in line]
    assert [row.split(" | ")[0] for row in rows[1:]] == ["| axle 53 mm", "| mirrored picture"]
    trial = read_trial(tmp_path / "runs" / "axle-53-mm-B" / "trial-0002.parquet")
    assert trial.about["scene"]["robots"]["axle_cm"] == 5.3
    assert trial.about["controller"] == "B"
    assert main([*command[:-4], "--controllers", "AC"]) == 2
    assert "expected some of AB" in capsys.readouterr().err


def test_a_disk_that_fills_up_during_a_run_ends_it_and_keeps_what_is_finished(
    tmp_path: Path, unwritable: set[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """If the disk is full at the second of three trials, the run ends; the same command continues once there is
    space."""
    unwritable.add("trial-0002.parquet")
    assert run("--trials", 3, "--jobs", 1, "--out", tmp_path) == 2
    assert "trial-0002.parquet: cannot be written: No space left" in " ".join(capsys.readouterr().err.split())
    assert list(contents(tmp_path)) == ["trial-0001.parquet"]
    unwritable.clear()
    assert run("--trials", 3, "--jobs", 1, "--out", tmp_path) == 0
    assert len(contents(tmp_path)) == 3


class SignalWhenFreed:
    """Sends SIGINT from its destructor, as if Ctrl-C were pressed while a world is freed."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("sender", [lambda: signal.raise_signal(signal.SIGINT), SignalWhenFreed])
def test_an_interrupted_run_keeps_finished_trials_and_leaves_no_half_ones(
    tmp_path: Path, sender: Callable[[], object], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After SIGINT the same command continues the run, and its files equal those of an uninterrupted run. A SIGINT in
    a destructor, whose exceptions Python discards, interrupts too."""

    def write_and_interrupt(path: Path, *record: Any) -> None:
        write_trial(path, *record)
        sender()

    command = ["--trials", 4, "--jobs", 1, "--out"]
    with monkeypatch.context() as interrupted:
        interrupted.setattr("arena.campaign.campaign.write_trial", write_and_interrupt)
        assert run(*command, tmp_path / "a") == 130
    assert "finished trials are kept" in capsys.readouterr().err
    assert list(contents(tmp_path / "a")) == ["trial-0001.parquet"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    stamp = (tmp_path / "a" / "trial-0001.parquet").stat().st_mtime_ns
    for name in "ab":
        assert run(*command, tmp_path / name) == 0
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    assert (tmp_path / "a" / "trial-0001.parquet").stat().st_mtime_ns == stamp


def alive(process: str) -> bool:
    try:
        stat = Path(f"/proc/{process}/stat").read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"  # a container without init may keep zombies


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="only Linux's /proc tells a killed process's children")
def test_workers_end_with_a_killed_run(tmp_path: Path) -> None:
    """Worker processes end when their run is killed by SIGKILL."""
    command = [sys.executable, "-m", "arena", "run", "clustering", "--brain", "scripted", "--minutes", "600"]
    process = subprocess.Popen([*command, "--trials", "2", "--jobs", "2", "--out", str(tmp_path)],
                               stderr=subprocess.DEVNULL)  # fmt: skip
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    workers: list[str] = []
    end = time.monotonic() + HANG
    while len(workers) < 3 and time.monotonic() < end:  # two workers and multiprocessing's resource tracker
        time.sleep(0.1)
        workers = children.read_text().split()
    process.kill()
    process.wait()
    assert len(workers) >= 3
    while any(map(alive, workers)) and time.monotonic() < end:
        time.sleep(0.1)
    assert not any(map(alive, workers))


def test_a_film_of_one_robot_is_drawn_and_logged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The filmstrip of a robot has increasing times in its log; a robot that does not exist is refused."""
    run("--trials", 1, "--jobs", 1, "--set", "clock.sample_s=0.1", "--out", tmp_path / "run")
    capsys.readouterr()
    assert main(["plot", str(tmp_path / "run"), "--film", "0", "--out", str(tmp_path)]) == 0
    *lines, name = capsys.readouterr().out.splitlines()
    assert Path(name).stat().st_size > 5000
    assert "wheels    0    0 mm/s" in lines[0]
    assert len(lines) > 2
    times = [float(line.split()[0]) for line in lines]
    assert times == sorted(times)
    assert times[1] > 1.0  # after the OK key of the remote control
    assert main(["plot", str(tmp_path / "run"), "--film", "5", "--out", str(tmp_path)]) == 2
    assert "has robots 0 to 4" in capsys.readouterr().err


def test_one_command_runs_every_arm_and_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If `arena experiment` is repeated, it writes the same report without running a trial."""
    command = ["experiment", "clustering", "--brains", "scripted", "--trials", "2", "--minutes", "0.05", "--twins", "0",
               "--at", "2", "--jobs", "1", "--out", str(tmp_path)]  # fmt: skip
    texts = []
    for _ in range(2):
        assert main(command) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    assert (
        texts[0].index("### Controller A") < texts[0].index("| scripted-A | 2 |") < texts[0].index("### Controller B")
    )
    assert sorted(contents(tmp_path / "scripted-B")) == ["trial-0001.parquet", "trial-0002.parquet"]
    assert main([*command, "--controllers", "X"]) == 2
    assert "expected some of AB" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--document", "new.md"], "new.md"),
        (["--document", "plain.md"], "has no marks for results"),
        (["--figures", "plain.md/figures"], "plain.md/figures"),
        (["--at", "60"], "last 3 s, less than --at 60"),
        (["--twins", "2", "--twin-minutes", "0.01"], "two arms have the folder"),
        (["--brains", "scripted,lost.elf"], "--brain lost.elf: no such file"),
        (["--controllers", "AA"], "two arms have the folder"),
    ],
)
def test_an_experiment_checks_every_argument_before_its_first_trial(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`arena experiment` checks every argument first: a wrong argument ends with status 2 before a trial has run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plain.md").write_text("# No marks\n")
    command = ["experiment", "clustering", "--brains", "scripted", "--trials", "2", "--minutes", "0.05", "--twins", "0",
               "--controllers", "A", "--at", "2", "--jobs", "1", "--out", "out"]  # fmt: skip
    assert main([*command, *words]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_experiment_finds_the_folder_of_another_run_before_its_first_trial(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`arena experiment` checks the folders of all arms, including the last one, before it runs the first arm."""
    arm = ["run", "clustering", "--brain", "scripted", "--controller", "B", "--trials", "1", "--jobs", "1"]
    assert main([*arm, "--minutes", "0.03", "--out", str(tmp_path / "scripted-B")]) == 0
    command = ["experiment", "clustering", "--brains", "scripted", "--trials", "2", "--minutes", "0.05", "--twins", "0",
               "--at", "2", "--jobs", "1", "--out", str(tmp_path)]  # fmt: skip
    capsys.readouterr()
    assert main(command) == 2
    assert "scripted-B: holds another run (different seconds)" in capsys.readouterr().err
    assert not (tmp_path / "scripted-A").exists()


def test_a_sweep_varies_the_number_of_robots_of_a_single_group(tmp_path: Path) -> None:
    """`--vary robots.count` changes `count` of the only [[robots]] table."""
    (tmp_path / "mine.toml").write_text('name = "mine"\n[[robots]]\nimage = "scripted"\n')
    command = ["sweep", str(tmp_path / "mine.toml"), "--vary", "robots.count=2,3", "--trials", "1", "--minutes", "0.02"]
    assert main([*command, "--jobs", "1", "--out", str(tmp_path / "out")]) == 0
    counts = [read_trial(path).robots.shape[1] for path in sorted((tmp_path / "out").rglob("trial-*.parquet"))]
    assert counts == [2, 3]
