"""A study as one file: records, images, experiments, manifests and the hash of each, in a zip archive.

What enters: folders of runs; what leaves: an archive whose bytes depend on these files alone, and `verify`, which
computes chosen trials again and compares. A light bundle has the hashes of the records instead of the records: a few
hundred kB that say as much about what a trial must be.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import math
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from arena.campaign.campaign import Plan, run_one, trial_path
from arena.robots.reactive import CONTROLLERS
from arena.scene.loader import scene_of
from arena.trial.manifest import MANIFEST, read_manifest
from arena.trial.record import EXPERIMENT, RecordError, read_trial, write_bytes

CONTENTS: Final = "bundle.json"
RECORD, DIGEST = "trial-*.parquet", "trial-*.json"
KEPT: Final = (MANIFEST, EXPERIMENT, RECORD, DIGEST, "firmware*")
LIMIT: Final = 1 << 32
"""Bytes of everything unpacked: more is no study of ours."""
DAMAGE: Final = (OSError, zipfile.BadZipFile, zlib.error, LookupError, TypeError, ValueError, AttributeError,
                 EOFError, RuntimeError, lzma.LZMAError)  # fmt: skip
"""What reading an archive that is none, or another one, can end in."""
_DATE: Final = (1980, 1, 1, 0, 0, 0)


def pack(folders: list[Path], target: Path, light: bool = False) -> str:
    """Write the runs in `folders` into one archive; its SHA-256. Raises RecordError for a folder without a finished
    trial, two folders of one name, or an archive that cannot be written."""
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise RecordError("two of the folders have the same name; a bundle needs different ones")
    files: dict[str, bytes] = {}
    for name, folder in zip(names, folders, strict=True):
        if not any(folder.glob("trial-*.parquet")) or not (folder / MANIFEST).exists():
            raise RecordError(f"{folder}: no finished run (manifest.json and trial-*.parquet) here")
        for path in sorted(path for pattern in KEPT for path in folder.glob(pattern)):
            if light and path.match(RECORD):
                digest = json.dumps(asdict(digest_of(path)), indent=0, sort_keys=True)
                files[f"{name}/{path.with_suffix('.json').name}"] = digest.encode()
            else:
                files[f"{name}/{path.name}"] = path.read_bytes()
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in sorted(files.items())}
    contents = json.dumps({"format": 1, "files": hashes}, indent=1).encode()
    with tempfile.TemporaryFile() as scratch:
        with zipfile.ZipFile(scratch, "w") as archive:
            for name, data in [(CONTENTS, contents), *sorted(files.items())]:
                entry = zipfile.ZipInfo(name, _DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, data)
        scratch.seek(0)
        whole = scratch.read()
    write_bytes(target, whole)
    return hashlib.sha256(whole).hexdigest()


@dataclass(frozen=True)
class Digest:
    """What a record is, without its numbers: SHA-256 of the file and of each column, and the versions named in it."""

    sha256: str
    columns: dict[str, str]
    versions: dict[str, str]


def digest_of(record: Path) -> Digest:
    """The digest of a trial's file. Raises RecordError."""
    trial = read_trial(record)
    columns = {name: hashlib.sha256(_plain(values)).hexdigest() for name, values in trial.columns.items()}
    return Digest(hashlib.sha256(record.read_bytes()).hexdigest(), columns, trial.about.get("versions") or {})


def _plain(values: Any) -> bytes:
    """The values of a column as bytes, equal for equal values."""
    if isinstance(values, np.ndarray):
        return f"{values.dtype.str} ".encode() + bytes(values.data)
    return json.dumps(values, default=bytes.hex).encode()


def _kept(folder: Path, number: int) -> Digest:
    """The digest of a trial of an unpacked run. Raises RecordError."""
    record = trial_path(folder, number)
    if record.exists():
        return digest_of(record)
    path = record.with_suffix(".json")
    try:
        found = json.loads(path.read_text())
        return Digest(found["sha256"], dict(found["columns"]), dict(found["versions"]))
    except DAMAGE as error:
        raise RecordError(f"{path}: is no digest of a trial: {type(error).__name__}: {error}") from None


def _numbers(folder: Path) -> list[int]:
    """Numbers of the trials an unpacked run has."""
    paths = {path.stem for pattern in (RECORD, DIGEST) for path in folder.glob(pattern)}
    return sorted(int(stem.partition("-")[2]) for stem in paths if stem.partition("-")[2].isdecimal())


