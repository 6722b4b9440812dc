"""HTTP server of the live page, on this machine alone: page, stream of events, stop button."""

from __future__ import annotations

import hmac
import html
import json
import os
import secrets
import socketserver
import threading
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from time import monotonic
from typing import Any

from fmus.kit import UserError
from orchestration.rig.watch.feed import Feed

LOOPBACK = "127.0.0.1"
_PAGES = 16  # that may be open at a time
_PULSE = 0.25  # s: a page hears from us at least that often, and so notices when it does not
_PATIENCE = 5.0  # s that a browser may take to send its request, or to take what it is sent
_LARGEST = 4096  # bytes of a request beside its head; they are read and ignored
_TYPES = {"page.css": "text/css", "page.js": "text/javascript", "chart.js": "text/javascript"}
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
Stop = Callable[[], dict[str, Any]]


class PageServer(ThreadingHTTPServer):
    """Server of the live page, listening as soon as it is made.

    Parameters
    ----------
    port : int
        On the loopback address; 0 takes a free one.
    name : str
        Of the rig's server, for the page.
    feed : Feed
    stop : callable
        Stops the rig and returns its status; raises UserError if it does not answer.

    Raises
    ------
    UserError
        If the port is taken.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = os.name != "nt"  # where it would let two programs have one port

    def __init__(self, port: int, name: str, feed: Feed, stop: Stop):
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise UserError(
                f"cannot listen at {LOOPBACK}:{port}: {error.strerror}; --port chooses another one"
            ) from error
        self.name = name
        self.feed = feed
        self.stop = stop
        self.port = int(self.server_address[1])
        self.hosts = {f"{LOOPBACK}:{self.port}", f"localhost:{self.port}"}
        self.token = secrets.token_urlsafe(32)
        self.instance = secrets.token_hex(8)
        self.pages = threading.BoundedSemaphore(_PAGES)

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self.port}/"

    def server_bind(self) -> None:
        """Bind the port, without the look-up of this machine's name of the standard library."""
        socketserver.TCPServer.server_bind(self)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors: a browser that goes away in the middle of an answer is no fault."""


class _Handler(BaseHTTPRequestHandler):
    """Handler of one connection of a browser."""

    server: PageServer
    timeout = _PATIENCE

    def do_GET(self) -> None:
        if not self._is_ours():
            return
        path = self.path.partition("?")[0]
        if path == "/":
            self._send(HTTPStatus.OK, "text/html", self._page())
        elif path == "/stream":
            self._stream()
        elif path.removeprefix("/") in _TYPES:
            name = path.removeprefix("/")
            self._send(HTTPStatus.OK, _TYPES[name], _file(name))
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is no such page")

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        with suppress(ValueError):
            self.rfile.read(min(max(int(self.headers.get("Content-Length", 0)), 0), _LARGEST))
        token = self.headers.get("X-Rig-Token", "")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", "not from this page")
        elif self.path != "/stop":
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is nothing to command but stop")
        else:
            self._stop()

    def _page(self) -> str:
        page = _file("page.html")
        for name in ("token", "instance", "name"):
            page = page.replace(f"{{{name}}}", html.escape(getattr(self.server, name)))
        return page

    def _is_ours(self) -> bool:
        """Refuse a request by another name, as a foreign site's name may lead to this machine."""
        origin = self.headers.get("Origin")
        if self.headers.get("Host") in self.server.hosts and (
            origin is None or origin.removeprefix("http://") in self.server.hosts
        ):
            return True
        self._send(HTTPStatus.FORBIDDEN, "text/plain", "only from this machine, by its own name")
        return False

    def _stop(self) -> None:
        try:
            status = self.server.stop()
        except UserError as error:
            self.server.feed.event("stop", f"stop pressed, not confirmed: {error}")
            self._send_json(HTTPStatus.GATEWAY_TIMEOUT, {"confirmed": False, "error": str(error)})
            return
        self.server.feed.status(status)
        self.server.feed.event("stop", "stop pressed, confirmed by the rig's server")
        self._send_json(HTTPStatus.OK, {"confirmed": True, "state": status["state"]})

    def _stream(self) -> None:
        if not self.server.pages.acquire(blocking=False):
            self._send(HTTPStatus.SERVICE_UNAVAILABLE, "text/plain", "too many pages are open")
            return
        try:
            self._head(HTTPStatus.OK, "text/event-stream")
            self.wfile.write(b"retry: 500\n\n")
            serial, items = self.server.feed.everything()
            self._push(items, first=True)
            while True:
                serial, items = self.server.feed.since(serial, _PULSE)
                self._push(items)
        except OSError:
            return  # the page was closed, or takes nothing any more
        finally:
            self.server.pages.release()

    def _push(self, items: list[dict[str, Any]], first: bool = False) -> None:
        about = {"now": monotonic(), "first": first, "instance": self.server.instance}
        message = json.dumps({**about, "items": items}, allow_nan=False)
        self.wfile.write(f"data: {message}\n\n".encode())

    def _send_json(self, status: HTTPStatus, data: dict[str, Any]) -> None:
        self._send(status, "application/json", json.dumps(data))

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        content = text.encode()
        with suppress(OSError):
            self._head(status, kind, len(content))
            self.wfile.write(content)

    def _head(self, status: HTTPStatus, kind: str, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        if length is not None:
            self.send_header("Content-Length", str(length))
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing, for the terminal is the user's."""


def _file(name: str) -> str:
    return (files("orchestration.rig.watch") / "page" / name).read_text(encoding="utf-8")
