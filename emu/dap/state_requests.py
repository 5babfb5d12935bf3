"""Requests that look into a machine that stands, or change what is seen there: values, memory, instructions, names."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Final

from emu.dap.changes import Change, Poked, assigned
from emu.dap.completions import completions
from emu.dap.console import command
from emu.dap.debuggee import Debuggee, Halt
from emu.dap.sfrs import groups
from emu.dap.variables import Row, Sights, Sources, disassembled
from emu.debug.expressions.expression import evaluate
from emu.debug.inspector import Value

MOST_ROWS: Final = 1 << 16
"""Instructions, or bytes of memory, that one request may ask for: as many as there are of either on a chip."""


class Refused(Exception):
    """A request that cannot be done; the text is for the user."""


class Looking(ABC):
    """Answers by `_do_` and the request's name; what is being debugged is `_target` and `_views` once there is one."""

    _target: Debuggee | None
    _views: tuple[Sights, Sources] | None

    @abstractmethod
    def _go(self, act: Callable[[], Halt]) -> None:
        """Let the machine go, and tell where it halts."""

    @abstractmethod
    def _bring(self) -> None:
        """Bring what is around the machine to the time at which it stands. Raises Refused if it was interrupted."""

    @abstractmethod
    def _change(self, change: Change) -> None:
        """Change the machine that stands here, and again whenever it is brought here anew. Raises Refused."""

    def _world(self) -> list[tuple[str, str]]:
        """What is around the machine, at the time at which it stands. Raises Refused."""
        around = self._debuggee.history.around
        if around is None:
            raise Refused("there is nothing around this machine")
        self._bring()
        return around.seen()

    @property
    def _debuggee(self) -> Debuggee:
        if self._target is None:
            raise Refused("nothing is being debugged")
        return self._target

    @property
    def _sights(self) -> Sights:
        if self._views is None:
            raise Refused("nothing is being debugged")
        return self._views[0]

    @property
    def _sources(self) -> Sources:
        if self._views is None:
            raise Refused("nothing is being debugged")
        return self._views[1]

    def _do_scopes(self, arguments: Row) -> Row:
        frame = self._sights.frame(int(arguments["frameId"]))
        return {"scopes": self._sights.scopes(frame) if frame is not None else []}

    def _do_variables(self, arguments: Row) -> Row:
        start, count = int(arguments.get("start") or 0), int(arguments.get("count") or 0)
        return {"variables": self._sights.variables(int(arguments["variablesReference"]), start, count)}

    def _do_evaluate(self, arguments: Row) -> Any:
        text = str(arguments["expression"]).strip()
        if arguments.get("context") == "repl" and text.startswith("/"):
            if text == "/world":
                return {"result": "\n".join(": ".join(one) for one in self._world()), "variablesReference": 0}
            said = command(self._debuggee, text[1:])
            if isinstance(said, str):
                return {"result": said, "variablesReference": 0}
            return {"result": "", "variablesReference": 0}, lambda: self._go(said)
        name, equals, value = text.partition("=")
        if arguments.get("context") == "repl" and equals and not value.startswith("=") and name[-1:] not in "!<>=":
            return self._assigned(name.strip(), value.strip(), arguments)
        return self._result(text, arguments)

    def _result(self, text: str, arguments: Row) -> Row:
        found = evaluate(self._debuggee.inspector, text, self._sights.frame(arguments.get("frameId")))
        if not isinstance(found, Value):
            return {"result": str(found), "variablesReference": 0}
        row = self._sights.shown(found, text)
        if row["value"].startswith("<"):
            raise Refused(row["value"][1:-1])
        return {"result": row.pop("value"), **row}

    def _assigned(self, name: str, text: str, arguments: Row) -> Row:
        inspector, frame = self._debuggee.inspector, self._sights.frame(arguments.get("frameId"))
        place = evaluate(inspector, name, frame)
        if not isinstance(place, Value):
            raise Refused(f"{name} is no place")
        self._write(place, text, arguments)
        return self._result(name, arguments)

    def _write(self, place: Value, text: str, arguments: Row) -> None:
        value = evaluate(self._debuggee.inspector, text, self._sights.frame(arguments.get("frameId")))
        number = value.get() if isinstance(value, Value) else value
        self._change(assigned(place, number))

    def _do_setVariable(self, arguments: Row) -> Row:
        place = self._sights.find(int(arguments["variablesReference"]), str(arguments["name"]))
        if place is None:
            raise Refused(f"{arguments['name']} cannot be set")
        self._write(place, str(arguments["value"]), arguments)
        return self._sights.shown(place.within(self._debuggee.inspector), str(arguments["name"]))

    def _do_setExpression(self, arguments: Row) -> Row:
        row = self._assigned(str(arguments["expression"]), str(arguments["value"]), arguments)
        return {"value": row.pop("result"), **row}

    def _do_disassemble(self, arguments: Row) -> Row:
        address = int(str(arguments["memoryReference"]), 0) + int(arguments.get("offset") or 0)
        address += 2 * int(arguments.get("instructionOffset") or 0)
        symbols = bool(arguments.get("resolveSymbols"))
        count = _size(arguments, "instructionCount")
        return {"instructions": disassembled(self._debuggee.inspector, self._sources, address & ~1, count, symbols)}

    def _do_readMemory(self, arguments: Row) -> Row:
        address = int(str(arguments["memoryReference"]), 0) + int(arguments.get("offset") or 0)
        count = _size(arguments, "count")
        data = b""
        for at in range(address, address + count):
            try:
                data += self._debuggee.machine.peek_bytes(at, 1)
            except ValueError:
                break
        row: Row = {"address": f"{address:#06x}", "unreadableBytes": count - len(data)}
        return row | ({"data": base64.b64encode(data).decode()} if data else {})

    def _do_writeMemory(self, arguments: Row) -> Row:
        address = int(str(arguments["memoryReference"]), 0) + int(arguments.get("offset") or 0)
        data = base64.b64decode(arguments["data"], validate=True)
        if not data:
            return {"bytesWritten": 0}
        self._change(Poked(address, data))
        return {"bytesWritten": len(data)}

    def _do_completions(self, arguments: Row) -> Row:
        text = str(arguments["text"])[: int(arguments["column"]) - 1]
        names, replaced = completions(self._debuggee.inspector, self._sights.frame(arguments.get("frameId")), text)
        start = len(text) - replaced
        return {"targets": [{"label": name, "type": kind, "start": start, "length": replaced} for name, kind in names]}

    def _do_loadedSources(self, _arguments: Row) -> Row:
        return {"sources": self._sources.all()}

    def _do_sfrs(self, _arguments: Row) -> Row:
        """Of our own: what the editor's view of registers shows."""
        return {"groups": groups(self._debuggee.machine)}


def _size(arguments: Row, name: str) -> int:
    """A number of rows or bytes. Raises Refused, KeyError, ValueError."""
    count = int(arguments[name])
    if not 0 <= count <= MOST_ROWS:
        raise Refused(f"{name} {count} is not within 0 to {MOST_ROWS}")
    return count
