"""Videos of trials: GIF with Pillow, MP4 with ffmpeg."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from arena.cli import main
from arena.replay import video
from arena.replay.page import trial_data
from arena.replay.video import SCALE, frames
from arena.trial.record import read_trial
from tests.emu.avr.conftest import needs
from tests.watchdog import HANG


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run eight simulated seconds of two robots."""
    out = tmp_path_factory.mktemp("run")
    arguments = ["--brain", "scripted", "--trials", "1", "--minutes", "0.1333", "--robots", "2", "--jobs", "1"]
    assert main(["run", "clustering", *arguments, "--out", str(out)]) == 0
    return out / "trial-0001.parquet"


def test_a_gif_has_a_frame_for_every_time_it_shows(trial: Path, tmp_path: Path) -> None:
    """A video of 8 s at 4 times real time and 12.5 frames per second has 26 frames of 80 ms."""
    out = tmp_path / "trial.gif"
    assert main(["replay", str(trial), "--export", str(out), "--speed", "4"]) == 0
    with Image.open(out) as film:
        durations = []
        for frame in range(film.n_frames):
            film.seek(frame)
            durations.append(film.info["duration"])
        assert sum(durations) in (25 * 80, 26 * 80)
        assert len(durations) >= 17  # one per sample; equal frames are merged
        assert film.size[0] == round(400 * SCALE)
    assert [path.name for path in tmp_path.iterdir()] == ["trial.gif"]


def test_frames_show_the_objects_where_the_record_has_them(trial: Path) -> None:
    """In each frame a disc in the colour of its object or cluster is at the position of the object."""
    record = read_trial(trial)
    (first, last) = frames(record, [0.0, 8.0])
    for picture, sample in ((first, 0), (last, -1)):
        for x, y in record.objects[sample]:
            assert picture.getpixel((x * SCALE, 300 * SCALE - y * SCALE)) != (255, 255, 255)
    x, y = record.robots[-1][0]
    assert last.getpixel((x * SCALE, 300 * SCALE - y * SCALE)) != (255, 255, 255)
    assert first.tobytes() != last.tobytes()


def test_an_object_of_a_kind_is_as_large_as_its_kind(trial: Path) -> None:
    """The radius of a kind of objects overrides that of `[objects]`."""
    record = read_trial(trial)
    kind = record.scene.kind_of(0)
    large = replace(kind, radius_cm=3 * kind.radius_cm, count=record.scene.objects.count)
    object.__setattr__(record, "scene", replace(record.scene, kinds=(large,)))
    (picture,) = frames(record, [0.0])
    x, y = record.objects[0][0]
    beside = (x + 2 * kind.radius_cm * (1 if x < 200 else -1)) * SCALE, 300 * SCALE - y * SCALE
    assert picture.getpixel(beside) != (255, 255, 255)


def test_a_gif_keeps_the_colours_of_clusters(trial: Path, tmp_path: Path) -> None:
    """The palette of a GIF contains colours that appear only after the first frame."""
    record = read_trial(trial)
    for axis, away in (("x", 10.0), ("y", 0.0)):
        met = record.columns[f"o0_{axis}"] + away
        met[0] = record.columns[f"o1_{axis}"][0]
        record.columns[f"o1_{axis}"] = met
    video.write_video(record, tmp_path / "met.gif", 4.0)
    with Image.open(tmp_path / "met.gif") as film:
        film.seek(film.n_frames - 1)
        x, y = record.objects[-1][1]
        shown = film.convert("RGB").getpixel((x * SCALE, 300 * SCALE - y * SCALE))
    assert shown in video._CLUSTERS


def test_an_mp4_plays_the_same_frames(trial: Path, tmp_path: Path) -> None:
    """An MP4, decoded by the same ffmpeg, has the expected frames and size."""
    try:
        encoder = video._ffmpeg()
    except ValueError:
        pytest.skip("ffmpeg is not installed (extra: film)")
    out = tmp_path / "trial.mp4"
    assert main(["replay", str(trial), "--export", str(out), "--speed", "4", "--seconds", "4"]) == 0
    command = [encoder, "-i", str(out), "-f", "rawvideo", "-pix_fmt", "rgb24", "-loglevel", "error", "-"]
    raw = subprocess.run(command, capture_output=True, timeout=HANG, check=True).stdout
    size = next(frames(read_trial(trial), [0.0])).size
    assert len(raw) == 13 * size[0] * size[1] * 3


