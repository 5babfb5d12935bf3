"""Debug sessions for damage: the requests of a whole one, and a server that must answer them."""

from __future__ import annotations

import contextlib
import io
import json
import os
from pathlib import Path

from emu.commands.debug import machine_of
from emu.dap.server import Server
from emu.dap.wire import Wire


def conversation(image: Path) -> bytes:
    """Return the requests of a whole debug session: only the bodies, one per line, so that damage does not affect the
    framing."""
    source = str(image.with_suffix(".c"))
    asked = [
        ("initialize", {"adapterID": "x", "linesStartAt1": True}),
        ("launch", {"program": str(image), "stopOnEntry": True, "board": "none"}),
        ("setBreakpoints", {"source": {"path": source}, "breakpoints": [
            {"line": 4, "condition": "by == 3", "hitCondition": ">2"}]}),
        ("setFunctionBreakpoints", {"breakpoints": [{"name": "step"}]}),
        ("setInstructionBreakpoints", {"breakpoints": [{"instructionReference": "0x200", "offset": 2}]}),
        ("setDataBreakpoints", {"breakpoints": [{"dataId": "2048:2", "accessType": "write"}]}),
        ("configurationDone", {}),
        ("threads", {}),
        ("stackTrace", {"threadId": 1, "startFrame": 0, "levels": 20}),
        ("scopes", {"frameId": 1}),
        ("variables", {"variablesReference": 1, "start": 0, "count": 5}),
        ("evaluate", {"expression": "robot.speed[1] + 3 * W0", "frameId": 1, "context": "watch"}),
        ("evaluate", {"expression": "/goto 20", "context": "repl"}),
        ("setVariable", {"variablesReference": 1, "name": "robot", "value": "3"}),
        ("setExpression", {"expression": "robot.total", "value": "0x7fff"}),
        ("readMemory", {"memoryReference": "0x800", "offset": -2, "count": 64}),
        ("writeMemory", {"memoryReference": "0x900", "data": "AAEC"}),
        ("disassemble", {"memoryReference": "0x200", "instructionOffset": -4, "instructionCount": 16}),
        ("stepIn", {"threadId": 1, "granularity": "instruction"}),
        ("stepBack", {"threadId": 1}),
        ("dataBreakpointInfo", {"name": "robot", "variablesReference": 1}),
        ("breakpointLocations", {"source": {"path": source}, "line": 1, "endLine": 30}),
        ("exceptionInfo", {"threadId": 1}),
        ("disconnect", {"terminateDebuggee": True}),
    ]  # fmt: skip
    lines = [
        json.dumps({"seq": number, "type": "request", "command": command, "arguments": arguments})
        for number, (command, arguments) in enumerate(asked, start=1)
    ]
    return "\n".join(lines).encode()


def converse(data: bytes) -> str:
    """Send every line as a message to a server, which must respond until the connection ends."""
    reading, writing = os.pipe()
    written = io.BytesIO()
    wire = Wire(reading, written)
    try:
        with os.fdopen(writing, "wb") as sender, contextlib.suppress(BrokenPipeError):
            for line in data.split(b"\n"):
                sender.write(b"Content-Length: %d\r\n\r\n%s" % (len(line), line))
        Server(wire, machine_of).serve()
    finally:
        wire.close()
        os.close(reading)
    assert b"Traceback" not in written.getvalue()
    return "answered"
