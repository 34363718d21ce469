"""`baker view OUT`: a local web page that shows a bake."""

from __future__ import annotations

import inspect
import sys
import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.cli.session import Session


def command() -> Any:
    """Return the subcommand."""
    out = Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a bake.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("out", keyword, annotation=out),
        flag(
            "port",
            int,
            typer.Option("--port", metavar="N", min=0, max=65535, help="Port on 127.0.0.1; 0: a free one."),
            0,
        ),
        flag(
            "browser",
            bool,
            typer.Option("--browser/--no-browser", help="Open the page (never with --json)."),
            True,
        ),
        flag(
            "three",
            Path | None,
            typer.Option("--three", metavar="PATH", help="Your own three.js: its file, or npm's folder."),
        ),
        # Nothing here traces rays; taken so that scripts can pass the same flags to every command.
        *setting_flags(only={"threads", "seed"}),
        *common_flags(),
    ]
    return build("view", COMMANDS["view"], work, flags)


def work(
    *,
    ctx: typer.Context,
    out: Path,
    port: int,
    browser: bool,
    three: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Serve the page until Ctrl-C, which is how one ends it and no failure."""
    from baker.cli.config import resolve

    resolve(given(settings), None)
    from baker.io.bake.read_bake import read_bake
    from baker.viewer import find_three, make_server

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    script = find_three(three)
    bake = read_bake(out)
    server = make_server(bake, script, port=port)
    if as_json:
        session.write_json({"url": server.url, "port": server.server_port, "out": str(out)})
        session.out.flush()
    text = session.text_stream(as_json=as_json)
    if not quiet:
        for warning in bake.warnings:
            text.write(f"warning: {warning.message}\n")
        text.write(f"{server.url} shows {out}; Ctrl-C ends it\n")
        text.flush()
    if browser and not as_json and sys.stderr.isatty():
        # In a thread: a browser that is a terminal program would hold the server up.
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        if not quiet:
            text.write("ended\n")
    finally:
        server.server_close()
