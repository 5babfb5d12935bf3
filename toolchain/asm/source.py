"""Source lines with their positions: comment removal, include files, macro and repeat expansions."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from toolchain.errors import SourceLocation

MAX_DEPTH = 64  # maximum nesting of include files and expansions
MAX_EXPANDED = 1_000_000  # maximum number of lines that macros and repeats produce in one assembly

_COMMENT = re.compile(
    r"""(?P<line>^[ \t]*\#[^\n]*)
      | (?P<keep>"(?:\\.|[^"\\\n])*" | '(?:\\.|[^\\\n])'?)
      | (?P<block>/\*.*?(?:\*/|\Z))
      | ;[^\n]*""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
_LINE_MARKER = re.compile(r'[ \t]*#(?:line)?[ \t]+(\d+)[ \t]+"((?:\\.|[^"\\])*)"')


class SourceError(Exception):
    """An error in the structure of the source (nesting depth, unterminated block); the caller adds file and line."""


def strip_comments(text: str) -> list[str]:
    """Return the lines of `text` without comments; line markers such as `# 12 "file"` are kept for `Source`."""

    def replace(match: re.Match[str]) -> str:
        if match["line"] is not None:
            return match["line"] if _LINE_MARKER.match(match["line"]) else ""
        if match["keep"] is not None:
            return match["keep"]
        return " " + "\n" * match[0].count("\n") if match["block"] is not None else ""

    return _COMMENT.sub(replace, text.replace("\r\n", "\n").replace("\r", "\n")).split("\n")


@dataclass(slots=True)
class SourceFrame:
    """A sequence of lines being read: a file, or the expansion of a macro or repeat."""

    lines: list[str]
    file: str
    line: int  # number of the last line read
    macro: str = ""  # name of the expanded macro, "" for other frames
    fixed: bool = False  # an expansion: all its lines have the position of the statement that caused it
    counted: bool = True  # each line increments the line number; in compiler output only line markers change it
    index: int = 0
    conditionals: int = 0  # number of open conditionals at the start of the frame
    labels: dict[str, str] = field(default_factory=dict)


class Source:
    """The stack of frames; `next()` returns the lines in order."""

    def __init__(self, text: str, file: str, counted: bool = True) -> None:
        self.frames = [SourceFrame(strip_comments(text), file, 0, counted=counted)]
        self.expanded = 0
        self.place = SourceLocation(file, 0)
        self.on_end: Callable[[SourceFrame], None] = lambda frame: None

    def next(self) -> str | None:
        """Return the next line, None after the last one; `place` becomes its position."""
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
        """Push a frame: its lines are read next, then those of the current frame."""
        if len(self.frames) >= MAX_DEPTH:
            raise SourceError(f"includes and macros nested deeper than {MAX_DEPTH}")
        if frame.fixed:
            self.expanded += len(frame.lines)
            if self.expanded > MAX_EXPANDED:
                raise SourceError(f"macros and repeats expand to more than {MAX_EXPANDED} lines")
        self.frames.append(frame)

    def include(self, text: str, file: str, conditionals: int) -> None:
        """Push the text of an include file as a frame."""
        self.push(SourceFrame(strip_comments(text), file, 0, conditionals=conditionals))

    def expand(self, lines: list[str], conditionals: int, macro: str = "") -> None:
        """Push generated lines as a frame; messages about them name the current line."""
        self.push(SourceFrame(lines, self.place.file, self.place.line, macro, True, conditionals=conditionals))

    def block(self, opening: re.Pattern[str], closing: re.Pattern[str], what: str) -> list[str]:
        """Return the lines before the matching end of a block, with nested blocks; the end is consumed."""
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
        """Pop frames up to and including the innermost macro expansion (.exitm); return its frame."""
        for index in range(len(self.frames) - 1, -1, -1):
            if self.frames[index].macro:
                frame = self.frames[index]
                del self.frames[index:]
                return frame
        return None
