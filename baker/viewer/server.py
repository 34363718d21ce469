"""Serves the viewer page and the files of a bake to a browser on this machine.

A request is answered only if its path is in a table that is filled before the first request, so no other file
can be read.
Requests whose Host header names another machine are refused, so that a foreign site cannot read the bake
through a host name that resolves to 127.0.0.1 (DNS rebinding).
"""

from __future__ import annotations

import contextlib
import errno
import json
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError
from baker.io.bake.output_folder import own_files
from baker.io.bake.read_bake import StoredBake
from baker.viewer.page_data import page_numbers
from baker.viewer.scene_data import scene_data
from baker.viewer.script import ThreeScript
from baker.viewer.strict_http import fault_of_request

HOST = "127.0.0.1"
STATIC = Path(__file__).resolve().parent / "static"
_MIME = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".glb": "model/gltf-binary",
}
_BYTES = "application/octet-stream"
# Content-Security-Policy: forbid scripts, styles and requests from other origins.
_POLICY = "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'"

# Response to a request: media type, and a function that returns the bytes.
Answer = tuple[str, Callable[[], bytes]]


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
        """Ignore errors, which arise when the browser closes a connection."""


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
    ResourceError
        If the port is in use or not permitted.
    """
    answers = _answers(bake, three)
    try:
        return ViewServer(port, answers)
    except OSError as error:
        if error.errno not in (errno.EADDRINUSE, errno.EACCES):
            raise
        message = f"port {port} is taken or not ours to use; name another with `port`, or leave it out"
        raise ResourceError(message) from None


def _answers(bake: StoredBake, three: ThreeScript) -> dict[str, Answer]:
    data = scene_data(bake)
    header = {**data.header, "three": {"file": f"three/{three.path.name}", "module": three.module}}
    text = json.dumps(header, allow_nan=False).encode()
    answers: dict[str, Answer] = {
        "/": _file(STATIC / "index.html"),
        "/scene.json": (_MIME[".json"], lambda: text),
        "/geometry": (_BYTES, lambda: data.geometry),
    }
    for path in STATIC.iterdir():
        answers[f"/static/{path.name}"] = _file(path)
    for name, path in three.files.items():
        answers[f"/three/{name}"] = _file(path)
    for number, image in enumerate(data.images):
        answers[f"/image/{number}"] = (_BYTES, partial(_bytes, image))
    for page in range(bake.atlas.n_pages):
        answers[f"/status/{page}"] = (_BYTES, partial(_bytes, bake.status[page]))
        for name, value in bake.maps.items():
            if page < len(value):
                answers[f"/page/{name}/{page}"] = (_BYTES, partial(_page_bytes, value[page]))
    folder = bake.folder.resolve()
    for name in own_files(folder) or ():
        # Leave out files outside the folder, which a manifest may name through links.
        path = (folder / name).resolve()
        if path.is_relative_to(folder) and path.is_file():
            answers[f"/out/{name}"] = _file(path)
    return answers


def _bytes(array: NDArray[Any]) -> bytes:
    return np.ascontiguousarray(array).tobytes()


def _page_bytes(page: NDArray[np.float32]) -> bytes:
    return page_numbers(page).tobytes()


def _file(path: Path) -> Answer:
    return _MIME.get(path.suffix.lower(), _BYTES), path.read_bytes


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
