"""HTTP server of the live page, on this machine alone: page, stream of items, stop and tuning."""

from __future__ import annotations

import hmac
import json
import os
import re
import secrets
import socket
import socketserver
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.kit import UserError, quoting
from orchestration.rig.watch.feed import Feed

LOOPBACK = "127.0.0.1"
_PATIENCE = 5.0  # s that a browser may take to send its request, or to receive the answer
_LARGEST = 4096  # bytes of the body of a request
_MOST = 100  # connections that are open at once, which leaves descriptors for a stop
_WAITING = 128  # connections that wait to be taken, as when many tabs are opened at once
_TYPES = {"css": "text/css", "js": "text/javascript"}
_FILES = (
    "history.js",
    "page.css",
    "page.js",
    "cards.js",
    "chart.js",
    "elements.js",
    "stream.js",
    "tuning.js",
    "worker.js",
)
# origins of a request by a browser's word: the page itself, or its user; others say nothing
_SITES = (None, "same-origin", "none")
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; "
        "connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
Stop = Callable[[], dict[str, Any]]
Tune = Callable[[str, float, float | None], Mapping[str, Any]]


class PageServer(ThreadingHTTPServer):
    """Server of the live page, listening as soon as it is made.

    Parameters
    ----------
    port : int
        Port of the loopback address; 0 takes a free one.
    name : str
        Name of the rig's server, shown by the page.
    feed : Feed
    stop : callable
        Stops the rig and returns its status; raises UserError if it does not answer.
    archive : Path, optional
        Folder of the archive of the rig's server, for its history.
    tune : callable, optional
        Moves a parameter of the run beside the rig, by name, value and slew rate, and returns all;
        raises UserError if that is refused. Only for who knows `key`: others of this machine can
        open the page, too.

    Raises
    ------
    UserError
        If the port is taken.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = _WAITING
    allow_reuse_address = os.name != "nt"  # where it would let two programs have one port

    def __init__(
        self,
        port: int,
        name: str,
        feed: Feed,
        stop: Stop,
        archive: Path | None = None,
        tune: Tune | None = None,
    ):
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise UserError(
                f"cannot listen at {LOOPBACK}:{port}: {error.strerror}; --port chooses another one"
            ) from error
        self.name = name
        self.feed = feed
        self.stop = stop
        self.archive = archive
        self.tune = tune
        self.key = secrets.token_urlsafe(32)
        self.port = int(self.server_address[1])
        self.hosts = {f"{LOOPBACK}:{self.port}", f"localhost:{self.port}"}
        self.token = secrets.token_urlsafe(32)
        self.instance = secrets.token_hex(8)
        self._connections: dict[Any, None] = {}  # the oldest first
        self._lock = threading.Lock()

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self.port}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread, in place of the oldest one if there are too many."""
        with self._lock:
            oldest = next(iter(self._connections), None)
            if len(self._connections) >= _MOST and oldest is not None:
                del self._connections[oldest]
                with suppress(OSError):
                    oldest.shutdown(socket.SHUT_RDWR)
            self._connections[request] = None
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._lock:
            self._connections.pop(request, None)
        super().shutdown_request(request)

    def server_bind(self) -> None:
        """Bind the port; the standard library would look up this machine's name first."""
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
        path, _, query = self.path.partition("?")
        name = path.removeprefix("/")
        if path == "/":
            self._send(HTTPStatus.OK, "text/html", self._page("page.html"))
        elif path == "/history" and self.server.archive is not None:
            self._send(HTTPStatus.OK, "text/html", self._page("history.html"))
        elif path == "/archive" and self.server.archive is not None:
            self._archive(self.server.archive, query)
        elif path == "/stream":
            self._stream(query)
        elif name in _FILES:
            self._send(HTTPStatus.OK, _TYPES[name.rpartition(".")[2]], _file(name))
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is no such page")

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        body = b""
        with suppress(ValueError):
            length = int(self.headers.get("Content-Length", 0))
            body = self.rfile.read(min(max(length, 0), _LARGEST))
        token = self.headers.get("X-Rig-Token", "")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", "not from this page")
        elif self.path == "/stop":
            self._stop()
        elif self.path == "/tune" and self.server.tune is not None:
            self._tune(self.server.tune, body)
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is nothing to command but stop")

    def _page(self, name: str) -> str:
        page = _file(name)
        page = page.replace("{hidden}", "hidden" if self.server.archive is None else "")
        for name in ("token", "instance", "name"):
            page = page.replace(f"{{{name}}}", quoting.html(getattr(self.server, name)))
        return page

    def _is_ours(self) -> bool:
        """Return whether a request comes from this machine and the page; refuse it otherwise.

        A foreign site could send one, or have a name of its own that leads to this machine.
        """
        origin = self.headers.get("Origin")
        if (
            self.headers.get("Host") in self.server.hosts
            and (origin is None or origin.removeprefix("http://") in self.server.hosts)
            and self.headers.get("Sec-Fetch-Site") in _SITES
        ):
            return True
        self._send(HTTPStatus.FORBIDDEN, "text/plain", "only from this machine, by its own name")
        return False

    def _stop(self) -> None:
        """Stop the rig, and send its state; add an event for all pages."""
        feed = self.server.feed
        try:
            status = self.server.stop()
        except UserError as error:
            feed.event("stop", f"stop pressed, no answer: {error}")
            self._send_json(HTTPStatus.GATEWAY_TIMEOUT, {"error": str(error)})
            return
        feed.event("stop", "stop pressed, taken by the rig's server")
        feed.take_status(status)
        serial, condition = feed.condition()
        self._send_json(HTTPStatus.OK, {**condition, "serial": serial})

    def _tune(self, tune: Tune, body: bytes) -> None:
        """Move a parameter; add an event for all pages."""
        key = self.headers.get("X-Rig-Key", "")
        if not hmac.compare_digest(key.encode(), self.server.key.encode()):
            self._send(HTTPStatus.FORBIDDEN, "text/plain", "only with the address in the terminal")
            return
        try:
            wanted = json.loads(body)
            name, value, slew = (wanted[part] for part in ("name", "value", "slew"))
            parameters = tune(name, value, slew)
        except (ValueError, LookupError, TypeError) as error:
            self._send_json(HTTPStatus.BAD_REQUEST, {"error": str(error)})
            return
        except UserError as error:
            self.server.feed.event("refused", f"refused: {error}")
            self._send_json(HTTPStatus.CONFLICT, {"error": str(error)})
            return
        self.server.feed.event("tuned", f"{name} moves to {value:g}")
        self.server.feed.take_parameters(parameters)
        self._send_json(HTTPStatus.OK, {})

    def _stream(self, query: str) -> None:
        """Send the items that a page lacks, at once, so that no connection stays open."""
        after = re.fullmatch(r"after=(-1|\d{1,15})", query)
        if after is None:
            self._send(HTTPStatus.BAD_REQUEST, "text/plain", "write /stream?after=NUMBER")
            return
        update = self.server.feed.since(int(after[1]))
        about = {"now": monotonic(), "instance": self.server.instance}
        self._send_json(HTTPStatus.OK, {**about, **update._asdict()})

    def _archive(self, folder: Path, query: str) -> None:
        """Send what was archived in a span of time, or in all."""
        from orchestration.rig.watch.history import history  # which needs an optional package

        number = r"(\d{1,11}(?:\.\d{1,6})?)"
        span = re.fullmatch(rf"(?:from={number}&to={number})?", query)
        if span is None:
            self._send(
                HTTPStatus.BAD_REQUEST, "text/plain", "write /archive?from=SECONDS&to=SECONDS"
            )
            return
        begin, end = (None if text is None else float(text) for text in span.groups())
        try:
            self._send_json(HTTPStatus.OK, history(folder, begin, end))
        except (UserError, OSError) as error:  # the server may have removed a file meanwhile
            self._send_json(HTTPStatus.NOT_FOUND, {"error": str(error)})

    def _send_json(self, status: HTTPStatus, data: dict[str, Any]) -> None:
        self._send(status, "application/json", json.dumps(data, allow_nan=False))

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        content = text.encode()
        with suppress(OSError):
            self.send_response(status)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            for name, value in _HEADERS.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing, for the terminal is the user's."""


def _file(name: str) -> str:
    return (files("orchestration.rig.watch") / "page" / name).read_text(encoding="utf-8")
