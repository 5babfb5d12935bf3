"""Case-insensitive lookup of headers, for sources written on Windows.

If clang does not find a header, it runs again with a case-insensitive overlay of its include folders (`-ivfsoverlay`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

MISSING = re.compile(rb"fatal error: .*'[^'\n]+\.[hH]' file not found")
"""Pattern of clang's error message for a missing header."""

FOLDER_OPTIONS = ("-I", "-iquote", "-isystem", "-idirafter")
MAX_FILES = 20_000  # maximum number of files in the overlay; lookup of further files remains case-sensitive


def overlay(arguments: list[str]) -> str:
    """Text of an overlay (JSON is YAML) with all files below the include folders and the folder of the source."""
    files: dict[Path, list[Path]] = {}
    for count, path in enumerate(file for folder in _folders(arguments) for file in sorted(folder.rglob("*"))):
        if count > MAX_FILES:
            break
        if path.is_file():
            files.setdefault(path.parent, []).append(path)
    roots = [
        {
            "type": "directory",
            "name": str(folder),
            "contents": [{"type": "file", "name": f.name, "external-contents": str(f)} for f in members],
        }
        for folder, members in files.items()
    ]
    return json.dumps({"version": 0, "case-sensitive": "false", "roots": roots})


def _folders(arguments: list[str]) -> Iterator[Path]:
    """Folders that `#include` searches, the folder of the source first; those of clang are excluded."""
    words = iter(arguments)
    named: list[str] = []
    for word in words:
        option = next((o for o in FOLDER_OPTIONS if word.startswith(o)), None)
        if option:
            named.append(word[len(option) :] or next(words, ""))
        elif word == "-x":
            next(words)
            named.insert(0, str(Path(next(words, ".")).parent))
    for name in dict.fromkeys(named):
        folder = Path(name).resolve()
        if folder.is_dir() and "ziglang" not in folder.parts:
            yield folder
