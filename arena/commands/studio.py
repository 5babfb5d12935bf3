"""`arena studio SCENE`: interactive trial in a browser page: run, pause, step, rewind, move robots, inspect firmware.

The server listens on the loopback address only. Every request must carry the token of the page's address and come from
the page itself. Requests of other pages in the same browser, or under other host names, are refused.
"""

from __future__ import annotations

import argparse
import hmac
import json
import math
import os
import secrets
import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from html import escape
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from arena.commands.options.arguments import port
from arena.commands.options.plan import add_plan, plan_from
from arena.replay.http import LOOPBACK, PageServer, RequestHandler
from arena.replay.page import page, waiting_page
from arena.scene.loader import FCY
from arena.studio.errors import CommandRefusedError
from arena.studio.process import Call, Studio
from arena.studio.startup import STAGES, Startup
from emu.host.errors import CommandParser

EXAMPLE: Final = "example: arena studio clustering --controller A --seed 3"
LIMIT: Final = 1 << 16
"""Largest size of a request's body, in bytes."""
HEADER: Final = "X-Studio-Token"
COMMANDS: Final[dict[str, dict[str, type]]] = {
    "run": {"pace": float}, "pause": {}, "step": {"quanta": int}, "rewind": {"tick": int},
    "move": {"kind": str, "number": int, "x": float, "y": float}, "send": {"robot": int, "text": str},
    "toggle_breakpoint": {"robot": int, "place": str}, "debug": {"robot": int},
}  # fmt: skip
"""Commands of the page, which are methods of `TrialSession`, and the types of their parameters."""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's options."""
    command = CommandParser(
        description="run one trial in a browser page: pause, step, rewind, move robots and objects, inspect firmware",
        epilog=EXAMPLE,
    )
    add_plan(command)
    command.add_argument(
        "--port", type=port, default=8766, metavar="P", help="TCP port (default 8766, 0: any free port)"
    )
    command.add_argument("--open", action="store_true", help="open the page in the default browser")
    return command


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; until the trial is ready, the page shows the progress of its creation.

    Raises SceneError, LoadError, ValueError, OSError."""
    startup = Startup(lambda: plan_from(options, 1))
    try:
        with StudioServer(startup, options.port) as serving:
            print(f"{serving.address} (Ctrl-C ends)", flush=True)
            with suppress(KeyboardInterrupt), _browser(serving.address) if options.open else nullcontext():
                startup.start(serving.shutdown)
                serving.serve_forever()
                if startup.error is not None:
                    raise startup.error
    finally:
        startup.close()
    return 0


@contextmanager
def _browser(address: str) -> Iterator[None]:
    """Open an address in the default browser, through a private file that is removed at the end.

    Other users see the browser's arguments in the list of processes, so that they must not contain the token.
    """
    handle, name = tempfile.mkstemp(prefix="studio-", suffix=".html")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(f'<!doctype html><meta http-equiv="refresh" content="0; url={escape(address)}">\n')
        webbrowser.open(Path(name).as_uri())
        yield
    finally:
        os.unlink(name)


class StudioServer(PageServer):
    """HTTP server of one studio, with a random token that its page must send. It answers before the trial is ready."""

    def __init__(self, source: Studio | Startup, port: int) -> None:
        self.source: Final = source
        self.token: Final = secrets.token_urlsafe(16)
        super().__init__((LOOPBACK, port), _StudioHandler)
        self.hosts: Final = (f"{LOOPBACK}:{self.server_port}", f"localhost:{self.server_port}")
        self.address: Final = f"http://{self.hosts[0]}/?token={self.token}"

    @property
    def studio(self) -> Studio:
        """The studio. Raises CommandRefusedError if its trial is not ready yet."""
        return self.source.studio if isinstance(self.source, Startup) else self.source

    def progress(self) -> dict[str, Any]:
        """Return the index of the present stage of the startup, and whether the trial is ready."""
        is_ready = not isinstance(self.source, Startup) or self.source.is_ready
        return {"is_ready": is_ready, "stage": self.source.stage if isinstance(self.source, Startup) else len(STAGES)}


def server(studio: Studio, port: int) -> StudioServer:
    """Return a server of `studio` on the loopback address; port 0 is any free port."""
    return StudioServer(studio, port)


class _StudioHandler(RequestHandler):
    server: StudioServer

    def do_GET(self) -> None:
        """Handle a GET request: the page, the progress of the startup, samples, the state of a robot, or the digest."""
        place = urlsplit(self.path)
        query = {name: values[0] for name, values in parse_qs(place.query).items()}
        if not self._is_authorised(query.get("token", "") if place.path == "/" else self.headers.get(HEADER, "")):
            return
        try:
            if place.path == "/progress":
                self.send_json(self.server.progress())
                return
            if place.path == "/" and not self.server.progress()["is_ready"]:
                self.send_page(waiting_page({"token": self.server.token, "header": HEADER, "stages": STAGES}))
                return
            studio = self.server.studio
            if place.path == "/":
                trial, now = studio.ask_all(Call("trial"), Call("status"))
                quantum = trial.scene.clock.quantum_tcy / FCY
                control = {"token": self.server.token, "header": HEADER, "now": now, "quantum": quantum}
                self.send_page(page(trial, studio=control))
            elif place.path == "/more":
                first, epoch = _parse_count(query.get("from")), _parse_count(query.get("epoch"))
                self.send_json(studio.ask("more", first=first, epoch=epoch))
            elif place.path == "/inspect":
                robot = _parse_count(query.get("robot"))
                self.send_json(studio.ask("inspect", robot=robot))
            elif place.path == "/digest":
                state, now = studio.ask_all(Call("digest"), Call("status"))
                self.send_json({"digest": state, "tick": now["tick"]})
            else:
                self.send_error_text(
                    404, "no such path; expected /, /more?from=N&epoch=E, /inspect?robot=N, /digest, /progress or /do"
                )
        except CommandRefusedError as error:
            self.send_error_text(409, str(error))

    def do_POST(self) -> None:
        """Handle a POST request: execute one command."""
        if not self._is_authorised(self.headers.get(HEADER, "")):
            return
        try:
            if urlsplit(self.path).path != "/do":
                raise CommandRefusedError("commands must be sent to /do")
            name, arguments = _parse_command(self._body())
            self.send_json(self.server.studio.ask_all(Call(name, (), arguments), Call("status"))[1])
        except CommandRefusedError as error:
            self.send_error_text(409, str(error))

    def _is_authorised(self, token: str) -> bool:
        """Whether the request comes from the studio's page; otherwise, send an error."""
        origin = self.headers.get("Origin")
        strange = self.headers.get("Host") not in self.server.hosts or (
            origin is not None and origin.removeprefix("http://") not in self.server.hosts
        )
        if strange or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            why = "the page works at its own address only" if strange else "the token is missing or wrong"
            self.send_error_text(403, f"{why}; use the address that `arena studio` printed")
            return False
        return True

    def _body(self) -> Any:
        """Return the request's body as a JSON value. Raises CommandRefusedError."""
        length = _parse_count(self.headers.get("Content-Length"))
        if length > LIMIT:
            raise CommandRefusedError(f"request of {length} bytes; expected at most {LIMIT}")
        try:
            return json.loads(self.rfile.read(length))
        except (ValueError, RecursionError):
            raise CommandRefusedError("the request is not valid JSON") from None


