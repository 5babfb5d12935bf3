"""Table of the prompt's commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.prompt.client import CommandRefusedError
from emu.prompt.session import DebugSession

Handler = Callable[[DebugSession, str], None]


@dataclass(frozen=True, slots=True)
class Command:
    """One command: usage, help text, handler and aliases."""

    usage: str
    help: str
    handler: Handler
    aliases: tuple[str, ...] = ()
    repeats: bool = False
    """Whether an empty line at a terminal repeats the command."""

    @property
    def name(self) -> str:
        """Name of the command, the first word of its usage."""
        return self.usage.split()[0].split("[")[0]


TABLE: Final[list[Command]] = []


def command(usage: str, text: str, *aliases: str, repeats: bool = False) -> Callable[[Handler], Handler]:
    """Return a decorator that registers a function as a command."""

    def enter(handler: Handler) -> Handler:
        TABLE.append(Command(usage, text, handler, aliases, repeats))
        return handler

    return enter


def find_command(word: str) -> Command:
    """Return the command with a name, an alias or an unambiguous abbreviation. Raises CommandRefusedError."""
    for one in TABLE:
        if word == one.name or word in one.aliases:
            return one
    found = [one for one in TABLE if one.name.startswith(word)]
    if len(found) == 1:
        return found[0]
    if found:
        raise CommandRefusedError(f"{word} is ambiguous: {', '.join(one.name for one in found)}")
    raise CommandRefusedError(f"there is no command {word}: try help")
