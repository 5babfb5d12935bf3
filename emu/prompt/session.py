"""A session at the prompt: where the machine stands, what is selected, and what places are called."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from emu.prompt import formatting
from emu.prompt.breakpoint_list import Points
from emu.prompt.client import Client, RefusedError, Row

LISTED: Final = 10
"""Lines of a listing, and instructions of a disassembly."""


class Session:
    """What commands work on; `write(text)` prints a line."""

    def __init__(self, client: Client, write: Callable[[str], None]) -> None:
        self.client: Final = client
        self.points: Final = Points(client)
        self.at_fault = False
        """The machine stands at a fault of the firmware."""
        self.write: Final = write
        self.frames: list[Row] = []
        self.at = 0
        self.thread = 1
        self.listed: tuple[str, int] = ("", 0)
        self.has_gone = False

    def start(self, launch: Row) -> None:
        """Begin to debug; the machine stands. Raises RefusedError."""
        self.client.ask("initialize", clientID="prompt")
        self.client.ask("launch", **launch, stopOnEntry=True)
        self.client.ask("setExceptionBreakpoints", filters=["fault"])
        self.stands(self.client.go("configurationDone"))

    @property
    def frame(self) -> Row | None:
        """The selected frame."""
        return self.frames[self.at] if self.frames else None

    def time(self) -> str:
        """Cycle, seconds, how far in the past."""
        return str(self.client.ask("evaluate", expression="/time", context="repl")["result"])

    def go(self, request: str, **arguments: Any) -> str:
        """Let the machine go, and tell where it stands then; why it does. Raises RefusedError."""
        halt = self.client.go(request, threadId=self.thread, **arguments)
        self.has_gone = request != "restart"
        self.stands(halt)
        return str(halt["reason"])

    def console(self, text: str) -> None:
        """Say something to the server's console. Raises RefusedError."""
        halt = self.client.go("evaluate", expression=text, context="repl")
        if halt:
            self.has_gone = True
            self.stands(halt)
        else:
            self.write(self.client.said)

    def leave(self, ends_all: bool) -> None:
        """End the session; with `ends_all` also what is being debugged."""
        self.client.ask("disconnect", terminateDebuggee=ends_all)

    def stands(self, halt: Row) -> None:
        """Tell where the machine stands now, and why."""
        hit = self.points.met(halt.get("hitBreakpointIds", []))
        self.at_fault = halt["reason"] == "exception"
        self.select(int(halt["threadId"]))
        why = " ".join([halt["reason"], *(str(one.number) for one in hit)])
        text = halt.get("description", "")
        if self.at_fault:
            self.write(self.client.ask("exceptionInfo", threadId=self.thread)["description"].rstrip())
        elif text or halt["reason"] not in ("step", "goto"):
            self.write(why + (f": {text}" if text else ""))
        self.where()

    def select(self, thread: int) -> None:
        """Look at the innermost frame of a thread."""
        self.thread, self.at = thread, 0
        self.frames = self.client.ask("stackTrace", threadId=thread)["stackFrames"]

    def where(self) -> None:
        """Tell where the selected frame stands."""
        frame = self.frame
        if frame is None:
            self.write(self.time())
            return
        self.write(f"{formatting.frame(frame)}, {self.time()}")
        if frame.get("source"):
            path, line = frame["source"]["path"], int(frame["line"])
            self.listed = path, max(line - LISTED // 2, 1)
            try:
                self.write(formatting.source(path, line, line, line))
            except RefusedError as missing:
                self.write(f"({missing})")

    def evaluated(self, text: str) -> Row:
        """An expression in the selected frame. Raises RefusedError."""
        if not text:
            raise RefusedError("expected an expression of C")
        frame = {"frameId": self.frame["id"]} if self.frame is not None else {}
        return self.client.ask("evaluate", expression=text, context="watch", **frame)

    def number(self, text: str) -> int:
        """The value of an expression; of an array its address. Raises RefusedError."""
        found = self.evaluated(text)
        if found.get("type", "").endswith("]"):
            return int(found["memoryReference"], 16)
        return int(formatting.number(found["result"], "d"))

    def scope(self, name: str) -> list[Row]:
        """Variables of a scope of the selected frame. Raises RefusedError."""
        if self.frame is None:
            raise RefusedError("there is no frame")
        scopes = self.client.ask("scopes", frameId=self.frame["id"])["scopes"]
        wanted = next(one["variablesReference"] for one in scopes if one["name"] == name)
        rows: list[Row] = self.client.ask("variables", variablesReference=wanted)["variables"]
        return rows

    # Places

    def source_of(self, text: str) -> tuple[str, int]:
        """Path and line of a location. Raises RefusedError."""
        kind, row = self.place(text)
        if kind not in ("function", "instruction"):
            return kind, int(row["line"])
        address = self.number(row["name"]) if kind == "function" else int(row["instructionReference"], 16)
        first = self.client.ask("disassemble", memoryReference=f"{address:#08x}", instructionCount=1)["instructions"][0]
        if not first.get("location"):
            raise RefusedError(f"no source is known for {text}")
        return first["location"]["path"], int(first["line"])

    def place(self, text: str) -> tuple[str, Row]:
        """Which list of breakpoints a location belongs to, and its row there. Raises RefusedError."""
        if not text:
            raise RefusedError("expected FUNCTION, LINE, FILE:LINE or *ADDRESS")
        if text.startswith("*"):
            return "instruction", {"instructionReference": f"{self.number(text[1:]):#08x}"}
        file, colon, line = text.rpartition(":")
        if not line.isdecimal():
            return "function", {"name": text}
        return self.path(file if colon else ""), {"line": int(line)}

    def path(self, file: str) -> str:
        """A source by its name, or the one of the selected frame. Raises RefusedError."""
        if not file:
            if self.listed[0]:
                return self.listed[0]
            raise RefusedError("there is no source here: say FILE:LINE")
        paths = [one["path"] for one in self.client.ask("loadedSources")["sources"]]
        parts = Path(file).parts
        found = [path for path in paths if Path(path).parts[-len(parts) :] == parts]
        if not found:
            raise RefusedError(f"no code of this program comes from {file}")
        return str(found[0])
