"""The worker process that runs chart jobs. It can be killed while xatlas is busy.

The process receives messages (`baker.core.messages`) on stdin and answers on stdout.
"""

from __future__ import annotations

import signal
import sys
from typing import IO

from baker.core.messages import read_message, write_message
from baker.core.parent_death import end_with_parent
from baker.uv.xatlas_charts import ChartJob, FlatCharts, cut_charts


def send_job(stream: IO[bytes], job: ChartJob) -> None:
    """Send a job to a worker."""
    write_message(
        stream,
        position=job.position,
        triangle=job.triangle,
        first_vertex=job.first_vertex,
        first_triangle=job.first_triangle,
    )


def receive_charts(stream: IO[bytes]) -> FlatCharts | None:
    """Receive the charts of a job from a worker; None if the worker has ended."""
    answer = read_message(stream)
    return None if answer is None else FlatCharts(answer["uv"], answer["chart"])


def main() -> None:
    """Process jobs until stdin ends."""
    # Ignore Ctrl-C, which signals the whole process group. The parent process kills this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(int(sys.argv[1]))
    source, sink = sys.stdin.buffer, sys.stdout.buffer
    while (message := read_message(source)) is not None:
        charts = cut_charts(ChartJob(**message))
        write_message(sink, uv=charts.uv, chart=charts.chart)


if __name__ == "__main__":
    main()
