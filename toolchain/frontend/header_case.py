"""Headers whose names are spelt in another case than the file's, as sources written on Windows do.

Only after the front end has not found a header: a case-insensitive view of the folders that it looks into, for one more
run. Enters: the arguments of the run. Leaves: the text of an overlay for `-ivfsoverlay`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

MISSING = re.compile(rb"fatal error: .*'[^'\n]+\.[hH]' file not found")
"""What clang says when it might help to look again."""

FOLDER_OPTIONS = ("-I", "-iquote", "-isystem", "-idirafter")
MOST_FILES = 20_000  # a folder that holds more is no project's include folder; what lies beyond keeps its case


def overlay(arguments: list[str]) -> str:
    """Overlay text (JSON is YAML) with every file at or below the folders of a run's options and its source."""
    files: dict[Path, list[Path]] = {}
    for count, path in enumerate(file for folder in _folders(arguments) for file in sorted(folder.rglob("*"))):
        if count > MOST_FILES:
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
    """Folders that `#include` looks into, the source's own first, without those of clang."""
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
