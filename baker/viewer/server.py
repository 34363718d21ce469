"""Serves the viewer page and the files of a bake to a browser on this machine.

A request is answered only if its path is in a table that is complete before the first request, so no other
file can be read. Requests whose Host header names another machine are refused, so that a foreign site cannot
read the bake through a host name that resolves to 127.0.0.1 (DNS rebinding).
"""

from __future__ import annotations

import contextlib
import errno
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote, urlsplit

from baker.core.errors import ResourceError
from baker.io.bake.read_bake import StoredBake
from baker.viewer.answers import POLICY, Answer, page_answers
from baker.viewer.script import ThreeScript
from baker.viewer.strict_http import fault_of_request

HOST = "127.0.0.1"
# Policy of the server. Exported pages lack `frame-ancestors`, because browsers ignore it in a meta tag.
_POLICY = f"{POLICY}; frame-ancestors 'none'"


class ViewServer(ThreadingHTTPServer):
    """An HTTP server with a table of URL paths and responses."""

    daemon_threads = True

    def __init__(self, port: int, answers: dict[str, Answer]) -> None:
        super().__init__((HOST, port), _Handler)
        self.answers = answers

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.url}>"

    @property
    def url(self) -> str:
        """Return the URL of the page."""
        return f"http://{HOST}:{self.server_port}/"

    @property
    def names(self) -> set[str]:
        """Return the values of the Host header that are accepted."""
        return {f"{HOST}:{self.server_port}", f"localhost:{self.server_port}"}

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore errors of a connection, which arise if the browser closes it."""


def make_server(bake: StoredBake, three: ThreeScript, *, port: int = 0) -> ViewServer:
    """Return a server for a bake, bound to its port.

    Parameters
    ----------
    bake : StoredBake
        The bake that the page shows.
    three : ThreeScript
        The files of three.js that the page loads.
    port : int
        TCP port; 0 uses any free port.

    Returns
    -------
    ViewServer
        The server; call `serve_forever` to start it.

    Raises
    ------
    InputError
        If the manifest names an unknown channel.
    ResourceError
        If the port is in use, or this user may not use it.
    """
    answers = {f"/{address}": answer for address, answer in page_answers(bake, three).items()}
    try:
        return ViewServer(port, answers)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        message = f"port {port} is taken or not ours to use; name another with `port`, or leave it out"
        raise ResourceError(message) from None


class _Recorder:
    """A wrapper of a stream that stores the lines read from it."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.lines: list[bytes] = []

    def readline(self, limit: int = -1) -> bytes:
        """Read a line."""
        line: bytes = self.stream.readline(limit)
        self.lines.append(line)
        return line


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: ViewServer
    # The first line of the request. The base class sets this attribute, but its type stubs lack it.
    raw_requestline: bytes

    def parse_request(self) -> bool:
        """Parse the request. If it is ambiguous, refuse it and end the connection, see `strict_http`."""
        stream = self.rfile
        recorder = _Recorder(stream)
        self.rfile = recorder  # type: ignore[assignment]
        try:
            parsed = super().parse_request()
        finally:
            self.rfile = stream
        if not parsed:
            return False
        why = fault_of_request(self.raw_requestline, recorder.lines[:-1], self.server.names)
        if why is not None:
            self.close_connection = True
            self._send(HTTPStatus.BAD_REQUEST, "text/plain", f"{why}\n".encode(), body=self.command != "HEAD")
        return why is None

    def do_GET(self) -> None:
        self._answer(body=True)

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def _answer(self, *, body: bool) -> None:
        if self.headers.get("Host", "") not in self.server.names:
            self._send(HTTPStatus.FORBIDDEN, "text/plain", b"127.0.0.1 only\n", body=body)
            return
        found = self.server.answers.get(unquote(urlsplit(self.path).path))
        if found is None:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", b"there is nothing here\n", body=body)
            return
        kind, make = found
        try:
            content = make()
        except OSError:
            self._send(HTTPStatus.GONE, "text/plain", b"the file is not there any more\n", body=body)
            return
        self._send(HTTPStatus.OK, kind, content, body=body)

    def _send(self, status: HTTPStatus, kind: str, content: bytes, *, body: bool) -> None:
        with contextlib.suppress(ConnectionError):
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("Content-Security-Policy", _POLICY)
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            if body:
                self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing."""
