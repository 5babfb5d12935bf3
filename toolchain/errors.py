"""Errors every tool reports the same way: place, message, and how to go on collecting after the first."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Where a message belongs: a file and, when known, a line (1-based)."""

    file: str
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


class ToolError(Exception):
    """Bad input to a tool.  Carries every finding; the command line prints them and exits with status 2."""

    def __init__(self, message: str, place: SourceLocation | None = None) -> None:
        super().__init__(message)
        self.findings: list[str] = [f"{place}: error: {message}" if place else f"error: {message}"]

    @classmethod
    def of(cls, findings: list[str]) -> ToolError:
        """Return one error that lists all `findings`, each a complete line."""
        error = cls("\n".join(findings))
        error.findings = list(findings)
        return error

    def __str__(self) -> str:
        return "\n".join(self.findings)
