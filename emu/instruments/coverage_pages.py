"""Coverage as HTML pages: an index with one row per source file, and a page per file with its lines and counts.

Input: a coverage report and the paths of its sources. The pages need no other program and load nothing from elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Final

from emu.host.files import atomic_text_file
from emu.host.sources import source_lines
from emu.instruments.coverage import FileCoverage

STYLE: Final = (
    "body{font:14px sans-serif;margin:2em}table{border-collapse:collapse}td,th{padding:2px 10px;text-align:right}"
    "td:first-child,th:first-child{text-align:left}pre{margin:0}.run{background:#dff5e1}.not{background:#fbdada}"
    ".part{background:#fff3c9}"
)


def lines_run(one: FileCoverage) -> tuple[int, int]:
    """Return the numbers of executed lines and of all lines with code."""
    return sum(count > 0 for count in one.lines.values()), len(one.lines)


def outcomes_seen(one: FileCoverage) -> tuple[int, int]:
    """Return the numbers of branch outcomes that occurred and of all outcomes."""
    outcomes = [times for branches in one.branches.values() for pair in branches for times in pair]
    return sum(times > 0 for times in outcomes), len(outcomes)


def percent(part: int, whole: int) -> str:
    """Return a share as text; a file without code is covered."""
    return f"{100 * part / whole if whole else 100:.1f} %"


def write_pages(folder: Path, files: dict[str, FileCoverage], path_of: Callable[[str], Path]) -> None:
    """Write index.html and one page per file into a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {name: f"{number}-{Path(name).name}.html" for number, name in enumerate(sorted(files))}
    with atomic_text_file(folder / "index.html") as stream:
        stream.writelines(_page("Coverage", _index(files, names)))
    for name, page in names.items():
        with atomic_text_file(folder / page) as stream:
            stream.writelines(_page(name, _lines(files[name], path_of(name))))


def _page(title: str, body: Iterator[str]) -> Iterator[str]:
    head = f'<meta charset="utf-8"><title>{escape(title)}</title><style>{STYLE}</style>'
    yield f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body><h1>{escape(title)}</h1>\n'
    yield from body
    yield "</body></html>\n"


def _index(files: dict[str, FileCoverage], names: dict[str, str]) -> Iterator[str]:
    yield "<table><tr><th>file</th><th>lines</th><th></th><th>branch outcomes</th><th></th></tr>\n"
    for name, one in sorted(files.items()):
        (run, lines), (seen, outcomes) = lines_run(one), outcomes_seen(one)
        yield f'<tr><td><a href="{escape(names[name])}">{escape(name)}</a></td><td>{run} of {lines}</td>'
        yield f"<td>{percent(run, lines)}</td><td>{seen} of {outcomes}</td><td>{percent(seen, outcomes)}</td></tr>\n"
    yield "</table>\n"


def _lines(one: FileCoverage, path: Path) -> Iterator[str]:
    try:
        text = source_lines(path)
    except OSError:
        text = []
    yield "<table>\n"
    for number in range(1, max(len(text), max(one.lines, default=0)) + 1):
        count, pairs = one.lines.get(number), one.branches.get(number, [])
        missed = any(times == 0 for pair in pairs for times in pair)
        kind = "" if count is None else "not" if count == 0 else "part" if missed else "run"
        shown = "" if count is None else f"{count:,}"
        code = escape(text[number - 1]) if number <= len(text) else ""
        row = f'<td>{number}</td><td>{shown}</td><td style="text-align:left"><pre>{code}</pre></td>'
        yield f'<tr class="{kind}">{row}</tr>\n'
    yield "</table>\n"
