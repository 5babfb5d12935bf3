"""Breakpoints as a person at the prompt numbers them; the server gets whole lists of each kind, as it wants them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from emu.prompt.client import Client, RefusedError, Row

REQUESTS: Final = {
    "function": "setFunctionBreakpoints", "instruction": "setInstructionBreakpoints", "data": "setDataBreakpoints",
}  # fmt: skip


@dataclass(eq=False, slots=True)
class Point:
    """One breakpoint."""

    number: int
    list: str
    """Which list it is in: one of REQUESTS, or the path of a source."""
    row: Row
    """As the protocol has it."""
    text: str
    """As the user wrote it."""
    is_temporary: bool = False
    is_on: bool = True
    facts: Row = field(default_factory=dict)

    def __str__(self) -> str:
        line = str(self.facts.get("line", ""))
        row = self.row
        words = {"if": row.get("condition"), "hits": row.get("hitCondition"), "log": row.get("logMessage")}
        more = [
            self.text + (f" (line {line})" if line and not self.text.endswith(line) else ""),
            *(f"{word} {text}" for word, text in words.items() if text),
            *(["once"] if self.is_temporary else []),
            *([] if self.is_on else ["off"]),
        ]
        return f"{self.number}: {', '.join(more)}"


class Points:
    """All breakpoints of a session."""

    def __init__(self, client: Client) -> None:
        self.all: Final[list[Point]] = []
        self._client: Final = client
        self._last = 0

    def add(self, kind: str, row: Row, text: str, is_temporary: bool = False) -> Point:
        """Set one. Raises RefusedError if it cannot be."""
        self._last += 1
        made = Point(self._last, kind, row, text, is_temporary)
        self.all.append(made)
        self.tell([made.list])
        if not made.facts["verified"]:
            self.all.remove(made)
            self.tell([made.list])
            self._last -= 1
            raise RefusedError(f"{text}: {made.facts['message']}")
        return made

    def tell(self, kinds: Iterable[str]) -> None:
        """Send lists to the server."""
        for kind in set(kinds):
            mine = [one for one in self.all if one.list == kind and one.is_on]
            more = {} if kind in REQUESTS else {"source": {"path": kind}}
            request = REQUESTS.get(kind, "setBreakpoints")
            told = self._client.ask(request, breakpoints=[one.row for one in mine], **more)["breakpoints"]
            for one, facts in zip(mine, told, strict=True):
                one.facts = facts

    def numbered(self, text: str) -> Point:
        """The one of that number. Raises RefusedError."""
        found = next((one for one in self.all if text == str(one.number)), None)
        if found is None:
            raise RefusedError(f"there is no breakpoint {text or 'without a number'}")
        return found

    def drop(self, points: list[Point]) -> None:
        """Delete some."""
        for one in points:
            self.all.remove(one)
        self.tell(one.list for one in points)

    def met(self, ids: list[int]) -> list[Point]:
        """Those that ended a run; the temporary ones go."""
        hit = [one for one in self.all if one.is_on and one.facts.get("id") in ids]
        self.drop([one for one in hit if one.is_temporary])
        return hit
