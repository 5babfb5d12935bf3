"""State of a prompt: current stop, selected thread and frame; parsing of locations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from emu.prompt import formatting
from emu.prompt.appearance import INDENT, Style, fold
from emu.prompt.breakpoint_list import BreakpointList
from emu.prompt.client import Client, CommandRefusedError, Row

LISTING_LINES: Final = 10
"""Number of lines in a source listing, and of instructions in a disassembly."""


class DebugSession:
    """State on which the commands act. `print_text(text, style)` prints lines."""

    def __init__(self, client: Client, print_text: Callable[[str, Style], None]) -> None:
        self.client: Final = client
        self.breakpoints: Final = BreakpointList(client)
        self.at_fault = False
        """Whether the machine has stopped at a firmware fault."""
        self._print: Final = print_text
        self.frames: list[Row] = []
        self.at = 0
        self.thread = 1
        self.list_position: tuple[str, int] = ("", 0)
        self.has_run = False

    def write(self, text: str, style: Style = "", indent: int = INDENT) -> None:
        """Print text in lines of at most 80 columns. Lines that continue one are indented by `indent` columns."""
        self._print(fold(text, indent), style)

    def write_code(self, text: str) -> None:
        """Print lines of source code or a disassembly whole. The current line begins with `>`."""
        for line in text.split("\n"):
            self._print(line, "here" if line.startswith(">") else "")

    def start(self, launch: Row) -> None:
        """Launch the debuggee, which is then paused at its entry. Raises CommandRefusedError."""
        self.client.ask("initialize", clientID="prompt")
        self.client.ask("launch", **launch, stopOnEntry=True)
        self.client.ask("setExceptionBreakpoints", filters=["fault"])
        self.report_stop(self.client.resume("configurationDone"))

    @property
    def frame(self) -> Row | None:
        """The selected frame, None if there is none."""
        return self.frames[self.at] if self.frames else None

    def time(self) -> str:
        """Return as text the cycle, the seconds, and the distance to the present."""
        return str(self.client.ask("evaluate", expression="/time", context="repl")["result"])

    def resume(self, request: str, **arguments: Any) -> str:
        """Send a request that runs, steps or rewinds the machine; report the stop and return its reason.

        Raises CommandRefusedError.
        """
        event = self.client.resume(request, threadId=self.thread, **arguments)
        self.has_run = request != "restart"
        self.report_stop(event)
        return str(event["reason"])

    def run_console_command(self, text: str) -> None:
        """Execute a console command of the server. Raises CommandRefusedError."""
        event = self.client.resume("evaluate", expression=text, context="repl")
        if event:
            self.has_run = True
            self.report_stop(event)
        else:
            self.write(self.client.result_text)

    def disconnect(self, terminate_debuggee: bool) -> None:
        """End the session. With `terminate_debuggee`, also end the debuggee."""
        self.client.ask("disconnect", terminateDebuggee=terminate_debuggee)

    def report_stop(self, event: Row) -> None:
        """Print the reason and the location of a stop."""
        hit = self.breakpoints.take_hit(event.get("hitBreakpointIds", []))
        self.at_fault = event["reason"] == "exception"
        self.select(int(event["threadId"]))
        why = " ".join([event["reason"], *(str(one.number) for one in hit)])
        text = event.get("description", "")
        if self.at_fault:
            self.write(self.client.ask("exceptionInfo", threadId=self.thread)["description"].rstrip(), "fault")
        elif text or event["reason"] not in ("step", "goto"):
            self.write(why + (f": {text}" if text else ""), "stop")
        self.show_location()

    def select(self, thread: int) -> None:
        """Select the innermost frame of a thread."""
        self.thread, self.at = thread, 0
        self.frames = self.client.ask("stackTrace", threadId=thread)["stackFrames"]

    def show_location(self) -> None:
        """Print the location of the selected frame."""
        frame = self.frame
        if frame is None:
            self.write(self.time())
            return
        self.write(f"{formatting.frame(frame)}, {self.time()}", "location")
        if frame.get("source"):
            path, line = frame["source"]["path"], int(frame["line"])
            self.list_position = path, max(line - LISTING_LINES // 2, 1)
            try:
                self.write_code(formatting.source(path, line, line, line))
            except CommandRefusedError as missing:
                self.write(f"({missing})")

    def evaluate(self, text: str) -> Row:
        """Evaluate an expression in the selected frame. Raises CommandRefusedError."""
        if not text:
            raise CommandRefusedError("expected an expression of C")
        frame = {"frameId": self.frame["id"]} if self.frame is not None else {}
        return self.client.ask("evaluate", expression=text, context="watch", **frame)

    def number(self, text: str) -> int:
        """Return an expression's value; for an array, its address. Raises CommandRefusedError."""
        found = self.evaluate(text)
        if found.get("type", "").endswith("]"):
            return int(found["memoryReference"], 16)
        return int(formatting.number(found["result"], "d"))

    def scope(self, name: str) -> list[Row]:
        """Return the variables in a scope of the selected frame. Raises CommandRefusedError."""
        if self.frame is None:
            raise CommandRefusedError("there is no frame")
        scopes = self.client.ask("scopes", frameId=self.frame["id"])["scopes"]
        requested = next(one["variablesReference"] for one in scopes if one["name"] == name)
        rows: list[Row] = self.client.ask("variables", variablesReference=requested)["variables"]
        return rows

    # Locations

    def source_location(self, text: str) -> tuple[str, int]:
        """Return the path and line of a location. Raises CommandRefusedError."""
        kind, row = self.location(text)
        if kind not in ("function", "instruction"):
            return kind, int(row["line"])
        address = self.number(row["name"]) if kind == "function" else int(row["instructionReference"], 16)
        first = self.client.ask("disassemble", memoryReference=f"{address:#08x}", instructionCount=1)["instructions"][0]
        if not first.get("location"):
            raise CommandRefusedError(f"no source is known for {text}")
        return first["location"]["path"], int(first["line"])

    def location(self, text: str) -> tuple[str, Row]:
        """Return the breakpoint list for a location, and its entry in that list. Raises CommandRefusedError."""
        if not text:
            raise CommandRefusedError("expected FUNCTION, LINE, FILE:LINE or *ADDRESS")
        if text.startswith("*"):
            return "instruction", {"instructionReference": f"{self.number(text[1:]):#08x}"}
        file, colon, line = text.rpartition(":")
        if not line.isdecimal():
            return "function", {"name": text}
        return self.path(file if colon else ""), {"line": int(line)}

    def path(self, file: str) -> str:
        """Return the path of the source called `file`; if empty, of the selected frame's.

        Raises CommandRefusedError.
        """
        if not file:
            if self.list_position[0]:
                return self.list_position[0]
            raise CommandRefusedError("there is no source here: say FILE:LINE")
        paths = [one["path"] for one in self.client.ask("loadedSources")["sources"]]
        parts = Path(file).parts
        found = [path for path in paths if Path(path).parts[-len(parts) :] == parts]
        if not found:
            raise CommandRefusedError(f"no code of this program comes from {file}")
        return str(found[0])
