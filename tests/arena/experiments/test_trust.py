"""Records of a user-defined experiment: without permission, no command runs code that a record or a bundle names."""

from __future__ import annotations

import json
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from arena import experiments
from arena.cli import main
from arena.scene import user_file

SCENE = """name = "mine"
experiment = "mine.py"
[arena]
width_cm = 100
height_cm = 100
[[robots]]
count = 2
place = "poses"
poses = [[30, 50, 0], [60, 50, 180]]
"""
EXPERIMENT = """import pathlib
from arena.experiments import Curve, Measure

pathlib.Path({mark!r}).write_text("ran")
CURVES = [Curve("apart", "distance of the two robots", "cm")]
{measures}


def metrics(sample):
    (x, y, _), (ox, oy, _) = sample.robots
    return {{"apart": ((x - ox) ** 2 + (y - oy) ** 2) ** 0.5}}
"""
MEASURES = 'MEASURES = [Measure("half", "half at {at:g} s", lambda series, at: series.at(at, "apart") / 2)]'


def arena(*words: object) -> tuple[int, str]:
    """Run `arena` with empty caches, as in a new process. Return exit status and standard error."""
    experiments._loaded.clear()
    experiments._load_source.cache_clear()
    user_file.run_module.cache_clear()
    with redirect_stderr(StringIO()) as said:
        return main([*map(str, words)]), said.getvalue()


class Study:
    """A run of a user-defined experiment; the code of the experiment writes the file `mark` whenever it runs."""

    def __init__(self, folder: Path, measures: str = "") -> None:
        self.mark = folder / "mark"
        self.code = folder / "mine.py"
        self.code.write_text(EXPERIMENT.format(mark=str(self.mark), measures=measures))
        (folder / "mine.toml").write_text(SCENE)
        self.run = folder / "out"
        status, error = arena("run", folder / "mine.toml", "--brain", "scripted", "--trials", 2, "--minutes", 0.02,
                              "--jobs", 1, "--out", self.run)  # fmt: skip
        assert status == 0, error
        self.record = self.run / "trial-0001.parquet"

    def ran(self, *words: object, status: int = 0) -> tuple[bool, str]:
        """Run a command. Return whether the experiment's code ran, and the standard error of the command."""
        self.mark.unlink(missing_ok=True)
        ended, error = arena(*words)
        assert ended == status, error
        return self.mark.exists(), error


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Return a run whose experiment has the default measures."""
    return Study(tmp_path_factory.mktemp("study"))


def with_metadata(record: Path, target: Path, **scene: object) -> Path:
    """Copy a record, change values of its scene, and remove the declaration and the hash of its experiment."""
    table = pq.read_table(record)
    about = json.loads(table.schema.metadata[b"arena"])
    about["scene"].update(scene)
    for key in ("experiment", "experiment_sha256"):
        about.pop(key, None)
    pq.write_table(table.replace_schema_metadata({"arena": json.dumps(about)}), target)
    return target


def test_reading_a_record_runs_no_code_and_shows_its_curves(study: Study, tmp_path: Path) -> None:
    """Page, figures, report and comparison use the recorded declaration and curves and run no code."""
    page = tmp_path / "page.html"
    assert study.ran("replay", study.record, "--out", page) == (False, "")
    assert "distance of the two robots" in page.read_text()
    assert study.ran("plot", study.run, "--out", tmp_path) == (False, "")
    assert (tmp_path / "curves.png").stat().st_size > 5000
    assert study.ran("report", study.run, "--at", 1) == (False, "")
    assert study.ran("compare", study.run, study.run, "--at", 1) == (False, "")


def test_trust_runs_the_recorded_copy_or_a_named_file(study: Study, tmp_path: Path) -> None:
    """`--trust` and `--experiment` run the experiment's code; the page equals the one made without it."""
    pages = [tmp_path / f"{number}.html" for number in range(3)]
    assert study.ran("replay", study.record, "--trust", "--out", pages[0])[0]
    assert study.ran("replay", study.record, "--experiment", study.code, "--out", pages[1])[0]
    assert not study.ran("replay", study.record, "--out", pages[2])[0]
    assert pages[0].read_text() == pages[1].read_text() == pages[2].read_text()


def test_a_file_with_another_hash_is_not_run(study: Study, tmp_path: Path) -> None:
    """A changed copy beside the record and a named file with another hash are refused before they run."""
    other = tmp_path / "experiment.py"
    other.write_text(study.code.read_text() + "\n")
    record = tmp_path / "trial-0001.parquet"
    record.write_bytes(study.record.read_bytes())
    for words in (["--trust"], ["--experiment", other]):
        ran, error = study.ran("replay", record, *words, status=2)
        assert not ran
        assert error.count("\n") == 1
        assert "is not the recorded experiment" in error


@pytest.mark.parametrize("command", ["replay", "plot", "report", "compare"])
def test_a_record_that_names_a_foreign_file_does_not_run_it(study: Study, tmp_path: Path, command: str) -> None:
    """The file that the record's scene names is not executed, with or without `--trust`."""
    folder = tmp_path / "evil"
    folder.mkdir()
    (folder / "manifest.json").write_bytes((study.run / "manifest.json").read_bytes())
    for number in (1, 2):
        name = f"trial-000{number}.parquet"
        with_metadata(study.run / name, folder / name, experiment=str(study.code))
    (folder / "experiment.py").write_bytes(study.code.read_bytes())
    words: dict[str, list[object]] = {
        "replay": [folder / "trial-0001.parquet", "--out", tmp_path / "x.html"],
        "plot": [folder, "--out", tmp_path],
        "report": [folder, "--at", 1],
        "compare": [folder, folder, "--at", 1],
    }
    ran, error = study.ran(command, *words[command], status=0 if command == "replay" else 2)
    assert not ran
    assert command == "replay" or (error.count("\n") == 1 and "needs the experiment's code" in error)
    ran, error = study.ran(command, *words[command], "--trust", status=2)
    assert not ran
    assert "not its hash" in error


def test_measures_of_the_experiment_need_its_code(tmp_path: Path) -> None:
    """`compare` refuses measures of an untrusted experiment in one sentence, and computes them with `--trust`."""
    study = Study(tmp_path, MEASURES)
    ran, error = study.ran("compare", study.run, study.run, "--at", 1, status=2)
    assert not ran
    assert error.count("\n") == 1
    assert "measure half: needs the experiment's code" in error
    assert study.ran("compare", study.run, study.run, "--at", 1, "--trust") == (True, "")


def test_verify_runs_the_experiment_of_a_bundle_only_with_permission(study: Study, tmp_path: Path) -> None:
    """`verify` refuses a bundle with code in one sentence; with `--trust` or `--experiment` it verifies the bundle."""
    bundle = tmp_path / "study.zip"
    assert study.ran("bundle", bundle, study.run) == (False, "")
    ran, error = study.ran("verify", bundle, status=2)
    assert not ran
    assert error.count("\n") == 1
    assert "--trust" in error
    assert study.ran("verify", bundle, "--trust")[0]
    assert study.ran("verify", bundle, "--experiment", study.code)[0]
