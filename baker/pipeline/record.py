"""Collects timings, ray counts and warnings while the stages of a bake run."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from baker.core.progress import Progress, report
from baker.core.scene import SceneWarning
from baker.core.stage import Stage


@dataclass
class Record:
    """Timings, ray counts, solve statistics and warnings of a bake, for the result and the manifest.

    Attributes
    ----------
    progress : Progress
        Called at the start of each stage, and by the stages.
    timings : dict of str to float
        Seconds of each stage.
    rays : dict of str to int
        Number of rays that each stage cast.
    solve : dict
        Size, residual and energy of the radiosity solve.
    warnings : list of SceneWarning
        Warnings in the order in which they occurred.
    """

    progress: Progress
    timings: dict[str, float] = field(default_factory=dict)
    rays: dict[str, int] = field(default_factory=dict)
    solve: dict[str, Any] = field(default_factory=dict)
    warnings: list[SceneWarning] = field(default_factory=list)

    @contextmanager
    def stage(self, name: Stage) -> Iterator[None]:
        """Report the start of a stage, and add the time of the `with` block to `timings`.

        Parameters
        ----------
        name : Stage
            Key of `timings`.

        Yields
        ------
        None
        """
        report(self.progress, name, 0.0)
        start = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start
