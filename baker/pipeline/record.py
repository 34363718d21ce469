"""Timings, ray counts and warnings of one bake, collected while its stages run."""

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
    """Collects what a bake tells about itself while it runs."""

    progress: Progress
    timings: dict[str, float] = field(default_factory=dict)
    rays: dict[str, int] = field(default_factory=dict)
    solve: dict[str, Any] = field(default_factory=dict)
    warnings: list[SceneWarning] = field(default_factory=list)

    @contextmanager
    def stage(self, name: Stage) -> Iterator[None]:
        """Time a stage; several visits add up."""
        report(self.progress, name, 0.0)
        start = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start
