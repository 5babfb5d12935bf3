"""Protocol requests that read or change a paused machine: values, memory, instructions, names."""

from __future__ import annotations

import base64
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Final

from emu.dap.completions import completions
from emu.dap.console import console_command
from emu.dap.debuggee import Debuggee, StopEvent
from emu.dap.sfrs import sfr_groups
from emu.dap.state_changes import MemoryWrite, StateChange, assignment
from emu.dap.variables import ReferenceTable, Row, SourceFiles, disassembly_rows
from emu.debug.expressions.expression import evaluate
from emu.debug.value import Value

MAX_ROWS: Final = 1 << 16
"""Maximum number of instructions or bytes per request: the size of a chip's memory."""


class RequestRefusedError(Exception):
    """The request cannot be executed. The text is shown to the user."""


class StateRequests(ABC):
    """Handlers of requests about state. A handler is called `_do_` followed by the request's name.

    `_target` is the debuggee, `_views` its views; both are None before the launch.
    """

    _target: Debuggee | None
    _views: tuple[ReferenceTable, SourceFiles] | None

    @abstractmethod
    def _run_action(self, action: Callable[[], StopEvent]) -> None:
        """Execute a function that runs, steps or rewinds the machine, and report where it stops."""

    @abstractmethod
    def _rewind_environment(self) -> None:
        """Rewind the environment to the machine's time. Raises RequestRefusedError if the client interrupts it."""

    @abstractmethod
    def _apply(self, change: StateChange) -> None:
        """Apply a change now, and again whenever a rewind passes this time. Raises RequestRefusedError."""

    def _environment_state(self) -> list[tuple[str, str]]:
        """Return the environment's state at the machine's time. Raises RequestRefusedError."""
        environment = self._debuggee.history.environment
        if environment is None:
            raise RequestRefusedError("this machine has no environment")
        self._rewind_environment()
        return environment.describe()

    @property
    def _debuggee(self) -> Debuggee:
        if self._target is None:
            raise RequestRefusedError("no program has been launched")
        return self._target

    @property
    def _references(self) -> ReferenceTable:
        if self._views is None:
            raise RequestRefusedError("no program has been launched")
        return self._views[0]

    @property
    def _sources(self) -> SourceFiles:
        if self._views is None:
            raise RequestRefusedError("no program has been launched")
        return self._views[1]

    def _do_scopes(self, arguments: Row) -> Row:
        frame = self._references.frame(int(arguments["frameId"]))
        return {"scopes": self._references.scopes(frame) if frame is not None else []}

    def _do_variables(self, arguments: Row) -> Row:
        start, count = int(arguments.get("start") or 0), int(arguments.get("count") or 0)
        return {"variables": self._references.variables(int(arguments["variablesReference"]), start, count)}

    def _do_evaluate(self, arguments: Row) -> Any:
        text = str(arguments["expression"]).strip()
        if arguments.get("context") == "repl" and text.startswith("/"):
            if text == "/world":
                return {
                    "result": "\n".join(": ".join(one) for one in self._environment_state()),
                    "variablesReference": 0,
                }
            result = console_command(self._debuggee, text[1:])
            if isinstance(result, str):
                return {"result": result, "variablesReference": 0}
            return {"result": "", "variablesReference": 0}, lambda: self._run_action(result)
        name, equals, value = text.partition("=")
        if arguments.get("context") == "repl" and equals and not value.startswith("=") and name[-1:] not in "!<>=":
            return self._assign(name.strip(), value.strip(), arguments)
        return self._result(text, arguments)

    def _result(self, text: str, arguments: Row) -> Row:
        found = evaluate(self._debuggee.inspector, text, self._references.frame(arguments.get("frameId")))
        if not isinstance(found, Value):
            return {"result": str(found), "variablesReference": 0}
        row = self._references.row_of(found, text)
        if row["value"].startswith("<"):
            raise RequestRefusedError(row["value"][1:-1])
        return {"result": row.pop("value"), **row}

    def _assign(self, name: str, text: str, arguments: Row) -> Row:
        inspector, frame = self._debuggee.inspector, self._references.frame(arguments.get("frameId"))
        place = evaluate(inspector, name, frame)
        if not isinstance(place, Value):
            raise RequestRefusedError(f"{name} denotes no object")
        self._write(place, text, arguments)
        return self._result(name, arguments)

    def _write(self, place: Value, text: str, arguments: Row) -> None:
        value = evaluate(self._debuggee.inspector, text, self._references.frame(arguments.get("frameId")))
        number = value.get() if isinstance(value, Value) else value
        self._apply(assignment(place, number))

    def _do_setVariable(self, arguments: Row) -> Row:
        place = self._references.find(int(arguments["variablesReference"]), str(arguments["name"]))
        if place is None:
            raise RequestRefusedError(f"{arguments['name']} cannot be set")
        self._write(place, str(arguments["value"]), arguments)
        return self._references.row_of(place.rebind(self._debuggee.inspector), str(arguments["name"]))

    def _do_setExpression(self, arguments: Row) -> Row:
        row = self._assign(str(arguments["expression"]), str(arguments["value"]), arguments)
        return {"value": row.pop("result"), **row}

    def _do_disassemble(self, arguments: Row) -> Row:
        address = int(str(arguments["memoryReference"]), 0) + int(arguments.get("offset") or 0)
        address += 2 * int(arguments.get("instructionOffset") or 0)
        symbols = bool(arguments.get("resolveSymbols"))
        count = _size(arguments, "instructionCount")
        return {"instructions": disassembly_rows(self._debuggee.inspector, self._sources, address & ~1, count, symbols)}

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
        self._apply(MemoryWrite(address, data))
        return {"bytesWritten": len(data)}

    def _do_completions(self, arguments: Row) -> Row:
        text = str(arguments["text"])[: int(arguments["column"]) - 1]
        names, replaced = completions(self._debuggee.inspector, self._references.frame(arguments.get("frameId")), text)
        start = len(text) - replaced
        return {"targets": [{"label": name, "type": kind, "start": start, "length": replaced} for name, kind in names]}

    def _do_loadedSources(self, _arguments: Row) -> Row:
        return {"sources": self._sources.all()}

    def _do_sfrs(self, _arguments: Row) -> Row:
        """Return the registers for an editor's register view; `sfrs` is a request of this project."""
        target = self._debuggee
        groups = target.inspector.processor.register_groups()
        return {"groups": sfr_groups(target.machine) if groups is None else groups}


def _size(arguments: Row, name: str) -> int:
    """Return an argument that is a number of rows or bytes. Raises RequestRefusedError, KeyError, ValueError."""
    count = int(arguments[name])
    if not 0 <= count <= MAX_ROWS:
        raise RequestRefusedError(f"{name} {count} is not within 0 to {MAX_ROWS}")
    return count
