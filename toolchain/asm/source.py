"""Source lines with their positions: comment removal, include files, macro and repeat expansions."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from toolchain.errors import SourceLocation

MAX_DEPTH = 64  # nested includes and expansions
MAX_EXPANDED = 1_000_000  # lines that macros and repeats may produce in one assembly

_COMMENT = re.compile(
    r"""(?P<line>^[ \t]*\#[^\n]*)
      | (?P<keep>"(?:\\.|[^"\\\n])*" | '(?:\\.|[^\\\n])'?)
      | (?P<block>/\*.*?(?:\*/|\Z))
      | ;[^\n]*""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
_LINE_MARKER = re.compile(r'[ \t]*#(?:line)?[ \t]+(\d+)[ \t]+"((?:\\.|[^"\\])*)"')


class SourceError(Exception):
    """A structural mistake (depth, unterminated block); the caller adds file and line."""


def strip_comments(text: str) -> list[str]:
    """Return the lines of `text` without comments; `# 12 "file"` markers stay, for `Source` to read."""

    def replace(match: re.Match[str]) -> str:
        if match["line"] is not None:
            return match["line"] if _LINE_MARKER.match(match["line"]) else ""
        if match["keep"] is not None:
            return match["keep"]
        return " " + "\n" * match[0].count("\n") if match["block"] is not None else ""

    return _COMMENT.sub(replace, text.replace("\r\n", "\n").replace("\r", "\n")).split("\n")


@dataclass(slots=True)
class SourceFrame:
    """A run of lines being read: a file, or the expansion of a macro or repeat."""

    lines: list[str]
    file: str
    line: int  # number of the line before the next one
    macro: str = ""  # name of the macro this is an expansion of
    fixed: bool = False  # expansions report the line that caused them
    counted: bool = True  # lines have numbers of their own; in compiler output only line markers set them
    index: int = 0
    conditionals: int = 0  # open conditionals when the frame began
    labels: dict[str, str] = field(default_factory=dict)


class Source:
    """The stack of frames; `next()` returns the lines in order."""

    def __init__(self, text: str, file: str, counted: bool = True) -> None:
        self.frames = [SourceFrame(strip_comments(text), file, 0, counted=counted)]
        self.expanded = 0
        self.place = SourceLocation(file, 0)
        self.on_end: Callable[[SourceFrame], None] = lambda frame: None

    def next(self) -> str | None:
        """Return the next line, None at the end of everything; `place` then names it."""
        frames = self.frames
        while frames:
            frame = frames[-1]
            if frame.index >= len(frame.lines):
                self.on_end(frame)
                frames.pop()
                continue
            text = frame.lines[frame.index]
            frame.index += 1
            if not frame.fixed:
                frame.line += frame.counted
                if "#" in text and (marker := _LINE_MARKER.match(text)):
                    frame.line, frame.file = int(marker[1]) - frame.counted, marker[2]
                    continue
                self.place = SourceLocation(frame.file, frame.line)
            else:
                self.place = SourceLocation(frame.file, frame.line)
            return text
        return None

    def push(self, frame: SourceFrame) -> None:
        """Read `frame` next, then continue with the current one."""
        if len(self.frames) >= MAX_DEPTH:
            raise SourceError(f"includes and macros nested deeper than {MAX_DEPTH}")
        if frame.fixed:
            self.expanded += len(frame.lines)
            if self.expanded > MAX_EXPANDED:
                raise SourceError(f"macros and repeats expand to more than {MAX_EXPANDED} lines")
        self.frames.append(frame)

    def include(self, text: str, file: str, conditionals: int) -> None:
        """Read another file's `text` next."""
        self.push(SourceFrame(strip_comments(text), file, 0, conditionals=conditionals))

    def expand(self, lines: list[str], conditionals: int, macro: str = "") -> None:
        """Read generated `lines` next; messages name the line being read now."""
        self.push(SourceFrame(lines, self.place.file, self.place.line, macro, True, conditionals=conditionals))

    def block(self, opening: re.Pattern[str], closing: re.Pattern[str], what: str) -> list[str]:
        """Return the lines up to the matching end, which is consumed; nested blocks stay inside."""
        frame, depth, start = self.frames[-1], 1, self.place
        first = frame.index
        while frame.index < len(frame.lines):
            text = frame.lines[frame.index]
            frame.index += 1
            if not frame.fixed:
                frame.line += 1
            if closing.match(text):
                depth -= 1
                if depth == 0:
                    return frame.lines[first : frame.index - 1]
            elif opening.match(text):
                depth += 1
        self.place = start
        raise SourceError(f"{what} is never closed")

    def leave_macro(self) -> SourceFrame | None:
        """Drop everything down to and including the innermost macro expansion (.exitm); return its frame."""
        for index in range(len(self.frames) - 1, -1, -1):
            if self.frames[index].macro:
                frame = self.frames[index]
                del self.frames[index:]
                return frame
        return None