@dataclass(frozen=True)
class Check:
    """A trial computed again: `equal` to the byte, or in all values if `versions` differ, which are in the file too."""

    run: str
    number: int
    equal: bool
    differs: tuple[str, ...]
    versions: tuple[str, ...]


def unpack(bundle: Path, folder: Path) -> list[Path]:
    """The runs of a bundle below `folder`. Raises RecordError for what is none, or has been changed."""
    try:
        with zipfile.ZipFile(bundle) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LIMIT:
                raise RecordError(f"{bundle}: would unpack to more than {LIMIT >> 30} GB")
            hashes = json.loads(archive.read(CONTENTS))["files"]
            if set(archive.namelist()) != {CONTENTS, *hashes}:
                raise RecordError(f"{bundle}: holds other files than its list says")
            for name, digest in hashes.items():
                parts = PurePosixPath(name).parts
                if len(parts) != 2 or ".." in parts or "\\" in name or name.startswith("/"):
                    raise RecordError(f"{bundle}: {name!r} is no file of a run")
                data = archive.read(name)
                if hashlib.sha256(data).hexdigest() != digest:
                    raise RecordError(f"{bundle}: {name} is not what it was (its hash differs)")
                (folder / parts[0]).mkdir(parents=True, exist_ok=True)
                (folder / parts[0] / parts[1]).write_bytes(data)
    except RecordError:
        raise
    except DAMAGE as error:
        raise RecordError(f"{bundle}: is no bundle: {error}") from None
    return sorted({folder / PurePosixPath(name).parts[0] for name in hashes})


def plan_of(folder: Path) -> Plan:
    """The plan of an unpacked run, from its manifest. Raises RecordError, SceneError."""
    try:
        key: dict[str, Any] = read_manifest(folder)["key"]
        scene = scene_of(key["scene"])
        own = dict.fromkeys(group.image for group in scene.groups if group.image)
        firmware = {path.stem: path for path in folder.glob("firmware*")}
        hashes = key.get("images_sha256") or {}
        images = tuple((name, firmware[f"firmware-{place}"] if hashes.get(name) else None)
                       for place, name in enumerate(own, start=1))  # fmt: skip
        image = firmware["firmware"] if key["image_sha256"] else None
        _plausible(key)
        experiment = folder / EXPERIMENT if key.get("experiment_sha256") else None
        return Plan(scene, key["brain"], key["controller"], image, len(_numbers(folder)),
                    key["seconds"], key["seed"], experiment, images)  # fmt: skip
    except DAMAGE as error:
        raise RecordError(f"{folder / MANIFEST}: {type(error).__name__}: {error}") from None


def _plausible(key: dict[str, Any]) -> None:
    """Raises ValueError for what no plan has."""
    for name, good in (
        ("controller", key["controller"] in CONTROLLERS),
        ("seconds", 0 < key["seconds"] < math.inf),
        ("seed", key["seed"] >= 0),
    ):
        if not good:
            raise ValueError(f"{name}: {key[name]!r:.40} is none")


def verify(bundle: Path, chosen: Callable[[list[int]], list[int]], processes: int) -> Iterator[Check]:
    """Compute `chosen` of each run's trial numbers again. Raises RecordError, SceneError, emu.LoadError."""
    with tempfile.TemporaryDirectory(prefix="arena-") as name:
        for folder in unpack(bundle, Path(name)):
            plan = plan_of(folder)
            again = folder / "again"
            again.mkdir()
            numbers = _numbers(folder)
            if not numbers:
                raise RecordError(f"{bundle}: run {folder.name} has no trial")
            for number in chosen(numbers):
                run_one(plan, number, again, None, processes if plan.has_firmware else 1)
                yield _compared(folder.name, number, _kept(folder, number), digest_of(trial_path(again, number)))


def _compared(run: str, number: int, kept: Digest, made: Digest) -> Check:
    if kept.sha256 == made.sha256:
        return Check(run, number, True, (), ())
    now, then = made.versions, kept.versions
    changed = tuple(
        f"{name} {then.get(name, '?')} then, {now[name]} now" for name in now if then.get(name) != now[name]
    )
    names = sorted({*kept.columns, *made.columns})
    differs = tuple(name for name in names if kept.columns.get(name) != made.columns.get(name))
    return Check(run, number, not differs and bool(changed), differs, changed)
