"""Runs the command in a child process, so that it can be stopped while a library is busy.

Some C++ libraries hold Python's global lock while they work (xatlas does so for minutes on a large mesh): no
signal handler or thread written in Python can run during that time. The parent process only waits, so it
always receives Ctrl-C. It forwards the signal, gives the child `GRACE` seconds to stop, then kills it and
every process that it started, and removes unfinished output. The parent also reports a crash of native code,
or a kill for lack of memory, in one sentence.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import tempfile
from types import FrameType

# Seconds for the child to stop by itself; everything together takes at most one second.
GRACE = 0.6
INTERRUPTED = 130
RESOURCE = 4

_STOPPING = ("SIGINT", "SIGTERM", "SIGHUP")


class StopFlag:
    """Records that a stopping signal has arrived.

    Attributes
    ----------
    requested : bool
        Whether a signal has arrived; progress callbacks return it.
    """

    def __init__(self) -> None:
        self.requested = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Set the flag; the first signal also interrupts running Python code."""
        if not self.requested:
            self.requested = True
            raise KeyboardInterrupt

    def install(self) -> None:
        """Handle the stopping signals in this process."""
        for name in _STOPPING:
            number = getattr(signal, name, None)
            # Leave SIGHUP ignored, as `nohup` sets it. SIGINT is handled even if ignored: shells do that for
            # background jobs.
            if number is not None and not (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                signal.signal(number, self.handle)


def supervise(argv: list[str]) -> tuple[StopFlag, int | None]:
    """Fork: the child returns and does the work, the parent waits and never returns.

    Parameters
    ----------
    argv : list of str
        The command line; with `--json`, a failure is reported as JSON.

    Returns
    -------
    stop : StopFlag
        Set by a stopping signal in the working process.
    notes : int or None
        Descriptor for `note_output`, shared with the parent; None without `fork`, where this process does the
        work.
    """
    stop = StopFlag()
    if not hasattr(os, "fork"):
        stop.install()
        return stop, None
    sys.stdout.flush()
    sys.stderr.flush()
    # Not a pipe: the parent reads at the end only, and a batch may note more folders than a pipe holds.
    with tempfile.TemporaryFile() as file:
        notes = os.dup(file.fileno())
    blocked = {getattr(signal, name) for name in (*_STOPPING, "SIGTSTP", "SIGCONT")}
    # Block signals until the handlers are installed.
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    parent = os.getpid()
    child = os.fork()
    if child == 0:
        _settle_child(parent)
        stop.install()
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)
        return stop, notes
    watch = _Watch(child, notes, "--json" in argv)
    watch.install()
    signal.pthread_sigmask(signal.SIG_SETMASK, previous)
    os._exit(watch.wait())


def note_output(notes: int | None, out: str) -> None:
    """Record the state of an output folder, before it is written, for the parent process."""
    if notes is not None:
        from baker.cli.leftovers import survey

        os.write(notes, survey(out))


def _settle_child(parent: int) -> None:
    # Its own process group: the terminal's Ctrl-C reaches the parent only, which forwards it once, and the
    # parent can kill processes that the child started.
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(INTERRUPTED)


class _Watch:
    """The parent's side: forwards signals, waits, and cleans up after a kill."""

    def __init__(self, child: int, notes: int, as_json: bool) -> None:
        self.child = child
        self.notes = notes
        self.as_json = as_json
        self.stopping = False

    def install(self) -> None:
        with contextlib.suppress(OSError):  # the child has done it already, or has ended
            os.setpgid(self.child, self.child)
        for name in _STOPPING:
            number = getattr(signal, name)
            if not (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                signal.signal(number, self._stop)
        signal.signal(signal.SIGALRM, self._end)
        signal.signal(signal.SIGTSTP, self._pause)
        signal.signal(signal.SIGCONT, self._resume)

    def _send(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.child, number)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        if self.stopping:
            return
        self.stopping = True
        # Signal the child only: its own child processes would print further messages.
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.child, signal.SIGINT)
        signal.setitimer(signal.ITIMER_REAL, GRACE)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self._send(signal.SIGKILL)

    def _pause(self, number: int, frame: FrameType | None) -> None:
        self._send(signal.SIGSTOP)
        os.kill(os.getpid(), signal.SIGSTOP)

    def _resume(self, number: int, frame: FrameType | None) -> None:
        self._send(signal.SIGCONT)

    def wait(self) -> int:
        """Wait for the child and return the exit code of the command."""
        _, status = os.waitpid(self.child, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        if self.stopping or not os.WIFEXITED(status):
            self._send(signal.SIGKILL)  # child processes that outlived it
            self._tidy()
        if os.WIFEXITED(status):
            return os.WEXITSTATUS(status)
        number = os.WTERMSIG(status)
        if self.stopping:
            return self._report("cancelled", "interrupted", INTERRUPTED)
        if number == signal.SIGKILL:
            why = "the work was killed from outside, most likely for want of memory"
        else:
            why = f"native code crashed ({signal.Signals(number).name})"
        hint = "try a smaller --resolution or fewer --threads; the output folder was left as it was"
        return self._report("resource", f"{why}; {hint}", RESOURCE)

    def _tidy(self) -> None:
        from baker.cli.leftovers import restore

        lines = os.pread(self.notes, os.fstat(self.notes).st_size, 0).splitlines(keepends=True)
        for line in lines:
            if line.endswith(b"\n"):
                restore(line)

    def _report(self, kind: str, message: str, code: int) -> int:
        sys.stderr.write(f"baker: {message}\n")
        sys.stderr.flush()
        if self.as_json:
            import json

            error = {"kind": kind, "message": message, "file": None, "object": None}
            sys.stdout.write(json.dumps({"error": error}) + "\n")
            sys.stdout.flush()
        return code
