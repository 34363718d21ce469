"""Runs chart jobs in a separate process, which can be killed while xatlas is busy.

Protocol, both ways on stdin and stdout: 8 bytes of length, little-endian, then that many bytes of npz.
"""

from __future__ import annotations

import io
import signal
import sys
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from baker.uv.xatlas_charts import ChartJob, FlatCharts, cut_charts


def write_message(stream: IO[bytes], **array: NDArray[Any]) -> None:
    """Send named arrays."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **array)
    data = buffer.getvalue()
    stream.write(len(data).to_bytes(8, "little"))
    stream.write(data)
    stream.flush()


def read_message(stream: IO[bytes]) -> dict[str, NDArray[Any]] | None:
    """Receive named arrays; None at the end of the stream."""
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
    """Receive the charts of a job from a worker; None if it has ended."""
    answer = read_message(stream)
    return None if answer is None else FlatCharts(answer["uv"], answer["chart"])


def main() -> None:
    """Process jobs until stdin ends."""
    # Ctrl-C signals the whole process group; the parent ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    source, sink = sys.stdin.buffer, sys.stdout.buffer
    while (message := read_message(source)) is not None:
        charts = cut_charts(ChartJob(**message))
        write_message(sink, uv=charts.uv, chart=charts.chart)


if __name__ == "__main__":
    main()
