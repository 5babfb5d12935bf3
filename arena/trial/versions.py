"""Versions that a result depends on beside scene, firmware and seed: emulator, arena, libraries, machine.

The project's version number does not change between releases. So emulator and arena are identified by a hash of their
sources.
"""

from __future__ import annotations

import hashlib
import platform
import subprocess
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
LIBRARIES: Final = ("pymunk", "numpy", "pyarrow", "llvmlite")
"""Libraries for physics, noise, the bytes of a record, and native code."""
NOT_HASHED: Final = ("commands/", "cli.py", "analysis/", "replay/", "studio/process.py", "campaign/bundle.py", "env.py",
                     "README.md", "scenes/")  # fmt: skip
"""Parts of the arena that cannot change a record, so their sources are not hashed: readers of records, and scenes.

The values of a scene are in the key of a run.
"""
_KINDS: Final = {".py", ".c", ".csv", ".toml"}


@cache
def sources_hash(package: str) -> str:
    """Return the first 16 digits of the SHA-256 of a package's sources and their names, independent of line ends."""
    digest = hashlib.sha256()
    folder = ROOT / package
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix not in _KINDS or (package == "arena" and name.startswith(NOT_HASHED)):
            continue
        digest.update(f"{name}\0".encode() + path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()[:16]


def versions() -> dict[str, str]:
    """Return the versions of everything the bytes of a record can depend on."""
    found = {"emulator": sources_hash("emu"), "arena": sources_hash("arena"), "machine": platform.machine()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    return found


def host() -> dict[str, str]:
    """Return a description of the host for people; the record does not depend on it."""
    found = {"python": platform.python_version(), "system": sys.platform, "openswarm": version("openswarm")}
    try:
        said = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=40"],
                              capture_output=True, text=True, timeout=10, check=False)  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return found
    return found | ({"commit": said.stdout.strip()} if said.returncode == 0 else {})
