"""Bundles: the runs of a study in one zip archive, with records, firmware, experiments, manifests and their hashes.

The bytes of the archive depend only on these files. `verify` runs selected trials again and compares the results. A
light bundle has hashes instead of records: it is a few hundred kB large and can be verified in the same way.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import math
import re
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from arena.campaign.campaign import Plan, run_one, trial_path
from arena.experiments import experiment_with_digest
from arena.robots.reactive import SPEED_TABLES
from arena.robots.user_controller import load_controller
from arena.scene.loader import scene_of
from arena.trial.manifest import MANIFEST, read_manifest
from arena.trial.record import EXPERIMENT, RecordError, read_trial, write_bytes

INDEX: Final = "bundle.json"
RECORD, DIGEST = "trial-*.parquet", "trial-*.json"
PATTERNS: Final = (MANIFEST, EXPERIMENT, RECORD, DIGEST, "firmware*", "controller-*.py")
LIMIT: Final = 1 << 32
"""Largest accepted size of an unpacked bundle, in bytes."""
INDEX_LIMIT: Final = 1 << 24
"""Largest accepted size of `bundle.json`, in bytes."""
READ_ERRORS: Final = (OSError, zipfile.BadZipFile, zlib.error, LookupError, TypeError, ValueError, AttributeError,
                 EOFError, RuntimeError, MemoryError, lzma.LZMAError)  # fmt: skip
"""Exceptions that a damaged archive or manifest can cause."""
_DATE: Final = (1980, 1, 1, 0, 0, 0)


def pack(folders: list[Path], target: Path, light: bool = False) -> str:
    """Write the runs in `folders` into one archive and return its SHA-256.

    Raises RecordError for a folder without a finished trial, folders of equal names, a symbolic link or folder instead
    of a file, or a failed write."""
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise RecordError("two of the folders have the same name; a bundle needs different ones")
    files: dict[str, bytes] = {}
    for name, folder in zip(names, folders, strict=True):
        if not any(folder.glob("trial-*.parquet")) or not (folder / MANIFEST).exists():
            raise RecordError(f"{folder}: no finished run (manifest.json and trial-*.parquet) here")
        for path in sorted(path for pattern in PATTERNS for path in folder.glob(pattern)):
            if path.is_symlink() or not path.is_file():
                raise RecordError(f"{path}: not a regular file: a bundle packs no symbolic link and no folder; "
                                  "replace it by a copy")  # fmt: skip
            if light and path.match(RECORD):
                digest = json.dumps(asdict(digest_of(path)), indent=0, sort_keys=True)
                files[f"{name}/{path.with_suffix('.json').name}"] = digest.encode()
            else:
                files[f"{name}/{path.name}"] = path.read_bytes()
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in sorted(files.items())}
    contents = json.dumps({"format": 1, "files": hashes}, indent=1).encode()
    with tempfile.TemporaryFile() as scratch:
        with zipfile.ZipFile(scratch, "w") as archive:
            for name, data in [(INDEX, contents), *sorted(files.items())]:
                entry = zipfile.ZipInfo(name, _DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, data)
        scratch.seek(0)
        whole = scratch.read()
    write_bytes(target, whole)
    return hashlib.sha256(whole).hexdigest()


BEGINNING_S: Final = 60.0
"""Simulated seconds that `verify --beginning` runs."""


@dataclass(frozen=True)
class Digest:
    """Digest of a record: SHA-256 of the file, of each column, and of all columns up to `BEGINNING_S`; its versions."""

    sha256: str
    columns: dict[str, str]
    versions: dict[str, str]
    beginning: str = ""


def digest_of(record: Path) -> Digest:
    """Return the digest of the file of a trial. Raises RecordError."""
    trial = read_trial(record)
    columns = {name: hashlib.sha256(_column_bytes(values)).hexdigest() for name, values in trial.columns.items()}
    whole, start = hashlib.sha256(record.read_bytes()).hexdigest(), hashlib.sha256()
    samples = int(np.searchsorted(trial.times, BEGINNING_S + 1e-3))
    for name, values in sorted(trial.columns.items()):
        start.update(f"{name} ".encode() + _column_bytes(values[:samples]))
    return Digest(whole, columns, trial.about.get("versions") or {}, start.hexdigest())


def _column_bytes(values: Any) -> bytes:
    """Return the values of a column as bytes that are equal for equal values."""
    if isinstance(values, np.ndarray):
        return f"{values.dtype.str} ".encode() + values.tobytes()
    return json.dumps(values, default=bytes.hex).encode()


def _expected_digest(folder: Path, number: int) -> Digest:
    """Return the digest of trial `number` in an unpacked run. Raises RecordError."""
    record = trial_path(folder, number)
    if record.exists():
        return digest_of(record)
    path = record.with_suffix(".json")
    try:
        found = json.loads(path.read_text())
        return Digest(found["sha256"], dict(found["columns"]), dict(found["versions"]), str(found.get("beginning", "")))
    except READ_ERRORS as error:
        raise RecordError(f"{path}: not the digest of a trial: {type(error).__name__}: {error}") from None


def _trial_numbers(folder: Path) -> list[int]:
    """Return the numbers of the trials in an unpacked run."""
    paths = {path.stem for pattern in (RECORD, DIGEST) for path in folder.glob(pattern)}
    return sorted(int(stem.partition("-")[2]) for stem in paths if stem.partition("-")[2].isdecimal())


@dataclass(frozen=True)
class Check:
    """Result of one repeated trial.

    `equal` means equal to the byte, or equal in all values if `versions` differ. `differs` names columns. `commit` is
    the commit of the project that made the run; empty if the manifest has none."""

    run: str
    number: int
    equal: bool
    differs: tuple[str, ...]
    versions: tuple[str, ...]
    commit: str = ""


def unpack(bundle: Path, folder: Path) -> list[Path]:
    """Unpack a bundle into `folder` and return the folders of its runs.

    Raises RecordError for a file that is not a bundle or was modified."""
    if not bundle.is_file():
        raise RecordError(f"{bundle}: not a bundle: no such file")
    try:
        with zipfile.ZipFile(bundle) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LIMIT:
                raise RecordError(f"{bundle}: would unpack to more than {LIMIT >> 30} GB")
            if archive.getinfo(INDEX).file_size > INDEX_LIMIT:
                raise RecordError(f"{bundle}: {INDEX} is larger than {INDEX_LIMIT >> 20} MB")
            hashes = json.loads(archive.read(INDEX))["files"]
            if set(archive.namelist()) != {INDEX, *hashes}:
                raise RecordError(f"{bundle}: its files differ from the list in bundle.json")
            for name, digest in hashes.items():
                parts = PurePosixPath(name).parts
                if len(parts) != 2 or ".." in parts or "\\" in name or name.startswith("/"):
                    raise RecordError(f"{bundle}: {name!r} is not a file of a run")
                (folder / parts[0]).mkdir(parents=True, exist_ok=True)
                if _extract(archive, name, folder / parts[0] / parts[1]) != digest:
                    raise RecordError(f"{bundle}: {name} was modified (its hash differs)")
    except RecordError:
        raise
    except READ_ERRORS as error:
        raise RecordError(f"{bundle}: not a bundle: {error}") from None
    return sorted({folder / PurePosixPath(name).parts[0] for name in hashes})


def _extract(archive: zipfile.ZipFile, name: str, target: Path) -> str:
    """Write a member of an archive to a file, in pieces, and return its SHA-256."""
    digest = hashlib.sha256()
    with archive.open(name) as source, target.open("wb") as file:
        while piece := source.read(1 << 20):
            digest.update(piece)
            file.write(piece)
    return digest.hexdigest()


def plan_of(folder: Path, own: Path | None = None, trust: bool = False) -> Plan:
    """Return the plan of an unpacked run from its manifest.

    The code of the run's own experiment runs only from the file `own`, or with `trust` from the copy in the run.
    Raises RecordError, SceneError."""
    try:
        key: dict[str, Any] = read_manifest(folder)["key"]
        scene = scene_of(key["scene"])
        groups = dict.fromkeys(group.image for group in scene.groups if group.image)
        firmware = {path.stem: path for path in folder.glob("firmware*")}
        hashes = key.get("images_sha256") or {}
        images = tuple((name, firmware[f"firmware-{place}"] if hashes.get(name) else None)
                       for place, name in enumerate(groups, start=1))  # fmt: skip
        image = firmware["firmware"] if key["image_sha256"] else None
        _check_key(key)
        experiment = _trusted_experiment(folder, scene.experiment, key.get("experiment_sha256"), own, trust)
        return Plan(scene, key["brain"], key["controller"], image, len(_trial_numbers(folder)), key["seconds"],
                    key["seed"], experiment, images, _trusted_controllers(folder, key, trust))  # fmt: skip
    except READ_ERRORS as error:
        raise RecordError(f"{folder / MANIFEST}: {type(error).__name__}: {error}") from None


def _trusted_experiment(folder: Path, name: str, digest: str | None, own: Path | None, trust: bool) -> Path | None:
    """Return the file of a run's own experiment; None if the run has a built-in or installed one.

    Raises RecordError without permission to run its code, SceneError if the hash of the file is not the recorded one.
    """
    if digest is None and not name.endswith(".py"):
        return None
    if digest is None:
        raise RecordError(f"{folder.name}: names the experiment file {name!r:.60} but not its hash; it cannot be run")
    if own is None and not trust:
        raise RecordError(f"{folder.name}: has an experiment file of its own, whose code is not run: name the file "
                          "with --experiment FILE, or accept the copy in the bundle with --trust")  # fmt: skip
    path = own or folder / EXPERIMENT
    experiment_with_digest(path, digest)
    return path


def _trusted_controllers(folder: Path, key: dict[str, Any], trust: bool) -> tuple[tuple[str, Path], ...]:
    """Return the files of a run's own controllers.

    Raises RecordError without permission to run their code, SceneError if the hash of a file is not the recorded one.
    """
    hashes: dict[str, str] = key.get("controllers_sha256") or {}
    if hashes and not trust:
        raise RecordError(f"{folder.name}: has controllers in Python, whose code is not run; accept the copies in the "
                          "bundle with --trust")  # fmt: skip
    files = tuple((name, folder / f"controller-{place}.py") for place, name in enumerate(hashes, start=1))
    for name, path in files:
        load_controller(path, hashes[name])
    return files


def _commit_of(folder: Path) -> str:
    """Return the commit that made a run, from its manifest; an empty text if it names none."""
    made_on = read_manifest(folder).get("made_on")
    commit = made_on.get("commit") if isinstance(made_on, dict) else None
    return commit if isinstance(commit, str) and re.fullmatch("[0-9a-f]{7,40}(-dirty)?", commit) else ""


def _check_key(key: dict[str, Any]) -> None:
    """Check the values of a manifest's key. Raises ValueError for values that no plan has."""
    for name, good in (
        ("controller", key["controller"] in {*SPEED_TABLES, *(key.get("controllers_sha256") or {})}),
        ("seconds", 0 < key["seconds"] < math.inf),
        ("seed", key["seed"] >= 0),
    ):
        if not good:
            raise ValueError(f"{name}: invalid value {key[name]!r:.40}")


