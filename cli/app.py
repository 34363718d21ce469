"""Runs the command `baker`: finds the subcommand, runs it, and converts failures to exit codes.

No module that is slow to import is imported here, so that `baker --help` is fast. The module of a subcommand
and the settings are imported only if that subcommand runs.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from typing import Any, TextIO

from baker.cli.interrupt import INTERRUPTED, report_interrupt
from baker.cli.supervise import supervise


def main() -> None:
    """Run the command line of this process, and end the process with the exit code."""
    argv = sys.argv[1:]
    # Collect garbage less often, because imports create many objects but no cycles. Collections took 5 % of
    # the start-up time.
    gc.set_threshold(100_000, 20, 100)
    for stream in (sys.stdout, sys.stderr):
        # Escape characters that the encoding of the terminal lacks.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    out = sys.stdout
    try:
        stop, notes = supervise(argv)
        sys.unraisablehook = _without_interrupts
        if _asks_json(argv):
            out = _reserve_stdout()
        code = run(argv, out=out, stop=stop, notes=notes)
    except KeyboardInterrupt:
        report_interrupt(argv)
        code = INTERRUPTED
    except OSError as error:
        # The system has no process or descriptor left.
        from baker.cli.failures import report

        code = report(error, as_json=_asks_json(argv), traceback=_verbosity(argv) >= 2, out=out)
    _leave(code)


def run(argv: list[str], *, out: TextIO | None = None, stop: Any = None, notes: int | None = None) -> int:
    """Run one command line and return its exit code.

    Parameters
    ----------
    argv : list of str
        Arguments, without the name of the program.
    out : TextIO or None
        Stream to which the command writes its output; `sys.stdout` if None.
    stop : StopFlag or None
        Flag that is set by stopping signals; None if signals are not handled.
    notes : int or None
        Descriptor of the file for `note_output`, see `supervise`.
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
        # The program that reads the output, such as `head`, has closed the pipe. typer may convert the
        # BrokenPipeError to SystemExit.
        _silence(out)
        return 0
    except (Exception, KeyboardInterrupt) as error:
        from baker.cli.failures import report

        # A signal that interrupts an import may cause any error.
        interrupted = stop is not None and stop.requested
        cause = KeyboardInterrupt() if interrupted else error
        return report(cause, as_json=_asks_json(argv), traceback=_verbosity(argv) >= 2, out=out)


def _dispatch(argv: list[str], session: Any) -> int:
    from baker.cli.group import make_app

    code = make_app().main(args=argv, prog_name="baker", standalone_mode=False, obj=session)
    if code == INTERRUPTED:
        # typer converts the interrupt to an exit code. Raise it again, so that message and JSON are written.
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _without_interrupts(unraisable: Any) -> None:
    # If a KeyboardInterrupt is raised in a destructor or a similar callback, Python prints it and continues.
    # Do not print it. The work stops anyway, because the signal also set the flag.
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def _asks_json(argv: list[str]) -> bool:
    return "--json" in argv


def _verbosity(argv: list[str]) -> int:
    # Count the flags in the unparsed arguments, because after a usage error there is no parsed value.
    count = argv.count("--verbose")
    return count + sum(len(word) - 1 for word in argv if word[:1] == "-" and set(word[1:]) == {"v"})


def _reserve_stdout() -> TextIO:
    # Redirect descriptor 1 to stderr, because native libraries may print to it. With --json, standard output
    # must contain only the JSON object.
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    return out


def _silence(stream: TextIO) -> None:
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (OSError, ValueError):
        return


def _leave(code: int) -> None:
    # Use os._exit instead of sys.exit, which takes half a second to free compiled code and arrays. After an
    # interruption, sys.exit would also wait for kernels that still run in worker threads.
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            continue  # the reader has closed the pipe
    os._exit(code)
