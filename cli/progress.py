"""Shows progress as a bar if the stream is a terminal, and otherwise as a line every few seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

from baker.cli.bake_plan import BakePlan
from baker.cli.flags import in_flags
from baker.core.printable import printable
from baker.core.stage import COMPILING, Stage

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

# Shortest time between two lines, seconds, so that the log of a long bake stays readable.
PLAIN_INTERVAL = 3.0
# Shortest time between two lines with the same words about compiling, seconds.
COMPILING_INTERVAL = 30.0


class Reporter:
    """The progress callback of a command. It is also the context manager that shows and removes the bar.

    Parameters
    ----------
    quiet : bool
        Whether nothing is shown.
    stopped : callable
        A function without arguments that returns whether a stopping signal has arrived. If it has, the
        next report of progress cancels the work.
    stream : TextIO
        Stream on which progress is shown; by default stderr.
    clock : callable
        A function without arguments that returns the time, seconds.
    """

    def __init__(
        self,
        *,
        quiet: bool,
        stopped: Callable[[], bool],
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stream = stream if stream is not None else sys.stderr
        self._quiet = quiet
        self._stopped = stopped
        self._clock = clock
        self._lock = threading.Lock()
        self._stage = ""
        self._started = 0.0
        self._last_line = clock()
        self._bar: RichProgress | None = None
        self._task: Any = None
        self._plan: BakePlan | None = None
        # Text of the last line if kernels were being compiled; otherwise empty.
        self._words = ""
        # The messages of `note`.
        self.noted: list[str] = []

    def __enter__(self) -> Reporter:
        if not self._quiet and self._stream.isatty():
            self._bar = _make_bar(self._stream)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def __call__(self, stage: str, fraction: float, detail: str = "", /) -> bool:
        """Show that `fraction` of `stage` is done, and return whether the work must stop."""
        if not self._quiet:
            # Use a lock, because several threads report the progress of their tiles.
            with self._lock:
                self._show(stage, min(max(fraction, 0.0), 1.0), printable(detail))
        return self._stopped()

    def note(self, message: str) -> None:
        """Write a warning, above the bar if there is one, and append it to `noted`, unless `quiet` is set."""
        if not self._quiet:
            line = f"warning: {printable(in_flags(message))}"
            with self._lock:
                if self._bar is not None:
                    self._bar.console.print(line, markup=False, highlight=False)
                else:
                    self._stream.write(f"{line}\n")
                    self._stream.flush()
            self.noted.append(message)

    def follow(self, plan: BakePlan) -> None:
        """Show the progress of a whole bake from now on, instead of the progress of each stage."""
        self._plan = plan
        if self._bar is not None:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task("bake", total=1.0, detail="", left="")

    def _show(self, stage: str, fraction: float, detail: str) -> None:
        if self._plan is None:
            self._show_stage(stage, fraction, detail)
        else:
            self._show_bake(self._plan, stage, fraction, detail)

    def _show_bake(self, plan: BakePlan, stage: str, fraction: float, detail: str) -> None:
        """Show the progress of the bake, and the stage beside it."""
        compiling = stage == Stage.COMPILE or detail == COMPILING
        share, left = plan.update(stage, fraction, compiling=compiling)
        words = COMPILING if stage == Stage.COMPILE else f"{stage}  {detail}".strip()
        now = self._clock()
        if self._bar is not None:
            shown = "" if left is None else f"{_duration(left)} left"
            self._bar.update(self._task, completed=share, detail=words, left=shown)
        elif now - self._last_line >= (COMPILING_INTERVAL if words == self._words else PLAIN_INTERVAL):
            self._last_line = now
            self._words = words if compiling else ""
            shown = "" if left is None else f"{left:.0f} s left"
            self._write_line([f"bake: {100 * share:.0f} %", words, shown])

    def _show_stage(self, stage: str, fraction: float, detail: str) -> None:
        """Show the progress of a stage."""
        now = self._clock()
        fresh = stage != self._stage
        if fresh:
            self._stage, self._started = stage, now
        if self._bar is not None:
            if fresh:
                if self._task is not None:
                    self._bar.remove_task(self._task)
                self._task = self._bar.add_task(stage, total=1.0, detail=detail, left="")
            shown = _duration((now - self._started) * (1 - fraction) / fraction) if fraction > 0 else ""
            self._bar.update(
                self._task, completed=fraction, detail=detail, left=f"{shown} left" if shown else ""
            )
        elif now - self._last_line >= PLAIN_INTERVAL:
            self._last_line = now
            spent = now - self._started
            left = f"{spent * (1 - fraction) / fraction:.0f} s left" if fraction > 0 and spent > 0 else ""
            self._write_line([f"{stage}:", f"{100 * fraction:.0f} %", detail, left])

    def _write_line(self, words: list[str]) -> None:
        self._stream.write("  ".join(word for word in words if word) + "\n")
        self._stream.flush()


def _duration(seconds: float) -> str:
    """Return a duration as minutes and seconds, or with hours: 0:42, 1:02:00."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _make_bar(stream: TextIO) -> RichProgress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
    from rich.table import Column

    # If the terminal is too narrow, only the last column is truncated.
    cut = Column(no_wrap=True, overflow="ellipsis")
    return Progress(
        TextColumn("{task.description}", table_column=Column(no_wrap=True), markup=False),
        BarColumn(20),
        TaskProgressColumn(),
        TextColumn("{task.fields[left]}", table_column=Column(no_wrap=True)),
        TextColumn("{task.fields[detail]}", table_column=cut, markup=False),
        console=Console(file=stream),
        transient=True,
    )
