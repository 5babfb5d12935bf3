"""`arena studio SCENE`: a page in the browser in which a trial runs, stands, goes back, and is taken in hand.

The server listens on this machine alone. Every request must bring the token of the page's address and come from the
page itself: other pages in the same browser, and names that lead here, are refused.
"""

from __future__ import annotations

import argparse
import hmac
import json
import math
import secrets
import webbrowser
from contextlib import suppress
from http.server import ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from arena.commands.arguments import port
from arena.commands.run import add_plan, planned
from arena.replay.http import HERE, Answer
from arena.replay.page import page
from arena.scene.loader import FCY
from arena.studio.process import Call, Studio
from arena.studio.session import RefusedError

EXAMPLE: Final = "example: arena studio clustering --controller A --seed 3"
LIMIT: Final = 1 << 16
"""Bytes of a request's body."""
HEADER: Final = "X-Studio-Token"
DEEDS: Final[dict[str, dict[str, type]]] = {
    "go": {"pace": float}, "stand": {}, "step": {"quanta": int}, "back": {"tick": int},
    "move": {"kind": str, "number": int, "x": float, "y": float}, "tell": {"robot": int, "text": str},
    "stop_at": {"robot": int, "place": str}, "debug": {"robot": int},
}  # fmt: skip
"""What can be asked for, methods of `InHand`, and the parameters it takes."""


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(
        description="run one trial in a page of the browser: pause, step, go back, move things, look into a robot",
        epilog=EXAMPLE,
    )
    add_plan(made)
    made.add_argument("--port", type=port, default=8766, metavar="P", help="default 8766, 0 = any")
    made.add_argument("--open", action="store_true", help="open the page in the browser")
    return made


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C. Raises SceneError, LoadError, ValueError, OSError."""
    plan = planned(options, 1)
    studio = Studio(plan, plan.seed)
    try:
        with server(studio, options.port) as serving:
            print(f"{serving.address} (Ctrl-C ends)", flush=True)
            if options.open:
                webbrowser.open(serving.address)
            with suppress(KeyboardInterrupt):
                serving.serve_forever()
    finally:
        studio.close()
    return 0


class Serving(ThreadingHTTPServer):
    """The server of one studio."""

    daemon_threads = True

    def __init__(self, studio: Studio, port: int) -> None:
        self.studio: Final = studio
        self.token: Final = secrets.token_urlsafe(16)
        super().__init__((HERE, port), _Answer)
        self.hosts: Final = (f"{HERE}:{self.server_port}", f"localhost:{self.server_port}")
        self.address: Final = f"http://{self.hosts[0]}/?token={self.token}"


def server(studio: Studio, port: int) -> Serving:
    """A server for this machine alone."""
    return Serving(studio, port)


class _Answer(Answer):
    server: Serving

    def do_GET(self) -> None:
        """The page, samples, and what is inside a robot."""
        place = urlsplit(self.path)
        query = {name: values[0] for name, values in parse_qs(place.query).items()}
        if not self._may_ask(query.get("token", "") if place.path == "/" else self.headers.get(HEADER, "")):
            return
        studio = self.server.studio
        try:
            if place.path == "/":
                trial, now = studio.ask_all(Call("trial"), Call("now"))
                quantum = trial.scene.clock.quantum_tcy / FCY
                control = {"token": self.server.token, "header": HEADER, "now": now, "quantum": quantum}
                self.send_page(page(trial, studio=control))
            elif place.path == "/more":
                first, epoch = _whole(query.get("from")), _whole(query.get("epoch"))
                self.send_json(studio.ask("more", first=first, epoch=epoch))
            elif place.path == "/inside":
                robot = _whole(query.get("robot"))
                self.send_json(studio.ask("inside", robot=robot))
            elif place.path == "/digest":
                state, now = studio.ask_all(Call("digest"), Call("now"))
                self.send_json({"digest": state, "tick": now["tick"]})
            else:
                self.send_words(404, "there are /, /more?from=N&epoch=E, /inside?robot=N, /digest and /do")
        except RefusedError as error:
            self.send_words(409, str(error))

    def do_POST(self) -> None:
        """Something is to be done."""
        if not self._may_ask(self.headers.get(HEADER, "")):
            return
        studio = self.server.studio
        try:
            if urlsplit(self.path).path != "/do":
                raise RefusedError("what is to be done goes to /do")
            name, arguments = _deed(self._body())
            self.send_json(studio.ask_all(Call(name, (), arguments), Call("now"))[1])
        except RefusedError as error:
            self.send_words(409, str(error))

    def _may_ask(self, token: str) -> bool:
        """Whether the request is the page's own; if not it has been answered."""
        origin = self.headers.get("Origin")
        strange = self.headers.get("Host") not in self.server.hosts or (
            origin is not None and origin.removeprefix("http://") not in self.server.hosts
        )
        if strange or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            why = "this page is for its own address only" if strange else "the address lacks its token"
            self.send_words(403, f"{why}; use the one that `arena studio` printed")
            return False
        return True

    def _body(self) -> Any:
        length = _whole(self.headers.get("Content-Length"))
        if length > LIMIT:
            raise RefusedError(f"a request of {length} bytes; expected {LIMIT} at most")
        try:
            return json.loads(self.rfile.read(length))
        except (ValueError, RecursionError):
            raise RefusedError("the request is no JSON") from None


def _whole(text: str | None) -> int:
    if text is None or not text.isascii() or not text.isdecimal() or len(text) > 15:
        raise RefusedError(f"{text!r}: expected a whole number")
    return int(text)


def _deed(request: Any) -> tuple[str, dict[str, Any]]:
    """Name and arguments, of the types that are wanted. Raises RefusedError."""
    name = request.get("do") if isinstance(request, dict) else None
    if not isinstance(name, str) or name not in DEEDS:
        raise RefusedError(f'expected an object with "do", one of {", ".join(DEEDS)}')
    wanted = DEEDS[name]
    given = {key: value for key, value in request.items() if key != "do"}
    if set(given) != set(wanted):
        raise RefusedError(f"{name}: expected {', '.join(wanted) or 'nothing more'}")
    return name, {key: _typed(name, key, given[key], kind) for key, kind in wanted.items()}


def _typed(name: str, key: str, value: Any, kind: type) -> Any:
    """`value` as a `kind`; whole numbers are numbers, and no number is beyond all bounds."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e15
    if kind is float and is_number and math.isfinite(value):
        return float(value)
    if (kind is int and is_number and isinstance(value, int)) or (kind is str and isinstance(value, str)):
        return value
    raise RefusedError(f"{name}: {key} is {value!r:.40}; expected {'text' if kind is str else 'a number'}")
