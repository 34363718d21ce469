"""The worker process that runs chart jobs. It can be killed while xatlas is busy.

The process receives messages on stdin and answers on stdout. A message is a length in 8 bytes, little-endian,
followed by an npz file of that length.
"""

from __future__ import annotations

import io
import signal
import sys
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from baker.core.parent_death import end_with_parent
from baker.uv.xatlas_charts import ChartJob, FlatCharts, cut_charts


def write_message(stream: IO[bytes], **array: NDArray[Any]) -> None:
    """Write a message with named arrays to a stream."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **array)
    data = buffer.getvalue()
    stream.write(len(data).to_bytes(8, "little"))
    stream.write(data)
    stream.flush()


def read_message(stream: IO[bytes]) -> dict[str, NDArray[Any]] | None:
    """Read a message from a stream and return its arrays by name; None if the stream has ended."""
    head = stream.read(8)
    if len(head) < 8:
        return None
    size = int.from_bytes(head, "little")
    data = stream.read(size)
    if len(data) < size:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as message:
        return {name: message[name] for name in message.files}


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