def test_without_ffmpeg_an_mp4_is_refused_with_what_to_install(
    trial: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without ffmpeg, an MP4 is refused with exit status 2 and the package to install; a GIF is written."""
    monkeypatch.setattr(video.shutil, "which", lambda _name: None)
    monkeypatch.setitem(video.__dict__, "importlib", _NothingInstalled())
    assert main(["replay", str(trial), "--export", str(tmp_path / "a.mp4")]) == 2
    assert ".mp4 needs ffmpeg" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


class _NothingInstalled:
    @staticmethod
    def import_module(name: str) -> object:
        raise ImportError(name)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--export", "film.avi"], "expected a name that ends in .gif or .mp4"),
        (["--out", "film.gif"], "--out film.gif: writes an HTML page; --export film.gif writes a video"),
        (["--export", "film.gif", "--speed", "0"], "expected a positive number of at most 1e7"),
        (["--export", "film.gif", "--speed", "1e-4"], "the limit is 20000"),
        (["--export", "nowhere/film.gif"], "cannot be written"),
    ],
)
def test_films_that_cannot_be_are_explained(
    trial: Path,
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Invalid options of a video end with exit status 2, and no file is left."""
    monkeypatch.chdir(tmp_path)
    assert main(["replay", str(trial), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_reported_and_leaves_no_half_film(
    trial: Path, tmp_path: Path, unwritable: set[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """If every write fails with ENOSPC, the failure is reported and no partial video is left."""
    unwritable.add("film.gif")
    assert main(["replay", str(trial), "--export", str(tmp_path / "film.gif")]) == 2
    assert "film.gif: cannot be written: No space left" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_frames_of_many_robots_have_no_camera_strips(tmp_path: Path) -> None:
    """A frame of up to 50 robots has a line for each; a frame of more robots is not higher than that of none."""
    heights = {}
    for robots in (1, 50, 51):
        out = tmp_path / str(robots)
        words = ["clustering", "--brain", "scripted", "--robots", str(robots), "--objects", "0"]
        assert main(["run", *words, "--trials", "1", "--minutes", "0.01", "--out", str(out)]) == 0
        heights[robots] = next(frames(read_trial(out / "trial-0001.parquet"), [0.0])).height
    assert heights[50] - heights[1] == 49 * (heights[1] - heights[51])


def test_a_film_shows_the_leds_of_kilobots(tmp_path: Path) -> None:
    """Kilobots are drawn with their radius, in the colour of the LED, and without camera strips."""
    needs("avr-gcc")
    path = tmp_path / "scene.toml"
    path.write_text('name = "test"\n[arena]\nwidth_cm = 40\nheight_cm = 40\n[clock]\nquantum_ms = 10\n[[robots]]\n'
                    'kind = "kilobot"\nimage = "gradient"\nplace = "poses"\nposes = '
                    '[[10, 10, 90], [15, 10, 90]]\n')  # fmt: skip
    assert main(["run", str(path), "--trials", "1", "--minutes", "0.05", "--out", str(tmp_path / "out")]) == 0
    trial = read_trial(tmp_path / "out/trial-0001.parquet")
    first, last = frames(trial, [0.0, 3.0])
    scale = SCALE * 3.7 / 1.65
    assert first.size == (252, round(40 * scale) + 18 + 2 * 14)  # three lines: the caption is wider than the arena
    assert first.size == last.size
    for number, colour in enumerate(((85, 0, 0), (85, 85, 0))):
        at = (10 + 5 * number + 1) * scale, 40 * scale - 10 * scale
        assert (first.getpixel(at), last.getpixel(at)) == ((221, 221, 221), colour)
    edge = (10 - 2.2) * scale, 40 * scale - 10 * scale
    assert last.getpixel(edge) == (255, 255, 255)
    assert [one["kind"] for one in trial_data(trial)["bodies"]] == ["kilobot", "kilobot"]
