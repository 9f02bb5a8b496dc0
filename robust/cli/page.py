"""A page for people beside a run: served by a few threads, which the run never waits for.

Whoever looks is sent the newest state, ten times a second at most; what was not sent by then is never sent. A client
that does not read is dropped. By default nobody but this machine can connect.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, Location
from robust.numbers import shorten

if TYPE_CHECKING:
    from robust.cli.guard import Run

CLIENTS = 32
"""Who may look at the same time."""
_PAUSE = 0.1
"""Seconds between two states."""
_PATIENCE = 10.0
"""Seconds for a client to read, and between signs of life."""
_HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
}
LOCAL = ("127.0.0.1", "::1", "localhost")


class PageServer:
    """Serves one page, and the states that it shows, until it is closed.

    Args:
        page: HTML.
        host: the address; only local ones keep others out.
        port: 0 is any that is free.

    Raises:
        InputError: if the port is not to be had.
    """

    def __init__(self, page: str, host: str, port: int) -> None:
        self._page = page.encode()
        self._changed = threading.Condition()
        self._make: Callable[[], Mapping[str, Any]] | None = None
        self._number = 0
        self._text: tuple[int, bytes] = (0, b"")
        self._looking = 0
        self._closed = False
        _Listener.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._server = _Listener((host, port), _PageHandler)
        except (OSError, OverflowError) as error:
            reason = (getattr(error, "strerror", None) or str(error)).lower()
            raise InputError(f"cannot serve at {shorten(host)}, port {port}: {reason}", Location("--page")) from None
        self._server.page = self
        self.host, self.port = host, self._server.server_address[1]
        self._serving = threading.Thread(target=self._server.serve_forever, args=(_PAUSE,), daemon=True)
        self._serving.start()

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{f'[{self.host}]' if ':' in self.host else self.host}:{self.port}/"

    @property
    def is_watched(self) -> bool:
        """Whether somebody is looking."""
        return self._looking > 0

    def show(self, make: Callable[[], Mapping[str, Any]]) -> None:
        """From now on this state is shown; it is made if and when somebody is sent it, in another thread."""
        with self._changed:
            self._make = make
            self._number += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Send the last state to those who read at once, and end."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._looking, 2 * _PAUSE + 0.3)
        self._server.shutdown()  # else its thread goes on, with a descriptor that is another file's by then
        self._serving.join()
        self._server.server_close()

    def next_state(self, seen: int) -> tuple[int, bytes]:
        """The newest state, once there is one after the one with this number; nothing new after a while."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > seen or self._closed, _PATIENCE)
            number, make, known = self._number, self._make, self._text
        if number <= seen or make is None:
            return seen, b""
        if known[0] != number:  # the run can go on meanwhile
            known = self._text = number, json.dumps(make()).encode()
        return known

    @contextmanager
    def looking(self) -> Iterator[bool]:
        """While somebody looks; whether there is room for them."""
        with self._changed:
            self._looking += 1
            has_room = self._looking <= CLIENTS
        try:
            yield has_room
        finally:
            with self._changed:
                self._looking -= 1
                self._changed.notify_all()

    @property
    def html(self) -> bytes:
        """The page."""
        return self._page

    @property
    def is_closed(self) -> bool:
        """Whether no state comes any more."""
        return self._closed

    def allows(self, host: str) -> bool:
        """Whether a request for a host is for us: pages of others cannot ask for it by a name of their own."""
        name = host.rsplit(":", 1)[0].strip("[]") if not host.endswith("]") else host.strip("[]")
        return self.host not in LOCAL or name in LOCAL


class _Listener(ThreadingHTTPServer):
    daemon_threads = True
    page: PageServer

    def handle_error(self, request: object, client_address: object) -> None:
        """A client that is gone, or sends nonsense, is no concern of the run."""


class _PageHandler(BaseHTTPRequestHandler):
    timeout = _PATIENCE
    server: _Listener

    def do_GET(self) -> None:
        page = self.server.page
        if not page.allows(self.headers.get("Host", "")):
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"this page is served to this machine only\n")
        elif self.path == "/":
            self._answer(HTTPStatus.OK, "text/html; charset=utf-8", page.html)
        elif self.path == "/events":
            with page.looking() as has_room:
                if has_room:
                    self._stream(page)
                else:
                    self._answer(HTTPStatus.SERVICE_UNAVAILABLE, "text/plain", b"too many are looking\n")
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"there is only one page\n")

    do_HEAD = do_GET  # noqa: N815 - its name there

    def _answer(self, status: HTTPStatus, kind: str, content: bytes) -> None:
        self._begin(status, kind, {"Content-Length": str(len(content))})
        if self.command != "HEAD":
            self.wfile.write(content)

    def _begin(self, status: HTTPStatus, kind: str, more: Mapping[str, str]) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": kind, **_HEADERS, **more}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self, page: PageServer) -> None:
        """States until the run or the client ends; a write that waits too long ends it as well."""
        self._begin(HTTPStatus.OK, "text/event-stream", {})
        seen = 0
        while self.command != "HEAD":
            before, (seen, text) = seen, page.next_state(seen)
            self.wfile.write(b"data: " + text + b"\n\n" if seen > before else b":\n\n")
            if page.is_closed and page.next_state(seen)[0] == seen:
                return
            time.sleep(_PAUSE)

    def log_message(self, format: str, *arguments: object) -> None:
        """Standard error is for the run."""


def page_for(run: Run, port: int, host: str, title: str) -> PageServer:
    """The page of a run, whose address is noted.

    Raises:
        InputError: if it cannot be served.
    """
    from robust.draw.live import live_page

    server = PageServer(live_page(title), host, port)
    public = "" if host in LOCAL else ", for all who can reach this machine"
    run.note(f"page: {server.address}{public}")
    return server
