"""Protocol requests that set breakpoints at lines, functions, instructions, data and faults."""

from __future__ import annotations

from typing import Any, Final

from emu.avr.observation import WATCH_BYTES
from emu.dap.breakpoints import Breakpoint, hit_condition_error
from emu.dap.state_requests import StateRequests
from emu.dap.variables import Row
from emu.debug.expressions.expression import evaluate
from emu.debug.inlining import inlined_entries
from emu.debug.value import Value

ACCESSES: Final = ("read", "write", "readWrite")
"""Access types at which a data breakpoint can stop."""


class BreakpointRequests(StateRequests):
    """Handlers of breakpoint requests. A handler is called `_do_` followed by the request's name."""

    _last_id = 0
    """Id of the breakpoint created last."""

    def _breakpoint(self, requested: Row, kind: str, addresses: tuple[int, ...], **more: Any) -> Breakpoint:
        self._last_id += 1
        hit = str(requested.get("hitCondition") or "")
        made = Breakpoint(
            self._last_id, kind, addresses, str(requested.get("condition") or ""), hit,
            str(requested.get("logMessage") or ""), more.pop("size", 0), more.pop("access", "write"),
        )  # fmt: skip
        missing = more.pop("problem", "there is no code")
        problem = hit_condition_error(hit) or ("" if addresses else missing)
        if problem:
            made.addresses = ()
        made.facts = {"id": made.id, "verified": not problem} | ({"message": problem} if problem else {}) | more
        return made

    def _set(self, key: str, made: list[Breakpoint]) -> Row:
        self._debuggee.set_breakpoints(key, made)
        return {"breakpoints": [one.facts for one in made]}

    def _do_setBreakpoints(self, arguments: Row) -> Row:
        path = str(arguments["source"].get("path", arguments["source"].get("name", "")))
        requested = arguments.get("breakpoints") or [{"line": line} for line in arguments.get("lines", [])]
        made = []
        for one in requested:
            line, addresses = self._sources.addresses(path, int(one["line"]))
            more: Row = {"line": line or one["line"], "source": {"path": path}}
            if addresses:
                more["instructionReference"] = f"{addresses[0]:#08x}"
            problem = "the program has no code at or after this line"
            made.append(self._breakpoint(one, "source", addresses, problem=problem, **more))
        return self._set(f"source {path}", made)

    def _do_setFunctionBreakpoints(self, arguments: Row) -> Row:
        made = []
        for one in arguments["breakpoints"]:
            addresses = self._function_entries(one["name"])
            made.append(self._breakpoint(one, "function", addresses, problem=f"there is no function {one['name']}"))
        return self._set("function", made)

    def _function_entries(self, name: str) -> tuple[int, ...]:
        """Return the end of a function's prologue, or the first address of each copy if it was inlined everywhere."""
        inspector = self._debuggee.inspector
        try:
            return (inspector.prologue_end(self._debuggee.machine.program_address(name)),)
        except KeyError:
            return inlined_entries(inspector.debug, name)

    def _do_setInstructionBreakpoints(self, arguments: Row) -> Row:
        made = []
        for one in arguments["breakpoints"]:
            address = int(one["instructionReference"], 0) + int(one.get("offset", 0))
            code = self._debuggee.inspector.is_code(address) and not address & 1
            made.append(self._breakpoint(one, "instruction", (address,) if code else ()))
        return self._set("instruction", made)

    def _do_setExceptionBreakpoints(self, arguments: Row) -> Row:
        options = [one["filterId"] for one in arguments.get("filterOptions", [])]
        self._debuggee.stops_at_faults = "fault" in [*arguments.get("filters", []), *options]
        return {}

    def _do_dataBreakpointInfo(self, arguments: Row) -> Row:
        size = int(arguments.get("bytes") or 0)
        if arguments.get("asAddress"):
            address: int | None = int(str(arguments["name"]), 0)
            size = size or 2
        else:
            value = self._named(arguments)
            address = value.address if isinstance(value, Value) else None
            size = size or (value.type.bytes if isinstance(value, Value) else 0)
        if address is None:
            return {"dataId": None, "description": "the object is not in memory"}
        if problem := self._not_in_memory(address, size):
            return {"dataId": None, "description": problem}
        entries = [one.raw.entry for one in self._debuggee.frames() if one.raw.entry is not None]
        stack = self._debuggee.stack
        stays = not entries or not min(*entries, stack) <= address < max(*entries, stack)
        text = f"{arguments['name']} ({size} bytes at {address:#06x})"
        return {
            "dataId": f"{address:04x}/{size}",
            "description": text,
            "accessTypes": list(ACCESSES),
            "canPersist": stays,
        }

    def _not_in_memory(self, address: int, size: int) -> str:
        """Return why a data breakpoint cannot observe a range of data space; empty if it can."""
        try:
            self._debuggee.machine.peek_bytes(address, size)
        except ValueError as error:
            return str(error)
        return ""

    def _named(self, arguments: Row) -> Any:
        reference = arguments.get("variablesReference")
        if reference:
            return self._references.find(int(reference), str(arguments["name"]))
        frame = self._references.frame(arguments.get("frameId"))
        return evaluate(self._debuggee.inspector, str(arguments["name"]), frame)

    def _do_setDataBreakpoints(self, arguments: Row) -> Row:
        made = []
        for one in arguments["breakpoints"]:
            address, _, size = str(one["dataId"]).partition("/")
            access = one.get("accessType") or "write"
            problem = self._not_in_memory(int(address, 16), int(size))
            if not problem and not self._debuggee.inspector.processor.has_native_instruments:
                problem = _beyond_watch(arguments, access, int(size))
            if access not in ACCESSES:
                problem = f"expected one of {', '.join(ACCESSES)}, not {access!r}"
            addresses = () if problem else (int(address, 16),)
            made.append(self._breakpoint(one, "data", addresses, size=int(size), access=access, problem=problem))
        return self._set("data", made)

    def _do_breakpointLocations(self, arguments: Row) -> Row:
        first = int(arguments["line"])
        last = int(arguments.get("endLine", first))
        rows = self._sources.lines(str(arguments["source"].get("path", "")))
        lines = sorted({row.line for row in rows if first <= row.line <= last})
        return {"breakpoints": [{"line": line} for line in lines]}


def _beyond_watch(arguments: Row, access: str, size: int) -> str:
    """Return why a machine that watches one range for changes does not support a data breakpoint; empty if it does."""
    if access != "write":
        return "reads are not observed on this processor: use `watch`, which stops at changes"
    if len(arguments["breakpoints"]) > 1:
        return "this processor has one watchpoint at a time"
    return f"{size} bytes are more than the {WATCH_BYTES} that can be watched" if size > WATCH_BYTES else ""