def _parse_count(text: str | None) -> int:
    """Parse a whole number of 0 or more. Raises CommandRefusedError."""
    if text is None or not text.isascii() or not text.isdecimal() or len(text) > 15:
        raise CommandRefusedError(f"{text!r}: expected a whole number")
    return int(text)


def _parse_command(request: Any) -> tuple[str, dict[str, Any]]:
    """Return name and arguments of a command. Raises CommandRefusedError if a name or type is wrong."""
    name = request.get("do") if isinstance(request, dict) else None
    if not isinstance(name, str) or name not in COMMANDS:
        raise CommandRefusedError(f'expected an object with "do", one of {", ".join(COMMANDS)}')
    wanted = COMMANDS[name]
    given = {key: value for key, value in request.items() if key != "do"}
    if set(given) != set(wanted):
        raise CommandRefusedError(f"{name}: expected {', '.join(wanted) or 'no parameters'}")
    return name, {key: _convert(name, key, given[key], kind) for key, kind in wanted.items()}


def _convert(name: str, key: str, value: Any, kind: type) -> Any:
    """Return `value` as a `kind`. A float may be given as a whole number; magnitudes of 1e15 or more are refused."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e15
    if kind is float and is_number and math.isfinite(value):
        return float(value)
    if (kind is int and is_number and isinstance(value, int)) or (kind is str and isinstance(value, str)):
        return value
    raise CommandRefusedError(f"{name}: {key} is {value!r:.40}; expected {'text' if kind is str else 'a number'}")
