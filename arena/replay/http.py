"""HTTP request handler of the page servers: replies to this machine only, without messages on the terminal."""

from __future__ import annotations

from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from typing import Any, Final

from arena.trial.strict_json import json_text
from emu.host.local_server import is_own_client

LOOPBACK: Final = "127.0.0.1"
"""The only address on which the servers listen."""


class PageServer(ThreadingHTTPServer):
    """HTTP server on the loopback address for clients of this user."""

    daemon_threads = True

    def verify_request(self, request: Any, client_address: object) -> bool:
        """Whether to answer a connection; others are closed."""
        return is_own_client(request)


class RequestHandler(BaseHTTPRequestHandler):
    """Base class of the handlers of HTTP requests."""

    def has_own_host(self) -> bool:
        """Whether the request names this server's own address as its host.

        Otherwise send an error: a web page may have bound its own host name to the loopback address."""
        assert isinstance(self.server, HTTPServer)
        port = self.server.server_port
        if self.headers.get("Host") in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
            return True
        self.send_error_text(403, f"the page works at its own address only: http://{LOOPBACK}:{port}/")
        return False

    def send(self, status: int, kind: str, text: str) -> None:
        """Send a response of media type `kind`; ignore that the browser has closed the connection."""
        body = text.encode()
        with suppress(ConnectionError):
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(body)

    def send_page(self, text: str) -> None:
        """Send an HTML page."""
        self.send(200, "text/html; charset=utf-8", text)

    def send_json(self, value: Any) -> None:
        """Send a value as JSON."""
        self.send(200, "application/json", json_text(value))

    def send_error_text(self, status: int, text: str) -> None:
        """Send an error status with its reason as plain text."""
        self.send(status, "text/plain", text)

    def log_message(self, form: str, *arguments: object) -> None:
        """Suppress the log line that the base class writes for each request."""
