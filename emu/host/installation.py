"""The pip command that installs the package: from a wheel file, a checkout or a VCS address, as it is in no index.

This is the only module that spells the command. It repeats the address from which this installation was made (PEP 610).
"""

from __future__ import annotations

import json
import shlex
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from emu.host import paths

PACKAGE: Final = "openswarm"


def wheel_name() -> str:
    """Return the file name of this version's wheel."""
    return f"{PACKAGE}-{version(PACKAGE)}-py3-none-any.whl"


def install_command(extra: str = "", *, of_wheel: bool = False) -> str:
    """Return the command that installs this version, with an optional extra (`arena`).

    The address is that of this installation, or with `of_wheel` a wheel file in the current folder.
    """
    return f"pip install {shlex.quote(requirement(extra, None if of_wheel else _address()))}"


def requirement(extra: str, address: str | None) -> str:
    """Return pip's argument for an address: a path, `git+https://...`, or None for a wheel in the current folder."""
    group = f"[{extra}]" if extra else ""
    if address is not None and "://" in address:
        return f"{PACKAGE}{group} @ {address}"
    return f"{address or f'./{wheel_name()}'}{group}"


def _address() -> str | None:
    """Return the address from which the package was installed, None if it is unknown."""
    if paths.in_checkout():
        return str(paths.firmware().parent)
    try:
        facts = json.loads(distribution(PACKAGE).read_text("direct_url.json") or "{}")
    except (PackageNotFoundError, ValueError):
        return None
    url, vcs = facts.get("url"), facts.get("vcs_info")
    if not isinstance(url, str):
        return None
    if isinstance(vcs, dict):
        return f"{vcs.get('vcs', 'git')}+{url}@{vcs.get('commit_id', '')}".rstrip("@")
    place = urlsplit(url)
    if place.scheme != "file":
        return url
    path = Path(unquote(place.path))
    return str(path) if path.exists() else None
