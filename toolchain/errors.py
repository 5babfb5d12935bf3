"""Error classes of all tools: source location, and an exception with one or several messages."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Location of a message: a file and, if known, a line (from 1)."""

    file: str
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


class ToolError(Exception):
    """Invalid input, with the messages of all errors; the command line prints them and exits with status 2."""

    def __init__(self, message: str, place: SourceLocation | None = None) -> None:
        super().__init__(message)
        self.findings: list[str] = [f"{place}: error: {message}" if place else f"error: {message}"]

    @classmethod
    def of(cls, findings: list[str]) -> ToolError:
        """Return one error with all messages in `findings`, each a complete line."""
        error = cls("\n".join(findings))
        error.findings = list(findings)
        return error

    def __str__(self) -> str:
        return "\n".join(self.findings)
