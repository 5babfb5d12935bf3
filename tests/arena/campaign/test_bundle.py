"""Bundles: reproducible archives, detection of modified files, verification by repeated trials."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path

import pytest

from arena.campaign import bundle, campaign
from arena.cli import main
from arena.trial import versions
from arena.trial.record import RecordError
from tests.json_schemas import validated


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, talking_image: Path) -> Path:
    """Create a run with two scripted trials and a run with one firmware trial."""
    folder = tmp_path_factory.mktemp("study")
    short = ["--minutes", "0.02", "--jobs", "1", "--robots", "2", "--objects", "3"]
    words = ["run", "clustering", *short]
    assert main([*words, "--brain", "scripted", "--trials", "2", "--out", str(folder / "script")]) == 0
    words += ["--brain", str(talking_image), "--trials", "1", "--out", str(folder / "talk")]
    assert main(words) in (0, 1)
    return folder


@pytest.fixture
def packed(study: Path, tmp_path: Path) -> Path:
    """Pack the runs into a bundle and return its path."""
    path = tmp_path / "study.zip"
    bundle.pack([study / "script", study / "talk"], path)
    return path


def test_the_same_runs_give_the_same_file(study: Path, packed: Path, tmp_path: Path) -> None:
    """The bytes of a bundle do not depend on time or order of the runs."""
    again = tmp_path / "again.zip"
    bundle.pack([study / "talk", study / "script"], again)
    assert again.read_bytes() == packed.read_bytes()


def test_a_bundle_is_computed_again_to_the_byte(packed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`verify` runs all trials of a bundle again, with firmware and scripted, and reproduces their bytes."""
    assert main(["verify", str(packed), "--trials", "9", "--strict"]) == 0
    output = capsys.readouterr().out.splitlines()
    assert output[:3] == [
        f"{name}: equal to the byte" for name in ("script, trial 1", "script, trial 2", "talk, trial 1")
    ]
    assert main(["verify", str(packed), "--number", "2", "--json"]) == 0
    found = validated("arena", "verify", capsys.readouterr().out)
    assert [(one["run"], one["number"], one["equal"]) for one in found["trials"]] == [("script", 2, True)]


