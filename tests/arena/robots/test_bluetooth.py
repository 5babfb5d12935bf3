"""Bluetooth between robots: bytes arrive at the partner at times that depend on the trial only."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from arena.cli import main
from arena.replay.page import sample_data, trial_data
from arena.scene.loader import FCY, SceneError, load_scene
from arena.trial.record import Trial, kind_of, read_trial
from tests.arena.robot_programs import ECHO

SCENE = """name = "pair"
[arena]
width_cm = 100.0
height_cm = 100.0
[[robots]]
count = 2
[[robots]]
name = "told"
stimulus = '0.2s uart1 "go"'
[start]
remote = ""
[bluetooth]
links = [[2, 0], [0, 1]]
period_ms = 50
"""


def run_trial(folder: Path, image: Path, *words: str, text: str = SCENE) -> Trial:
    """Run three robots that echo their input for half a second, and return the record."""
    scene = folder / "pair.toml"
    scene.write_text(text)
    command = ["run", str(scene), "--brain", str(image), "--trials", "1", "--minutes", "0.0084", "--out"]
    assert main([*command, str(folder / "out"), "--jobs", "1", *words]) == 0
    return read_trial(folder / "out" / "trial-0001.parquet")


def test_bytes_pass_from_robot_to_robot(assembled: Callable[[str], Path], tmp_path: Path) -> None:
    """Robot 2 receives "go" at 0.2 s and echoes it; its partner receives the echo one period later, and so on along
    the links."""
    trial = run_trial(tmp_path, assembled(ECHO))
    messages = [one for row in trial.columns["messages"] for one in row]
    said = [(one["robot"], one["to"], round(1000 * one["cycle"] / FCY), one["text"]) for one in messages]
    assert said[:3] == [(2, 0, 250, "go"), (0, 1, 300, "go"), (0, 2, 300, "go")]
    assert (1, 0, 350, "go") in said
    assert {(one, other) for one, other, _, _ in said} == {(2, 0), (0, 2), (0, 1), (1, 0)}
    assert all(time % 50 == 0 for *_, time, _ in said)
    assert trial_data(trial)["links"] == ((2.0, 0.0), (0.0, 1.0))
    assert sample_data(trial)["messages"] == trial.columns["messages"]


def test_the_record_is_the_same_for_two_threads(assembled: Callable[[str], Path], tmp_path: Path) -> None:
    """Records of trials with one and with two threads are equal to the byte."""
    image = assembled(ECHO)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    one, two = run_trial(tmp_path / "one", image), run_trial(tmp_path / "two", image, "--jobs", "2")
    assert one.path.read_bytes() == two.path.read_bytes()


def test_without_links_there_is_no_column_of_messages(assembled: Callable[[str], Path], tmp_path: Path) -> None:
    """A scene without links gives a record without the column of messages."""
    trial = run_trial(tmp_path, assembled(ECHO), text=SCENE[: SCENE.index("[bluetooth]")])
    assert "messages" not in trial.columns
    assert sample_data(trial)["messages"] == [[] for _ in trial.times]


@pytest.mark.parametrize(
    ("links", "words"),
    [
        ([[0, 0]], "two different robots of 0 to 4"), ([[0, 5]], "two different robots of 0 to 4"),
        ([[0, 0.5]], "two different robots of 0 to 4"), ([[0, 1, 2]], "two different robots of 0 to 4"),
        ([[0, 1], [1, 0]], "is listed twice"), ([0, 1], "expected a list of points"),
    ],
)  # fmt: skip
def test_invalid_links_are_refused(links: list[object], words: str) -> None:
    """Invalid links are refused with a message that names the valid robot numbers."""
    with pytest.raises(SceneError, match=words):
        load_scene("clustering").with_values(bluetooth__links=links)


def test_columns_of_supervisor_numbers_are_numbers_for_any_name() -> None:
    """A supervisor's number may have any name, also that of another column; its column n_NAME holds numbers."""
    for name in ("log", "messages", "lights", "seen", "strip"):
        assert kind_of(f"n_{name}") == kind_of("t")
