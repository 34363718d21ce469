"""The `baker` command: finds the subcommand, runs it, turns failures into exit codes.

No heavy module is imported here, so that `baker --help` is quick: the module of a subcommand, and with it the
settings, is imported only for that subcommand.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from typing import Any, TextIO

from baker.cli.supervise import INTERRUPTED, supervise


def main() -> None:
    """Run the command line of this process; never returns."""
    argv = sys.argv[1:]
    # Collect garbage less often: imports create many objects but no cycles, and collections took 5 % of the
    # start.
    gc.set_threshold(100_000, 20, 100)
    for stream in (sys.stdout, sys.stderr):
        # Escape characters that the terminal's encoding lacks.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    stop, notes = supervise(argv)
    try:
        out = _reserve_stdout() if _asks_json(argv) else sys.stdout
        code = run(argv, out=out, stop=stop, notes=notes)
    except KeyboardInterrupt:
        code = INTERRUPTED
    _leave(code)


def run(argv: list[str], *, out: TextIO | None = None, stop: Any = None, notes: int | None = None) -> int:
    """Run one command line and return its exit code.

    Parameters
    ----------
    argv : list of str
        Arguments without the program's name.
    out : TextIO or None
        Standard output.
    stop : StopFlag or None
        Set by a signal; None for a run without signals.
    notes : int or None
        See `supervise`.
    """
    out = out if out is not None else sys.stdout
    try:
        from baker.cli.session import Session

        session = Session(out=out, notes=notes)
        if stop is not None:
            session.stop = stop
        code = _dispatch(argv, session)
        out.flush()
        return code
    except (SystemExit, BrokenPipeError):
        # The reader (`| head`) closed the pipe; typer turns that into an exit.
        _silence(out)
        return 0
    except (Exception, KeyboardInterrupt) as error:
        from baker.cli.failures import report

        return report(error, as_json=_asks_json(argv), traceback=_verbosity(argv) >= 2, out=out)


def _dispatch(argv: list[str], session: Any) -> int:
    from baker.cli.group import make_app

    code = make_app().main(args=argv, prog_name="baker", standalone_mode=False, obj=session)
    if code == INTERRUPTED:
        # typer turned the interrupt into an exit code; the message and the JSON are still to be written.
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _asks_json(argv: list[str]) -> bool:
    return "--json" in argv


def _verbosity(argv: list[str]) -> int:
    # Count the flags in the unparsed arguments: after a usage error there is no parsed value.
    count = argv.count("--verbose")
    return count + sum(len(word) - 1 for word in argv if word[:1] == "-" and set(word[1:]) == {"v"})


def _reserve_stdout() -> TextIO:
    # Native libraries may print to descriptor 1; with --json it must contain one object only.
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return out


def _silence(stream: TextIO) -> None:
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (OSError, ValueError):
        return


def _leave(code: int) -> None:
    # Not sys.exit: freeing compiled code and arrays one by one takes half a second, and after an interruption
    # it would wait for kernels that still run in worker threads.
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            continue  # the reader is gone
    os._exit(code)
