"""The viewer's server refuses ambiguous HTTP requests, and does not answer requests after them."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest

from baker.viewer.server import ViewServer
from baker.viewer.strict_http import fault_of_request

GOOD = b"GET / HTTP/1.1\r\nHost: %s\r\n"
NEXT = b"GET /secret HTTP/1.1\r\nHost: %s\r\n\r\n"
REFUSED = {
    "two hosts": GOOD + b"Host: evil\r\n\r\n",
    "two equal hosts": GOOD + b"Host: %s\r\n\r\n",
    "hosts that differ in case": GOOD + b"hOST: evil\r\n\r\n",
    "no host": b"GET / HTTP/1.1\r\n\r\n",
    "space before the colon": b"GET / HTTP/1.1\r\nHost : %s\r\n\r\n",
    "folded host": b"GET / HTTP/1.1\r\nHost:\r\n %s\r\n\r\n",
    "folded line": GOOD + b"X: a\r\n Host: evil\r\n\r\n",
    "bare carriage return": GOOD + b"X: a\rHost: evil\r\n\r\n",
    "bare line feed": b"GET / HTTP/1.1\nHost: %s\n\n",
    "zero byte": GOOD + b"X: a\x00b\r\n\r\n",
    "line without colon": GOOD + b"X\r\n\r\n",
    "empty name": GOOD + b": x\r\n\r\n",
    "two lengths": GOOD + b"Content-Length: 0\r\nContent-Length: 50\r\n\r\n",
    "length and encoding": GOOD + b"Content-Length: 0\r\nTransfer-Encoding: chunked\r\n\r\n",
    "encoding": GOOD + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "body": GOOD + b"Content-Length: 57\r\n\r\n",
    "signed length": GOOD + b"Content-Length: +0\r\n\r\n",
    "absolute form of another host": b"GET http://evil/ HTTP/1.1\r\nHost: %s\r\n\r\n",
    "absolute form with user": b"GET http://%s@evil/ HTTP/1.1\r\nHost: %s\r\n\r\n",
    "another host in the path": b"GET //evil/ HTTP/1.1\r\nHost: %s\r\n\r\n",
    "authority form": b"GET evil:80 HTTP/1.1\r\nHost: %s\r\n\r\n",
    "two spaces": b"GET  / HTTP/1.1\r\nHost: %s\r\n\r\n",
    "no version": b"GET /\r\nHost: %s\r\n\r\n",
    "tab": b"GET\t/ HTTP/1.1\r\nHost: %s\r\n\r\n",
    "non-ASCII target": b"GET /\xff HTTP/1.1\r\nHost: %s\r\n\r\n",
}


@pytest.fixture(scope="module")
def server() -> Iterator[ViewServer]:
    texts = {"/": b"page", "/secret": b"secret"}
    server = ViewServer(0, {path: ("text/plain", text.__bytes__) for path, text in texts.items()})
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def answer(server: ViewServer, request: bytes) -> bytes:
    """Return everything that the server sends for the bytes `request`, which may contain several requests."""
    host = f"127.0.0.1:{server.server_port}".encode()
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=10) as line:
        line.sendall(request.replace(b"%s", host))
        line.shutdown(socket.SHUT_WR)
        return line.makefile("rb").read()


@pytest.mark.parametrize("name", REFUSED)
def test_an_ambiguous_request_is_refused(server: ViewServer, name: str) -> None:
    found = answer(server, REFUSED[name] + NEXT)
    # An answer in HTTP/0.9 has no status line.
    assert b" 400 " in found.splitlines()[0] or b"Error code: 400" in found or name == "no version"
    assert b"page" not in found
    assert b"secret" not in found, "what follows is not read"


@pytest.mark.parametrize(
    "request_bytes",
    [
        GOOD + b"\r\n",
        GOOD + b"Content-Length: 0\r\n\r\n",
        GOOD + b"Accept: text/html,\t*/*\r\nCookie: a=\xe4\r\n\r\n",
        b"GET http://%s/ HTTP/1.1\r\nHost: %s\r\n\r\n",
        b"GET / HTTP/1.0\r\nHost: %s\r\nConnection: keep-alive\r\n\r\n",
    ],
)
def test_what_browsers_send_is_answered(server: ViewServer, request_bytes: bytes) -> None:
    found = answer(server, request_bytes + NEXT)
    assert found.startswith(b"HTTP/1.1 200 OK\r\n")
    assert b"page" in found
    assert found.endswith(b"secret")


def test_another_host_is_still_forbidden(server: ViewServer) -> None:
    assert answer(server, b"GET / HTTP/1.1\r\nHost: evil\r\n\r\n").startswith(b"HTTP/1.1 403 ")


def test_reasons_are_short() -> None:
    line = b"GET / HTTP/1.1\r\n"
    assert fault_of_request(line, [b"Host: a\r\n", b"Host: b\r\n"], {"a"}) == "not exactly one Host header"
    assert fault_of_request(line, [b"Host: a\r\n"], {"a"}) is None
