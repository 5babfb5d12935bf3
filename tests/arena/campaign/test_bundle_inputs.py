"""Hostile inputs of `arena bundle` and `arena verify`: links in a run, devices, an index that is too large."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from arena.campaign.bundle import INDEX_LIMIT, unpack
from arena.cli import main
from arena.trial.record import RecordError


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return the folder of a run with one scripted trial."""
    folder = tmp_path / "run"
    words = ["--brain", "scripted", "--trials", "1", "--minutes", "0.01", "--jobs", "1", "--out", str(folder)]
    assert main(["run", "clustering", *words]) == 0
    return folder


@pytest.mark.parametrize("kind", ["link", "broken link", "folder"])
def test_a_link_in_a_run_is_not_packed(
    kind: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A link in a run is not packed, because its target may be a private file outside of the run."""
    secret = tmp_path / "secret"
    if kind == "link":
        secret.write_text("private")
    if kind == "folder":
        (run / "firmware.bak").mkdir()
    else:
        (run / "firmware.bak").symlink_to(secret)
    assert main(["bundle", str(tmp_path / "x.zip"), str(run)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "firmware.bak: not a regular file" in error
    assert not (tmp_path / "x.zip").exists()
    (run / "firmware.bak").rmdir() if kind == "folder" else (run / "firmware.bak").unlink()
    assert main(["bundle", str(tmp_path / "x.zip"), str(run)]) == 0


def test_an_index_of_blanks_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An index of blanks, which a small archive can unpack to gigabytes, is refused by its size before it is read."""
    path = tmp_path / "blank.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bundle.json", " " * INDEX_LIMIT + json.dumps({"files": {}}))
    assert main(["verify", str(path)]) == 2
    assert "bundle.json is larger than 16 MB" in capsys.readouterr().err


def test_a_bundle_that_unpacks_to_too_much_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The sizes in the archive's directory count; zipfile unpacks no more of a member than they say."""
    path, folder = tmp_path / "large.zip", tmp_path / "unpacked"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("bundle.json", json.dumps({"files": {"run/a": "", "run/b": ""}}))
        for name in ("run/a", "run/b"):
            archive.writestr(name, b"")
            archive.infolist()[-1].file_size = 1 << 31
    assert main(["verify", str(path)]) == 2
    assert "would unpack to more than 4 GB" in capsys.readouterr().err
    with pytest.raises(RecordError, match="would unpack to more than 4 GB"):
        unpack(path, folder)
    assert not folder.exists()


@pytest.mark.parametrize("name", ["/dev/zero", "nothing.zip"])
def test_what_is_no_file_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A device and a missing file are refused with one line and status 2."""
    assert main(["verify", name]) == 2
    assert f"{name}: not a bundle: no such file" in capsys.readouterr().err
