"""The table of commands that the prompt knows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from emu.prompt.client import RefusedError
from emu.prompt.session import Session

Doing = Callable[[Session, str], None]


@dataclass(frozen=True, slots=True)
class Command:
    """One command: how it is written, what it does, other names for it."""

    usage: str
    help: str
    do: Doing
    aliases: tuple[str, ...] = ()
    repeats: bool = False
    """An empty line at a terminal does it again."""

    @property
    def name(self) -> str:
        """Its first word."""
        return self.usage.split()[0].split("[")[0]


TABLE: Final[list[Command]] = []


def command(usage: str, text: str, *aliases: str, repeats: bool = False) -> Callable[[Doing], Doing]:
    """Enter a function into TABLE."""

    def enter(do: Doing) -> Doing:
        TABLE.append(Command(usage, text, do, aliases, repeats))
        return do

    return enter


def called(word: str) -> Command:
    """The command of that name, alias or unambiguous beginning. Raises RefusedError."""
    for one in TABLE:
        if word == one.name or word in one.aliases:
            return one
    found = [one for one in TABLE if one.name.startswith(word)]
    if len(found) == 1:
        return found[0]
    if found:
        raise RefusedError(f"{word} is ambiguous: {', '.join(one.name for one in found)}")
    raise RefusedError(f"there is no command {word}: try help")
