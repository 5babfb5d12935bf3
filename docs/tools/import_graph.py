"""Draw the import graph of each package from the code: `python docs/tools/import_graph.py FOLDER`.

`docs/tools/site.py` calls `page` for the site. A cycle of imports is an error; type imports count.
"""

from __future__ import annotations

import ast
import sys
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import grimp

ROOT: Final = Path(__file__).resolve().parents[2]
PACKAGES: Final = ("emu", "toolchain", "arena")
STARTS: Final = frozenset({"__main__"})
"""Modules that are not drawn, because they only call another module."""

Graph = dict[str, set[str]]

LETTER, BOX, GAP, ROW, MARGIN = 7.2, 34, 14, 66, 16
"""Dimensions in pixels: width of a letter, height of a box, gap between boxes, distance of rows, outer margin."""
WIDEST: Final = 1000
"""Maximum width of a picture in pixels; a longer row is broken."""
STYLE: Final = """
  .box { fill: #fff; stroke: #2b5c8a; stroke-width: 1.2 } .package { fill: #e6eff8 }
  text { font: 12px ui-monospace, Menlo, Consolas, monospace; fill: #14212e; text-anchor: middle }
  .count { font-size: 10px; fill: #56697c } path { fill: none; stroke: #8aa3ba; stroke-width: 1 }
"""


def imports_of(package: str) -> Graph:
    """Return, for each part of a package, the other parts it imports; type imports count."""
    graph = grimp.build_graph(package, exclude_type_checking_imports=False)
    parts = {name.split(".")[1] for name in graph.modules if "." in name} - STARTS
    wanted: Graph = {part: set() for part in parts}
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            one, other = (name.split(".")[1] if "." in name else "" for name in (importer, imported))
            if one in parts and other in parts and one != other:
                wanted[one].add(other)
    return wanted


def heights(graph: Graph) -> dict[str, int]:
    """Return the longest path of each part down to a part without imports. Raises ValueError for a cycle."""
    found: dict[str, int] = {}

    def height(part: str, above: tuple[str, ...]) -> int:
        if part in above:
            raise ValueError(f"circular imports: {' > '.join((*above, part))}")
        if part not in found:
            found[part] = max((height(other, (*above, part)) + 1 for other in sorted(graph[part])), default=0)
        return found[part]

    for part in sorted(graph):
        height(part, ())
    return found


def transitive_reduction(graph: Graph) -> Graph:
    """Return the graph without edges that a longer path implies (transitive reduction)."""
    below: Graph = {}

    def reach(part: str) -> set[str]:
        if part not in below:
            below[part] = set().union(*({other} | reach(other) for other in graph[part]))
        return below[part]

    return {part: {other for other in graph[part] if not any(other in reach(way) for way in graph[part] - {other})}
            for part in graph}  # fmt: skip


def rows_of(graph: Graph) -> list[list[str]]:
    """Return the rows of boxes from top to bottom. Each box is near its importers, and wide rows are broken."""
    level = heights(graph)
    users = {part: [one for one in sorted(graph) if part in graph[one]] for part in graph}
    place: dict[str, float] = {}
    rows: list[list[str]] = []
    for height in range(max(level.values()), -1, -1):
        parts = [part for part in graph if level[part] == height]
        parts.sort(key=lambda part: (sum(place[one] for one in users[part]) / max(len(users[part]), 1), part))
        rows.append([])
        for part in parts:
            if width_of([*rows[-1], part]) > WIDEST - 2 * MARGIN:
                rows.append([])
            rows[-1].append(part)
        place |= {part: (number + 1) / (len(parts) + 1) for number, part in enumerate(parts)}
    return rows


def box_width(part: str) -> float:
    return max(11, len(part) + 2) * LETTER


def width_of(parts: list[str]) -> float:
    return sum(map(box_width, parts)) + GAP * (len(parts) - 1)


def draw(package: str) -> str:
    """Return the picture of a package as SVG."""
    graph = imports_of(package)
    rows = rows_of(graph)
    wide = round(max(map(width_of, rows))) + 2 * MARGIN
    centre: dict[str, tuple[float, float]] = {}
    boxes: list[str] = []
    for number, parts in enumerate(rows):
        left = (wide - width_of(parts)) / 2
        top = MARGIN + number * ROW
        for part in parts:
            width = box_width(part)
            centre[part] = left + width / 2, top
            boxes.append(_box(package, part, left, top, width))
            left += width + GAP
    lines = []
    for part, others in sorted(transitive_reduction(graph).items()):
        for other in sorted(others):
            (x, y), (to_x, to_y) = centre[part], centre[other]
            start, middle = y + BOX, (y + BOX + to_y) / 2
            lines.append(f'<path d="M{x:.1f} {start}C{x:.1f} {middle:.1f} {to_x:.1f} {middle:.1f} {to_x:.1f} {to_y}"/>')
    size = f'width="{wide}" height="{MARGIN + len(rows) * ROW}"'
    box = f'viewBox="0 0 {wide} {MARGIN + len(rows) * ROW}"'
    title = f"<title>Imports of {package}: each box imports boxes below it</title>"
    body = "\n".join(
        (title, f"<style>{STYLE}</style>", '<rect width="100%" height="100%" fill="#fff"/>', *lines, *boxes)
    )
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box}>\n{body}\n</svg>\n'


def _box(package: str, part: str, left: float, top: float, width: float) -> str:
    """Return the SVG box of one part, with the first sentence of its docstring as tool tip."""
    folder = ROOT / package / part
    count = len(list(folder.rglob("*.py"))) if folder.is_dir() else 0
    middle = left + width / 2
    kind = "box package" if count else "box"
    text = f'<text x="{middle:.1f}" y="{top + (15 if count else 21)}">{part}</text>'
    if count:
        text += f'<text class="count" x="{middle:.1f}" y="{top + 28}">{count} modules</text>'
    rectangle = f'<rect class="{kind}" x="{left:.1f}" y="{top}" width="{width:.1f}" height="{BOX}" rx="4"/>'
    return f"<g><title>{escape(sentence_of(f'{package}.{part}'))}</title>{rectangle}{text}</g>"


def sentence_of(module: str) -> str:
    """Return the first line of a module's docstring."""
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return (ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or module).splitlines()[0]


def page(folder: Path) -> str:
    """Write one picture per package into `folder` and return a Markdown page that shows them."""
    parts = ["# Import graph\n\nFor contributors: which module or package imports which. Drawn from the code; "
             "type imports count. A line that a longer path implies is left out.\n"]  # fmt: skip
    for package in PACKAGES:
        picture = folder / f"imports-{package}.svg"
        picture.write_text(draw(package), encoding="utf-8")
        shown = f"![Modules of {package}, each above what it imports]({picture.name})"
        parts.append(f"## {package}\n\n[{shown}]({picture.name})\n")
    return "\n".join(parts)


def main() -> int:
    """Write the page and its pictures into the folder on the command line, and return the exit status."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print("usage: python docs/tools/import_graph.py FOLDER", file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "imports.md").write_text(page(folder), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
