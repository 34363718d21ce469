"""`baker view OUT`: shows a bake in a local web page, or writes the page as static files."""

from __future__ import annotations

import sys
import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from baker.cli.command import Run, command
from baker.core.settings_model import RunSettings

if TYPE_CHECKING:
    from baker.viewer.script import ThreeScript


# No ray is traced here, but the flags of ray tracing are accepted, so that scripts can pass them to every
# command.
@command("view", RunSettings)
def view(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a bake.")],
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Port on 127.0.0.1; 0: a free one.")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page (never with --json).")
    ] = True,
    three: Annotated[
        Path | None,
        typer.Option("--three", metavar="PATH", help="Copy of three.js to use: its file, or its npm folder."),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option("--export", metavar="DIR", help="Write the page as static files and end."),
    ] = None,
) -> None:
    """Serve the web page until Ctrl-C, which ends the command with exit code 0.

    With --export, write the page and its data into a folder that any web server can serve, and end.
    """
    from baker.io.bake.read_bake import read_bake
    from baker.viewer.script import find_three
    from baker.viewer.server import make_server

    run: Run = ctx.obj
    script = find_three(three)
    if export is not None:
        _export(run, out, script, export)
        return
    bake = read_bake(out)
    server = make_server(bake, script, port=port)
    if run.as_json:
        run.session.write_json({"url": server.url, "port": server.server_port, "out": str(out)})
        run.session.out.flush()
    text = run.text
    if not run.quiet:
        for warning in bake.warnings:
            text.write(f"warning: {warning.message}\n")
        text.write(f"{server.url} shows {out}; Ctrl-C ends it\n")
        text.flush()
    if browser and not run.as_json and sys.stderr.isatty():
        # Open the browser in a thread, because a browser that runs in the terminal would block the server.
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    try:
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        if not run.quiet:
            text.write("ended\n")
    finally:
        server.server_close()


def _export(run: Run, out: Path, script: ThreeScript, folder: Path) -> None:
    """Write the page into `folder` instead of serving it."""
    from baker.io.bake.read_bake import read_bake
    from baker.viewer.export import checked_folder, export_page

    checked_folder(folder)
    bake = read_bake(out)
    names = export_page(bake, script, folder)
    size = sum((folder / name).stat().st_size for name in names)
    if run.as_json:
        run.session.write_json({"out": str(out), "export": str(folder), "files": len(names), "bytes": size})
    if not run.quiet:
        for warning in bake.warnings:
            run.text.write(f"warning: {warning.message}\n")
        run.text.write(
            f"{folder}/index.html shows {out} ({len(names)} files, {size / 1e6:.1f} MB); serve the folder"
            " with a web server, because browsers do not run the page from a file\n"
        )
