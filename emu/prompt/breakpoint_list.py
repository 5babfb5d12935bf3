"""Numbered breakpoints of a prompt. For each kind, the server receives the complete list."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from emu.prompt.client import Client, CommandRefusedError, Row

REQUESTS: Final = {
    "function": "setFunctionBreakpoints", "instruction": "setInstructionBreakpoints", "data": "setDataBreakpoints",
}  # fmt: skip


@dataclass(eq=False, slots=True)
class PromptBreakpoint:
    """One breakpoint, as set by the user."""

    number: int
    list: str
    """Key of the list that contains the breakpoint: a key of REQUESTS, or the path of a source file."""
    row: Row
    """Arguments of the breakpoint for the debug protocol's request."""
    text: str
    """Location as typed by the user."""
    is_temporary: bool = False
    is_enabled: bool = True
    facts: Row = field(default_factory=dict)

    def __str__(self) -> str:
        line = str(self.facts.get("line", ""))
        row = self.row
        words = {"if": row.get("condition"), "hits": row.get("hitCondition"), "log": row.get("logMessage")}
        more = [
            self.text + (f" (line {line})" if line and not self.text.endswith(line) else ""),
            *(f"{word} {text}" for word, text in words.items() if text),
            *(["once"] if self.is_temporary else []),
            *([] if self.is_enabled else ["off"]),
        ]
        return f"{self.number}: {', '.join(more)}"


class BreakpointList:
    """All breakpoints of a session."""

    def __init__(self, client: Client) -> None:
        self.all: Final[list[PromptBreakpoint]] = []
        self._client: Final = client
        self._last = 0

    def add(self, kind: str, row: Row, text: str, is_temporary: bool = False) -> PromptBreakpoint:
        """Set a breakpoint. Raises CommandRefusedError if the server refuses it."""
        self._last += 1
        made = PromptBreakpoint(self._last, kind, row, text, is_temporary)
        self.all.append(made)
        self.send([made.list])
        if not made.facts["verified"]:
            self.all.remove(made)
            self.send([made.list])
            self._last -= 1
            raise CommandRefusedError(f"{text}: {made.facts['message']}")
        return made

    def send(self, kinds: Iterable[str]) -> None:
        """Send the complete lists of the given kinds to the server."""
        for kind in set(kinds):
            selected = [one for one in self.all if one.list == kind and one.is_enabled]
            more = {} if kind in REQUESTS else {"source": {"path": kind}}
            request = REQUESTS.get(kind, "setBreakpoints")
            reported = self._client.ask(request, breakpoints=[one.row for one in selected], **more)["breakpoints"]
            for one, facts in zip(selected, reported, strict=True):
                one.facts = facts

    def find(self, text: str) -> PromptBreakpoint:
        """Return the breakpoint whose number is `text`. Raises CommandRefusedError if there is none."""
        found = next((one for one in self.all if text == str(one.number)), None)
        if found is None:
            raise CommandRefusedError(f"there is no breakpoint {text or 'without a number'}")
        return found

    def delete(self, breakpoints: list[PromptBreakpoint]) -> None:
        """Delete breakpoints and send the remaining ones to the server."""
        for one in breakpoints:
            self.all.remove(one)
        self.send(one.list for one in breakpoints)

    def take_hit(self, ids: list[int]) -> list[PromptBreakpoint]:
        """Return the breakpoints whose hit ended a run, and delete the temporary ones among them."""
        hit = [one for one in self.all if one.is_enabled and one.facts.get("id") in ids]
        self.delete([one for one in hit if one.is_temporary])
        return hit