def verify(bundle: Path, chosen: Callable[[list[int]], list[int]], own: Path | None = None,
           trust: bool = False, beginning: bool = False) -> Iterator[Check]:  # fmt: skip
    """Run trials of each run again and yield the results; `chosen` selects from the numbers of a run.

    With `beginning` only the first `BEGINNING_S` seconds are run and compared. `own` and `trust` permit to run the code
    of a run's own experiment, as in `plan_of`. Raises RecordError, SceneError, emu.LoadError."""
    with tempfile.TemporaryDirectory(prefix="arena-") as name:
        for folder in unpack(bundle, Path(name)):
            plan = plan_of(folder, own, trust)
            if beginning:
                plan = replace(plan, seconds=min(plan.seconds, BEGINNING_S))
            again = folder / "again"
            again.mkdir()
            numbers = _trial_numbers(folder)
            if not numbers:
                raise RecordError(f"{bundle}: run {folder.name} has no trial")
            for number in chosen(numbers):
                run_one(plan, number, again)
                expected, actual = _expected_digest(folder, number), digest_of(trial_path(again, number))
                if beginning and not expected.beginning:
                    raise RecordError(f"{bundle}: has no hashes of the first {BEGINNING_S:g} s; pack it again")
                yield replace(_compare(folder.name, number, expected, actual, beginning), commit=_commit_of(folder))


def _compare(run: str, number: int, expected: Digest, actual: Digest, beginning: bool) -> Check:
    """Compare the digests of a recorded and a repeated trial, with `beginning` those of the first seconds only."""
    if expected.sha256 == actual.sha256:
        return Check(run, number, True, (), ())
    now, then = actual.versions, expected.versions
    changed = tuple(
        f"{name} {then.get(name, '?')} then, {now[name]} now" for name in now if then.get(name) != now[name]
    )
    if beginning:
        is_equal = expected.beginning == actual.beginning
        return Check(run, number, is_equal, () if is_equal else (f"the first {BEGINNING_S:g} s",), changed)
    names = sorted({*expected.columns, *actual.columns})
    differs = tuple(name for name in names if expected.columns.get(name) != actual.columns.get(name))
    return Check(run, number, not differs and bool(changed), differs, changed)
