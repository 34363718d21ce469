"""Runs the command in a child process, so that it can be stopped while a native library is busy.

Some C++ libraries hold Python's global interpreter lock while they work. xatlas does so for minutes on a
large mesh. No signal handler or thread written in Python can run during that time. The parent process only
waits, so it can always handle Ctrl-C and the other stopping signals. It sends SIGINT to the child and waits
up to `GRACE` seconds for its end. Then it kills the child and all processes in the child's process group, and
removes unfinished output. The parent also reports a crash of native code, or a kill for lack of memory, in
one sentence.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from types import FrameType

from baker.cli.interrupt import INTERRUPTED

# Time between the signal to the child and its kill, seconds.
GRACE = 0.6
# Exit code after a crash of native code, or after a kill that the user did not request.
RESOURCE = 4

_STOPPING = ("SIGINT", "SIGTERM", "SIGHUP")


class StopFlag:
    """A flag that stopping signals set.

    Attributes
    ----------
    requested : bool
        Whether a signal has arrived. Progress callbacks return this value.
    """

    def __init__(self) -> None:
        self.requested = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Set the flag. The first signal also raises KeyboardInterrupt in the running Python code."""
        if not self.requested:
            self.requested = True
            raise KeyboardInterrupt

    def install(self) -> None:
        """Install the handler of the stopping signals in this process."""
        for name in _STOPPING:
            number = getattr(signal, name, None)
            # Keep ignoring SIGHUP if it is ignored, because `nohup` sets this. Handle SIGINT even if it is
            # ignored, because shells ignore it for background jobs.
            if number is not None and not (name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN):
                signal.signal(number, self.handle)


def supervise(argv: list[str]) -> tuple[StopFlag, int | None]:
    """Fork the process. In the child, this function returns. The parent waits for the child and then exits.

    Parameters
    ----------
    argv : list of str
        The arguments. If they contain `--json`, the parent reports failures as JSON.

    Returns
    -------
    stop : StopFlag
        Flag that stopping signals set in the child.
    notes : int or None
        Descriptor of a file that `note_output` writes and the parent reads. None on systems without `fork`,
        where the function returns in the only process.
    """
    stop = StopFlag()
    if not hasattr(os, "fork"):
        stop.install()
        return stop, None
    sys.stdout.flush()
    sys.stderr.flush()
    # Use a file instead of a pipe, because the parent reads it only at the end, and a batch may write more
    # than the buffer of a pipe.
    notes = _unnamed_file()
    blocked = {getattr(signal, name) for name in (*_STOPPING, "SIGTSTP", "SIGCONT")}
    # Block signals until the handlers of parent and child are installed.
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


def _unnamed_file() -> int:
    """Return the descriptor of a file without a name."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("baker")
    import tempfile

    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def note_output(notes: int | None, out: str) -> None:
    """Record the state of an output path for the parent process, before a command writes to it."""
    if notes is not None:
        from baker.cli.leftovers import survey

        os.write(notes, survey(out))


def _settle_child(parent: int) -> None:
    # Make a new process group. The terminal then sends the signal of Ctrl-C only to the parent, which sends
    # it to the child once. The parent can also kill all processes that the child started.
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    from baker.core.parent_death import end_with_parent

    end_with_parent(parent)


class _Watch:
    """The parent process: stops the child after a signal, waits for its end, and cleans up after a kill."""

    def __init__(self, child: int, notes: int, as_json: bool) -> None:
        self.child = child
        self.notes = notes
        self.as_json = as_json
        self.stopping = False

    def install(self) -> None:
        with contextlib.suppress(OSError):  # the child has already made the group, or has ended
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
        # Send the signal only to the child, because its child processes would print further messages.
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
            self._send(signal.SIGKILL)  # end the remaining processes that the child started
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
            from baker.core.printable import json_text

            error = {"kind": kind, "message": message, "file": None, "object": None}
            sys.stdout.write(json_text({"error": error}, only_ascii=True) + "\n")
            sys.stdout.flush()
        return code
