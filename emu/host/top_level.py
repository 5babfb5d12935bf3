"""Answers of all command lines to words that name no command: help, version, unknown commands."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from emu.host.errors import JSON, report_error
from emu.host.exit_status import BAD_INPUT, DONE


def answer(program: str, words: Sequence[str], commands: Collection[str], usage: Callable[[], str]) -> int | None:
    """Print usage, version or an error if `words` name no command; return the exit status.

    Returns None if the first word is one of `commands`."""
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        return DONE if words else BAD_INPUT
    if list(words) == ["--version"]:
        from importlib.metadata import version  # imported only here: it takes as long as a short run

        print(f"{program} {version('openswarm')}")
        return DONE
    if words[0] not in commands:
        message = f"{program}: unknown command {words[0]!r}; known: {', '.join(commands)}"
        return report_error(message, BAD_INPUT, JSON in words)
    return None


def listing(commands: dict[str, str]) -> str:
    """Return one line per command: its name and the first line of its description."""
    width = max(map(len, commands))
    return "\n".join(f"  {name:{width}}  {text}" for name, text in commands.items())
