"""Build the documentation site: `python docs/tools/site.py [--out build/site]`, with the extra `docs`.

The site contains every Markdown file of the repository at its own path, so links work on GitHub and on the site.
Generated pages are added: the output of `--help`, the Python interfaces from docstrings, the import graph, the kernel's
calls and a list of all pages. Each option of a command and each key of a scene has its own anchor, which the search
finds. The pages can be opened from disk. MkDocs builds in strict mode: a warning is a failure.
"""

from __future__ import annotations

import argparse
import html
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import import_graph
import kernel_reference
import python_reference

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ("emu", "toolchain", "arena", "openswarm")
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
OPTION = re.compile(r"^ {2,4}(-\S.*?)(?: {2,}(\S.*))?\n((?: {10,}\S.*\n)*)", re.MULTILINE)
"""An option in the output of `--help`: its names and arguments, the first line of its text, the other lines."""
FENCED = re.compile(r"(^```.*?^```\n)", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^\n((?: {4}(?![-*+] |\d+\. ).*\n)+)(?=\n|\Z)", re.MULTILINE)
"""A code block that is indented, with the empty line above it."""
DRAWN = re.compile(r"[─│└├]|-->|\|->|(?<!\w)->(?!\w).*(?<!\w)->|(?<=\s)->\s+-{5}")
"""What is in a diagram that is drawn with characters: lines or arrows."""
COLUMNS = re.compile(r"(?:^(?!.*# ).*\S {3,}\S.*\n(?:.*\n)*?){3}", re.MULTILINE)
"""Three lines of output in columns."""
PICTURE = re.compile(r"(?<!\[)!\[[^\]]*\]\(([^)\s]+)\)")
SPAN = re.compile(r"`[^`\n]*`")
CODE = re.compile(r"<code\b.*?</code>", re.DOTALL)
ARTICLE = re.compile(r"<article\b.*?</article>", re.DOTALL)
CELL = re.compile(r"<t[dh]\b.*?</t[dh]>", re.DOTALL)
JOINT = re.compile(r"(?<=[^\W_])_(?=[^\W_])|(?<=[\w)\]*])\.(?=\w{5})|::|(?<=[\w)\]*.])/(?=\w)|[,(=](?=\w)")
"""Where a name in a cell may break: after this, so that a file keeps its suffix and a word is whole."""
WHOLE = re.compile(r"(?<![\w-])--?[A-Za-z]\w*|-+&gt;|&lt;-+")
"""What a browser would break after its hyphens: the first word of an option, an arrow."""
POWER = re.compile(r"\d+(?:\.\d+)?e-\d+")
"""A number that a browser would break after its minus sign."""
BLOCK = re.compile(r'<div class="([^"]*\bhighlight\b[^"]*)"(>.*?</div>)', re.DOTALL)
COLUMN_BLOCK = re.compile(r'(<div class="[^"]*\bcolumns\b[^"]*")(.*?<code>)(.*?)(</code>)', re.DOTALL)
ENTRY = re.compile(r"^( {9,})?( {0,8}\S+(?: \S+)*)( )( +)(?=[^\W\d]|[`<&])")
"""A name and the gap before its description, in a list of files or commands."""
CONTINUED = re.compile(r"^( {9,})(?=\S)")
BESIDE = re.compile(r'( )( {2,})(?=(?:</span>)?(?:<span class="c|# ))')
"""The gap between code and a comment on its right."""
SENTENCE = re.compile(r"^(\$ .*|(?!.*\S {2,}\S).+)$", re.MULTILINE)
"""A line of a session that needs no columns: a command, or output without a gap."""
LINE = 96
"""Longest line that fits on a wide screen in the usual size of code."""
MOST_COLUMNS = {False: 125, True: 145}
"""Longest line of a code block that a smaller font keeps whole on a wide screen: of any, of a diagram or columns."""
KEYS = Path("docs/scene-keys.md")


def tracked() -> list[str]:
    """Return the paths of all tracked files."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def copy_pages(source: Path) -> None:
    """Copy the repository's pages and the files they link to, at their own paths below `source`."""
    for name in tracked():
        path = ROOT / name
        if path.suffix != ".md" or name.startswith("openswarm/template"):
            continue
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        text = path.read_text(encoding="utf-8")
        for _, target, _ in LINK.findall(text):
            place = (path.parent / target.partition("#")[0]).resolve()
            if ":" not in target and place.is_file() and place.suffix != ".md" and place.is_relative_to(ROOT):
                beside = source / place.relative_to(ROOT)
                beside.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(place, beside)
        text = with_anchors(text) if name == str(KEYS) else text
        (source / name).write_text(with_pages(text, path), encoding="utf-8")


def with_pages(text: str, page: Path) -> str:
    """Return the text of a page for the site: links to folders lead to their READMEs, pictures to their files, and
    diagrams are marked."""
    text = PICTURE.sub(r"[\g<0>](\1)", with_marks(text))
    text = re.sub(r"^\|.*", lambda row: re.sub(rf"{SPAN.pattern}| \{{", _in_row, row[0]), text, flags=re.MULTILINE)
    return LINK.sub(lambda found: found[1] + to_page(page, found[2]) + found[3], text)


def with_marks(text: str) -> str:
    """Return the text of a page with its diagrams and columns marked: code blocks without a language, or indented."""
    parts = FENCED.split(text)  # every other part is a fenced block
    parts[::2] = [INDENTED.sub(_as_fenced, part) for part in parts[::2]]
    parts[1::2] = [re.sub(r"\A```\n", f"```{_marks(part)}\n", part) for part in parts[1::2]]
    return "".join(parts)


def _marks(block: str) -> str:
    """Return the classes of a code block whose lines must stay whole, as Markdown attributes; empty for others."""
    return " { .text .diagram }" if DRAWN.search(block) else " { .text .columns }" if COLUMNS.search(block) else ""


def _as_fenced(block: re.Match[str]) -> str:
    return f"\n```{_marks(block[1])}\n{textwrap.dedent(block[1])}```\n" if _marks(block[1]) else block[0]


def _in_row(found: re.Match[str]) -> str:
    """Return a part of a table's row for Python-Markdown: code without the backslash before a bar, which GitHub needs;
    a brace that does not begin attributes of the cell."""
    return r" \{" if found[0] == " {" else found[0].replace(r"\|", "|")


def with_breaks(text: str) -> str:
    """Return the HTML of a page whose code breaks where a reader expects it: names in tables after the marks between
    their words, options and arrows not behind their hyphens."""
    whole = r'<span class="whole">\g<0></span>'
    text = CELL.sub(lambda cell: _in_text(POWER, whole, _in_code(JOINT, r"\g<0><wbr>", cell[0])), text)
    return ARTICLE.sub(lambda article: _in_text(WHOLE, whole, article[0]), text)


def with_sizes(text: str) -> str:
    """Return the HTML of a page in which each code block names the length of its longest line, if a smaller font can
    keep its lines whole."""
    return BLOCK.sub(_sized, text)


def _sized(block: re.Match[str]) -> str:
    lines = html.unescape(re.sub("<[^>]+>", "", block[2].partition("<code>")[2])).splitlines()
    most = MOST_COLUMNS["columns" in block[1] or "diagram" in block[1] or any("  #" in line for line in lines)]
    longest = max((len(line) for line in lines if len(line) <= most), default=0)
    return f'<div class="{block[1]}" style="--columns: {longest}"{block[2]}' if longest > LINE else block[0]


def with_rows(text: str) -> str:
    """Return the HTML of a page whose lists of files and commands have an element for each line, name and gap, so that
    narrow screens break their lines with a hanging indent. Gaps before comments are elements, too."""
    text = BLOCK.sub(_with_gaps, text)
    return COLUMN_BLOCK.sub(_as_rows, text)


def _with_gaps(block: re.Match[str]) -> str:
    return block[0] if "diagram" in block[1] else BESIDE.sub(r'\1<span class="gap">\2</span>', block[0])


def _as_rows(block: re.Match[str]) -> str:
    opening, middle, code, closing = block.groups()
    lines = code.splitlines(keepends=True)
    plain = [html.unescape(re.sub("<[^>]+>", "", line)) for line in lines if line.strip()]
    if any(line.startswith("$") for line in plain):
        return opening + middle + SENTENCE.sub(r'<span class="sentence">\1</span>', code) + closing
    found = [(ENTRY.match(line), CONTINUED.match(line)) for line in plain if not line.endswith("/\n")]
    entries = [bool(entry) for entry, continued in found if entry or not continued]
    if sum(entries) < 0.6 * len(entries) or any(" && " in line for line in plain):
        return block[0]  # a table of numbers, or commands
    rows = "".join(f'<span class="row">{_as_row(line)}</span>' for line in lines)
    return f'{opening[:-1]} listing"{middle}{rows}{closing}'


def _as_row(line: str) -> str:
    """Return a line of a list with its name and its gap as elements; the first space of a gap is no part of it."""
    named = ENTRY.sub(r'\1<span class="name">\2</span>\3<span class="gap">\4</span>', line)
    return CONTINUED.sub(r'<span class="gap">\1</span>', named)


def _in_code(pattern: re.Pattern[str], wanted: str, text: str) -> str:
    """Return HTML with a pattern replaced in the text of its code, not in tags."""
    return CODE.sub(lambda code: _in_text(pattern, wanted, code[0]), text)


def _in_text(pattern: re.Pattern[str], wanted: str, text: str) -> str:
    """Return HTML with a pattern replaced in its text, not in tags."""
    return re.sub(r">[^<]+", lambda part: pattern.sub(wanted, part[0]), text)


def to_page(page: Path, target: str) -> str:
    """Return a link to a folder as a link to its README; any other link unchanged."""
    place, hash_, anchor = target.partition("#")
    is_folder = place and ":" not in place and (page.parent / place).is_dir()
    return f"{place.rstrip('/')}/README.md{hash_}{anchor}" if is_folder else target


def with_anchors(text: str) -> str:
    """Return the page of scene keys with a heading in each row: `camera.sensor`, `robots[].count` for [[robots]]."""
    lines, table = [], ""
    for line in text.splitlines():
        found = re.match(r"## \[(\[?)(\w+)\]+$", line)
        table = found[2] + "[]" * bool(found[1]) if found else table
        lines.append(re.sub(r"^\| `(\w+)` \|", rf'| <h5 id="{table}.\1">{table}.\1</h5> |', line))
    return "\n".join(lines) + "\n"


def options_of(command: str, said: str) -> str:
    """Return the `--help` output of a command in Markdown, with a heading for each option: `emu run --seconds S`."""
    parts, end = [], 0
    start = re.search(r"^options:$", said, re.MULTILINE)  # examples above it are no options
    for found in OPTION.finditer(said, start.start() if start else 0):
        names, first, more = found.groups(default="")
        anchor = command.replace(" ", "-") + re.findall(r"(?<!\S)-[\w-]+", names)[-1]
        parts.append(_block(said[end : found.start()]))
        parts.append(f'<h5 id="{anchor}">{html.escape(f"{command} {names}")}</h5>\n')
        words = re.sub("`([^`]+)`", r"<code>\1</code>", html.escape(" ".join(f"{first} {more}".split())))
        parts.append(f"<p>{words}</p>\n")
        end = found.end()
    return "\n".join(filter(None, [*parts, _block(said[end:])]))


def _block(text: str) -> str:
    """Return a part of a help text in Markdown: the title of an option group in bold, other text as a code block."""
    text = re.sub(r"\n*^options:$", "", text.strip("\n"), flags=re.MULTILINE)
    if text.startswith("usage:"):  # the browser breaks its lines
        usage, gap, rest = text.partition("\n\n")
        text = re.sub(r"\n {7,}", " ", usage) + gap + rest
    title = re.fullmatch(r"(\w[\w ]*):", text)
    if title:
        return f"**{title[1]}**\n"
    return kernel_reference.prose(text)


def help_of(program: str) -> str:
    """Return a page with the `--help` output of a program and each of its commands."""

    def said(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", program, *words, "--help"], cwd=ROOT, capture_output=True, text=True, check=True
        )
        return done.stdout.replace("python -m ", "")

    whole = said()
    names = re.findall(r"^ {2,4}([a-z]+) {2,}\S", whole, re.MULTILINE)
    parts = [f"# {program}\n\n{options_of(program, whole)}"]
    parts += [f"## {program} {name}\n\n{options_of(f'{program} {name}', said(name))}" for name in names]
    return "\n".join(parts)


def reference(source: Path) -> None:
    """Write the generated reference pages."""
    folder = source / "reference"
    folder.mkdir()
    for program in PROGRAMS:
        (folder / f"{program}.md").write_text(help_of(program), encoding="utf-8")
    (folder / "python.md").write_text(python_reference.page(), encoding="utf-8")
    (folder / "imports.md").write_text(import_graph.page(folder), encoding="utf-8")
    (folder / "kernel-calls.md").write_text(kernel_reference.page(), encoding="utf-8")
    (folder / "pages.md").write_text(all_pages(source), encoding="utf-8")


def all_pages(source: Path) -> str:
    """Return a page that links to every page, by top folder: each page is then two clicks from Home."""
    lines, group = ["# All pages\n"], None
    for page in sorted(source.rglob("*.md"), key=lambda one: (one.parent, one.name)):
        place = page.relative_to(source)
        parts = place.parts[:-1]
        heading = "/".join(parts[: 2 if parts[:1] == ("docs",) else 1]) or "project"
        if heading != group:
            group = heading
            lines.append(f"\n## {heading}\n")
        title = re.search("^# (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        folder = f"`{place.parent.as_posix()}`: " if len(parts) > 1 else ""
        lines.append(f"- {folder}[{title[1] if title else place.name}](../{place.as_posix()})")
    return "\n".join(lines) + "\n"


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=ROOT / "build" / "site", metavar="FOLDER")
    wanted = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="site-") as scratch:
        source = Path(scratch) / "pages"
        source.mkdir()
        copy_pages(source)
        shutil.copy(ROOT / "docs" / "site.css", source / "docs")
        reference(source)
        settings = Path(scratch) / "mkdocs.yml"
        settings.write_text(f"INHERIT: {ROOT / 'docs' / 'mkdocs.yml'}\ndocs_dir: {source}\n", encoding="utf-8")
        words = [
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--quiet",
            "--config-file",
            settings,
            "--site-dir",
            wanted.out.resolve(),
        ]
        surroundings = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
        status = subprocess.run([sys.executable, *map(str, words)], cwd=ROOT, env=surroundings, check=False).returncode
    for page in wanted.out.rglob("*.html"):
        page.write_text(with_rows(with_sizes(with_breaks(page.read_text(encoding="utf-8")))), encoding="utf-8")
    # the page for wrong addresses names its style sheets from the server's root, where they may not be
    (wanted.out / "404.html").unlink(missing_ok=True)
    return status


if __name__ == "__main__":
    sys.exit(main())
