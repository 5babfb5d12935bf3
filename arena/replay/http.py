"""How the pages' servers answer: one response at a time, to this machine alone, without a word on the terminal."""

from __future__ import annotations

from contextlib import suppress
from http.server import BaseHTTPRequestHandler
from typing import Any, Final

from arena.trial.json_numbers import json_text

HERE: Final = "127.0.0.1"
"""The only address that is listened on."""


class Answer(BaseHTTPRequestHandler):
    """One request."""

    def send(self, status: int, kind: str, text: str) -> None:
        """The whole response; a browser that has gone to another page meanwhile does not matter."""
        body = text.encode()
        with suppress(ConnectionError):
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(body)

    def send_page(self, text: str) -> None:
        """A page."""
        self.send(200, "text/html; charset=utf-8", text)

    def send_json(self, value: Any) -> None:
        """A value."""
        self.send(200, "application/json", json_text(value))

    def send_words(self, status: int, words: str) -> None:
        """Why it is not what was asked for."""
        self.send(status, "text/plain", words)

    def log_message(self, form: str, *arguments: object) -> None:
        """Quiet."""
