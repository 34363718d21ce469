"""Starts headless Chromium with a software renderer, and serves static files on the loopback address.

Tests read back the pixels that the browser draws. If a program or library is missing, a test is not skipped:
it fails with a sentence that says what to install.
"""

from __future__ import annotations

import http.server
import mimetypes
import shutil
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

NODE_MODULES = Path(__file__).parent / "node_modules"

FLAGS = [
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]  # fmt: skip

# {suffix: MIME type}. A browser runs a module only if it has the correct type.
_TYPES = {
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".html": "text/html",
    ".json": "application/json",
}


def need_program(name: str, package: str) -> str:
    """Return the path of a program; if it is missing, fail the test and name the package to install."""
    found = shutil.which(name)
    if found is None:
        pytest.fail(f"'{name}' is not installed: apt-get install {package}")
    return found


def need_modules(name: str = "three") -> Path:
    """Return the `node_modules` folder of the browser libraries; if it lacks `name`, fail with advice."""
    if not (NODE_MODULES / name / "package.json").is_file():
        pytest.fail("the browser libraries are not installed: run 'npm install' in tests/engines")
    return NODE_MODULES


@contextmanager
def serve(folders: Mapping[str, Path]) -> Iterator[str]:
    """Serve folders on 127.0.0.1 and yield the address, like http://127.0.0.1:40123.

    Parameters
    ----------
    folders : mapping of the first part of a path to a folder
        {"out": tmp_path} serves tmp_path/a.exr as /out/a.exr.
    """

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            parts = PurePosixPath(unquote(urlsplit(self.path).path)).parts[1:]
            path = folders[parts[0]].joinpath(*parts[1:]) if parts and parts[0] in folders else None
            if parts == ("favicon.ico",):
                # Every browser requests the icon, and a 404 would count as an error of the page.
                self.send_response(204)
                self.end_headers()
                return
            if path is None or ".." in parts or not path.is_file():
                self.send_error(404)
                return
            data = path.read_bytes()
            kind = _TYPES.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: Any) -> None:
            """Do not print a log of requests."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def chromium(width: int = 640, height: int = 480) -> Iterator[Any]:
    """Start Chromium and yield a Playwright browser context, whose pages are closed at the end."""
    program = need_program("chromium", "chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        pytest.fail("Playwright is not installed: pip install '.[engines]'")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        try:
            yield browser.new_context(viewport={"width": width, "height": height})
        finally:
            browser.close()


# Messages that are ignored. The first warns that reading pixels back is slow. The second reports a fetch
# whose stream was closed early, after all bytes had arrived.
_HARMLESS = ("GPU stall due to ReadPixels", "net::ERR_ABORTED")


def _note(troubles: list[str], kind: str, text: str) -> None:
    if kind in ("error", "warning") and not any(part in text for part in _HARMLESS):
        troubles.append(f"{kind}: {text}")


@contextmanager
def page_at(context: Any, url: str) -> Iterator[tuple[Any, list[str]]]:
    """Open a page and yield it with a list to which its errors and warnings are appended."""
    page = context.new_page()
    troubles: list[str] = []
    page.on("pageerror", lambda error: troubles.append(f"error: {error}"))
    page.on("console", lambda message: _note(troubles, message.type, message.text))
    page.on("requestfailed", lambda request: _note(troubles, "error", f"{request.url}: {request.failure}"))
    try:
        page.goto(url)
        yield page, troubles
    finally:
        page.close()


def run(context: Any, url: str, timeout: float = 60.0) -> tuple[Any, list[str]]:
    """Open a page, wait until it sets `window.result` or `window.failure`, and return result and messages."""
    with page_at(context, url) as (page, troubles):
        page.wait_for_function(
            "window.result !== undefined || window.failure !== undefined", timeout=1000 * timeout
        )
        failure = page.evaluate("window.failure")
        assert failure is None, f"{failure}\n" + "\n".join(troubles)
        return page.evaluate("window.result"), troubles