def test_another_version_is_told_and_values_are_compared(
    packed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Records of another version differ in bytes, because each record names its version, but their values can be
    equal."""
    changed = versions.versions() | {"pymunk": "99"}
    monkeypatch.setattr(campaign, "versions", lambda: changed)
    assert main(["verify", str(packed)]) == 0
    assert "all values equal, other versions (pymunk" in capsys.readouterr().out
    assert main(["verify", str(packed), "--strict"]) == 1


def test_a_bundle_of_another_version_with_other_values_names_its_commit(
    packed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """If versions and values differ, `verify` ends with status 1 and names the commit that computed the recorded
    values."""
    with zipfile.ZipFile(packed) as archive:
        manifests = {f"{run}/manifest.json": archive.read(f"{run}/manifest.json") for run in ("script", "talk")}
        exchanged = {"script/trial-0001.parquet": archive.read("script/trial-0002.parquet")}
    expected = []
    for commit in ("0123abcd", 7):
        for name, manifest in manifests.items():
            exchanged[name] = json.dumps(json.loads(manifest) | {"made_on": {"commit": commit}}).encode()
        changed = rewritten(packed, tmp_path / f"{commit}.zip", listed(packed, exchanged))
        with monkeypatch.context() as patch:
            patch.setattr(campaign, "versions", lambda: versions.versions() | {"arena": "99"})
            assert main(["verify", str(changed)]) == 1
        expected.append(capsys.readouterr().out.splitlines())
    for lines in expected:
        assert "script, trial 1: different in" in lines[0]
        assert "99 now" in lines[0]
        assert lines[-1].startswith(
            "the bundle was made with other versions, which may compute other values: verify it"
        )
    assert "commit 0123abcd" in expected[0][-1]
    assert expected[1][-1].endswith("with the versions that it names")
    assert main(["verify", str(changed)]) == 1
    assert "other versions" not in capsys.readouterr().out


def test_a_verification_of_no_trial_is_an_error(packed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`verify` without a trial to run proves nothing and ends with status 2."""
    assert main(["verify", str(packed), "--trials", "0"]) == 2
    assert "--trials: '0': expected" in capsys.readouterr().err
    message = "verified nothing: no run has a trial 9; choose another --number"
    for words in (["--number", "9"], ["--number", "9", "--json"]):
        assert main(["verify", str(packed), *words]) == 2
        output, error = capsys.readouterr()
        assert (message in error, message in output) == (True, "--json" in words)


def test_a_light_bundle_says_as_much(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A light bundle, which has hashes instead of records, distinguishes equal bytes, equal values and differing
    columns."""
    light, whole = tmp_path / "light.zip", tmp_path / "whole.zip"
    runs = [str(study / "script"), str(study / "talk")]
    assert main(["bundle", "--light", str(light), *runs]) == main(["bundle", str(whole), *runs]) == 0
    with zipfile.ZipFile(light) as archive:
        assert not [name for name in archive.namelist() if name.endswith(".parquet")]
        digest = json.loads(archive.read("script/trial-0001.json"))
        contents = json.loads(archive.read("bundle.json"))
    assert light.stat().st_size < whole.stat().st_size
    assert main(["verify", str(light), "--trials", "9", "--strict"]) == 0
    digest |= {"sha256": "0" * 64, "columns": digest["columns"] | {"r1_x": "0" * 64}}
    changed = json.dumps(digest).encode()
    contents["files"]["script/trial-0001.json"] = hashlib.sha256(changed).hexdigest()
    change = {"script/trial-0001.json": changed, "bundle.json": json.dumps(contents).encode()}
    capsys.readouterr()
    assert main(["verify", str(rewritten(light, tmp_path / "changed.zip", change))]) == 1
    assert "script, trial 1: different in r1_x\n" in capsys.readouterr().out
    monkeypatch.setattr(campaign, "versions", lambda: versions.versions() | {"pymunk": "99"})
    assert main(["verify", str(light)]) == 0
    assert "all values equal, other versions (pymunk" in capsys.readouterr().out
    change["script/trial-0001.json"] = b"[]"
    contents["files"]["script/trial-0001.json"] = hashlib.sha256(b"[]").hexdigest()
    change["bundle.json"] = json.dumps(contents).encode()
    assert main(["verify", str(rewritten(light, tmp_path / "changed.zip", change))]) == 2
    assert "not the digest of a trial" in capsys.readouterr().err


def test_the_beginning_of_a_trial_is_verified_by_its_own_hash(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`verify --beginning` runs only the first seconds, with and without firmware, and finds other values in them."""
    monkeypatch.setattr(bundle, "BEGINNING_S", 0.6)
    light, changed = tmp_path / "light.zip", tmp_path / "changed.zip"
    bundle.pack([study / "script", study / "talk"], light, light=True)
    assert main(["verify", str(light), "--beginning"]) == 0
    output = capsys.readouterr().out
    assert "script, trial 1, first 0.6 s: all values equal" in output or "first 0.6 s: equal" in output
    with zipfile.ZipFile(light) as archive:
        digest = json.loads(archive.read("talk/trial-0001.json"))
    for beginning, status, words in (("0" * 64, 1, "talk, trial 1, first 0.6 s: different in the first 0.6 s"),
                                     ("", 2, "has no hashes of the first 0.6 s; pack it again")):  # fmt: skip
        other = {"talk/trial-0001.json": json.dumps(digest | {"beginning": beginning}).encode()}
        assert main(["verify", str(rewritten(light, changed, listed(light, other))), "--beginning"]) == status
        assert words in "".join(capsys.readouterr())


def test_a_record_that_is_not_what_the_plan_gives_is_found(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """If two records were exchanged before packing, all hashes match, but `verify` finds that repeated trials
    differ."""
    run = tmp_path / "script"
    run.mkdir()
    for path in (study / "script").iterdir():
        if path.suffix in (".parquet", ".json"):
            (run / path.name).write_bytes(path.read_bytes())
    (run / "trial-0001.parquet").write_bytes((study / "script" / "trial-0002.parquet").read_bytes())
    assert main(["bundle", str(tmp_path / "b.zip"), str(run)]) == 0
    capsys.readouterr()
    assert main(["verify", str(tmp_path / "b.zip")]) == 1
    assert "script, trial 1: different in o0_x" in capsys.readouterr().out


def rewritten(packed: Path, target: Path, change: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(packed) as archive, zipfile.ZipFile(target, "w") as made:
        for name in archive.namelist():
            made.writestr(name, change.get(name, archive.read(name)))
        for name in set(change) - set(archive.namelist()):
            made.writestr(name, change[name])
    return target


def listed(packed: Path, change: dict[str, bytes]) -> dict[str, bytes]:
    """Return `change` and a list of files with the hashes of the changed contents."""
    with zipfile.ZipFile(packed) as archive:
        contents = json.loads(archive.read("bundle.json"))
    contents["files"] |= {name: hashlib.sha256(data).hexdigest() for name, data in change.items()}
    return change | {"bundle.json": json.dumps(contents).encode()}


def test_changed_files_and_archives_that_are_none_are_refused(packed: Path, tmp_path: Path) -> None:
    """A changed file or an invalid archive is refused with a one-line message, and no file is written outside the
    folder."""
    with zipfile.ZipFile(packed) as archive:
        contents = json.loads(archive.read("bundle.json"))
    evil = contents["files"] | {"../evil": "0" * 64}
    cases = {
        "its hash differs": {"script/manifest.json": b"{}"},
        "its files differ from the list": {"script/more.txt": b"more"},
        "is not a file of a run": {"bundle.json": json.dumps({"files": evil}).encode(), "../evil": b"x"},
        "not a bundle": {"bundle.json": b"[]"},
    }
    for words, change in cases.items():
        path = rewritten(packed, tmp_path / "changed.zip", change)
        with pytest.raises(RecordError, match=words):
            bundle.unpack(path, tmp_path / "out")
    assert not (tmp_path / "evil").exists()
    whole = packed.read_bytes()
    for cut in (0, 10, len(whole) // 2, len(whole) - 3):
        (tmp_path / "cut.zip").write_bytes(whole[:cut])
        with pytest.raises(RecordError):
            bundle.unpack(tmp_path / "cut.zip", tmp_path / "out")


def test_only_runs_can_be_packed(study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder without a finished run is refused with status 2."""
    assert main(["bundle", str(tmp_path / "x.zip"), str(tmp_path)]) == 2
    assert "no finished run" in capsys.readouterr().err
    assert main(["bundle", str(tmp_path / "x.zip"), str(study / "talk"), str(study / "talk")]) == 2
    assert "the same name" in capsys.readouterr().err
    assert main(["verify", str(tmp_path / "none.zip")]) == 2


@pytest.mark.parametrize(("change", "message"), [
    ({"seconds": "6"}, "seconds is '6'; expected float"), ({"seconds": -1.0}, "seconds: invalid value -1.0"),
    ({"seed": "x"}, "seed is 'x'; expected int"), ({"controller": "Z"}, "controller: invalid value 'Z'"),
    ({"controller": ["A"]}, "manifest.json: "), ({"brain": None}, "brain is None; expected str"),
])  # fmt: skip
def test_a_manifest_that_is_no_plan_is_refused(
    change: dict[str, object], message: str, packed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A manifest with invalid values is refused with one line and status 2, although all hashes match."""
    with zipfile.ZipFile(packed) as archive:
        manifest = json.loads(archive.read("script/manifest.json"))
    manifest["key"] |= change
    changed = listed(packed, {"script/manifest.json": json.dumps(manifest).encode()})
    path = rewritten(packed, tmp_path / "x.zip", changed)
    assert main(["verify", str(path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


DEEP = b"[" * 100_000 + b"]" * 100_000


def test_nesting_encryption_and_other_compressions_are_refused(
    packed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exceptions of the zip and JSON readers other than ValueError are reported as invalid bundles."""
    rewritten(packed, tmp_path / "list.zip", {"bundle.json": DEEP})
    rewritten(packed, tmp_path / "manifest.zip", listed(packed, {"script/manifest.json": DEEP}))
    flagged = bytearray(packed.read_bytes())
    at = -1
    while (at := flagged.find(b"PK\x01\x02", at + 1)) >= 0:
        flagged[at + 8] |= 1
    (tmp_path / "secret.zip").write_bytes(flagged)
    with zipfile.ZipFile(tmp_path / "lzma.zip", "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("bundle.json", DEEP)
    damaged = bytearray((tmp_path / "lzma.zip").read_bytes())
    damaged[60] ^= 0xFF
    (tmp_path / "lzma.zip").write_bytes(damaged)
    for name in ("list", "manifest", "secret", "lzma"):
        assert main(["verify", str(tmp_path / f"{name}.zip")]) == 2, name
        assert capsys.readouterr().err.count("\n") == 1


def test_a_run_without_trials_proves_nothing(packed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run without trials is refused with status 2."""
    with zipfile.ZipFile(packed) as archive:
        names = [name for name in archive.namelist() if name.startswith("script/trial-")]
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(packed) as old, zipfile.ZipFile(path, "w") as new:
        contents = json.loads(old.read("bundle.json"))
        contents["files"] = {name: digest for name, digest in contents["files"].items() if name not in names}
        new.writestr("bundle.json", json.dumps(contents))
        for name in contents["files"]:
            new.writestr(name, old.read(name))
    assert main(["verify", str(path)]) == 2
    assert "run script has no trial" in capsys.readouterr().err
