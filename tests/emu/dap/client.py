"""Client of the Debug Adapter Protocol over the standard streams of `emu debug` or another command."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path
from queue import Empty, Queue
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
PATIENCE = 3600


class Client:
    """Client that sends requests, waits for responses and stores events."""

    def __init__(self, *words: str) -> None:
        command = [sys.executable, "-m", *(words or ("emu", "debug"))]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)
        self.inbox: Queue[dict[str, Any]] = Queue()
        self.events: list[dict[str, Any]] = []
        self.seq = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        stream = self.process.stdout
        assert stream is not None
        while line := stream.readline():
            if line.lower().startswith(b"content-length:"):
                size = int(line.split(b":")[1])
                stream.readline()
                self.inbox.put(json.loads(stream.read(size)))

    def _next(self) -> dict[str, Any]:
        try:
            return self.inbox.get(timeout=PATIENCE)
        except Empty:
            raise AssertionError("the adapter does not respond") from None

    def send(self, command: str, **arguments: Any) -> int:
        """Send a request and return its sequence number."""
        self.seq += 1
        body = json.dumps({"seq": self.seq, "type": "request", "command": command, "arguments": arguments}).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()
        return self.seq

    def ask(self, command: str, **arguments: Any) -> dict[str, Any]:
        """Send a request that must succeed and return the body of the response."""
        reply = self.asked(command, **arguments)
        assert reply["success"], reply
        body: dict[str, Any] = reply["body"]
        return body

    def asked(self, command: str, **arguments: Any) -> dict[str, Any]:
        """Send a request and return the whole response."""
        number = self.send(command, **arguments)
        while True:
            message = self._next()
            if message["type"] == "response" and message["request_seq"] == number:
                return message
            self.events.append(message)

    def event(self, name: str) -> dict[str, Any]:
        """Return the body of the next event `name`."""
        while True:
            for place, message in enumerate(self.events):
                if message["type"] == "event" and message["event"] == name:
                    del self.events[place]
                    body: dict[str, Any] = message["body"]
                    return body
            self.events.append(self._next())

    def said(self) -> str:
        """Return the program's output so far."""
        return "".join(e["body"]["output"] for e in self.events if e["type"] == "event" and e["event"] == "output")

    def start(self, program: str, **arguments: Any) -> None:
        """Initialise the adapter and launch a program."""
        self.ask("initialize", clientID="test", adapterID="emu", pathFormat="path")
        self.ask("launch", program=program, **arguments)
        self.event("initialized")

    def top(self) -> dict[str, Any]:
        """Return the innermost frame."""
        frame: dict[str, Any] = self.ask("stackTrace", threadId=1, startFrame=0, levels=1)["stackFrames"][0]
        return frame

    def evaluate(self, expression: str, context: str = "watch") -> str:
        """Return the value of an expression in the innermost frame, as text."""
        return str(self.ask("evaluate", expression=expression, context=context, frameId=self.top()["id"])["result"])

    def close(self) -> None:
        """Disconnect and wait for the adapter to end."""
        self.send("disconnect")
        assert self.process.wait(timeout=PATIENCE) == 0
