"""The command line reports progress as lines or bars, with the time left and a label for compilation."""

from __future__ import annotations

import io
import re
import time

import pytest

from baker.cli.bake_plan import BakePlan
from baker.cli.progress import Reporter
from baker.core.stage import COMPILING


class Terminal(io.StringIO):
    """A stream whose `isatty` returns True."""

    def isatty(self):
        return True


def test_plain_progress_is_a_line_now_and_then():
    clock = iter(range(100))
    stream = io.StringIO()
    reporter = Reporter(quiet=False, stopped=lambda: False, stream=stream, clock=lambda: float(next(clock)))
    with reporter:
        answers = [reporter("gather", k / 10, "23.1 Mrays/s") for k in range(11)]
    assert not any(answers)
    lines = stream.getvalue().splitlines()
    # The fake clock advances one second between reports; a line is printed at most every three seconds.
    assert lines[0] == "gather:  20 %  23.1 Mrays/s  8 s left"
    assert len(lines) == 3


def test_terminal_gets_a_bar_with_stage_rate_and_time_left():
    stream = Terminal()
    with Reporter(quiet=False, stopped=lambda: False, stream=stream) as reporter:
        reporter("gather", 0.25, "23.1 Mrays/s")
        reporter("solve", 0.5, "")
        time.sleep(0.15)
    assert "gather" in stream.getvalue() or "solve" in stream.getvalue()
    assert "50%" in stream.getvalue()


def plan_lines(reports, expected):
    """Return the lines that a bake prints for `reports`, a list of (seconds, stage, fraction, detail)."""
    now, stream = [0.0], io.StringIO()
    reporter = Reporter(quiet=False, stopped=lambda: False, stream=stream, clock=lambda: now[0])
    with reporter:
        reporter.follow(BakePlan(expected, clock=lambda: now[0]))
        for seconds, stage, fraction, detail in reports:
            now[0] = seconds
            reporter(stage, fraction, detail)
    return stream.getvalue().splitlines()


def test_a_bake_has_one_progress_with_the_time_left_of_all_stages():
    expected = {"load": 1.0, "gather": 6.0, "finish": 3.0}
    lines = plan_lines(
        [(4, "load", 0.5, ""), (8, "gather", 0.0, ""), (20, "gather", 0.5, "23.1 Mrays/s"),
         (32, "finish", 0.0, ""), (35, "denoise", 0.5, ""), (40, "finish", 0.5, ""), (48, "finish", 1.0, "")],
        expected,
    )  # fmt: skip
    shares = [int(re.search(r"(\d+) %", line)[1]) for line in lines]
    assert shares == [5, 10, 40, 70, 70, 85, 100]
    # Half of the gather took 12 s, so the other half is expected to take 12 s. The stage `finish` is expected
    # to take 3 s, or up to 8 times as long, because `load` took 8 times its expected second.
    assert lines[2].startswith("bake: 40 %  gather  23.1 Mrays/s  ")
    left = [float(re.search(r"(\d+) s left", line)[1]) for line in lines]
    assert 12 + 3 < left[2] <= 12 + 3 * 8
    assert left[4] == pytest.approx(left[3] - 3, abs=1)
    assert left[-1] == 0
    # The bake takes 48 s. From its middle on, the estimated time left is within a factor of two of the true
    # one.
    assert all(0.5 < (48 - then) / value < 2 for then, value in ((32, left[3]), (40, left[5])))


def test_compiling_is_labelled_and_does_not_spoil_the_estimate():
    expected = {"load": 1.0, "texels": 1.0, "gather": 8.0}
    lines = plan_lines(
        [(1, "load", 0.0, ""), (4, "texels", 0.0, COMPILING), (40, "compile", 0.5, COMPILING),
         (44, "compile", 0.5, COMPILING), (48, "gather", 0.0, "")],
        expected,
    )  # fmt: skip
    assert lines[0] == "bake: 10 %  texels  compiling kernels, first run only"
    assert lines[1] == "bake: 10 %  compiling kernels, first run only"
    assert 8 <= float(re.search(r"(\d+) s left", lines[2])[1]) < 20
    assert len(lines) == 3


@pytest.mark.parametrize("width", [40, 80])
def test_the_bar_of_a_bake_fits_the_terminal(width, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    stream = Terminal()
    with Reporter(quiet=False, stopped=lambda: False, stream=stream) as reporter:
        reporter("start", 0.0)
        reporter.follow(BakePlan({"gather": 4.0, "finish": 1.0}))
        reporter("gather", 0.5, "23.1 Mrays/s")
        time.sleep(0.15)
    drawn = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", stream.getvalue()).replace("\r", "\n").splitlines()
    bars = [line.rstrip() for line in drawn if "bake" in line]
    assert any("40%" in line and "left" in line for line in bars), drawn
    assert all(len(line) <= width for line in drawn)
    assert width < 80 or bars[-1].endswith("gather  23.1 Mrays/s")


def test_progress_answers_the_stop_flag():
    with Reporter(quiet=True, stopped=lambda: True) as reporter:
        assert reporter("gather", 0.1)
