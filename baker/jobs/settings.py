"""Defines the settings of a batch."""

from __future__ import annotations

from typing import ClassVar

from baker.core.settings_model import Settings, Text, setting, threads_setting


class BatchSettings(Settings):
    """The validated settings of a batch."""

    what: ClassVar[str] = "batch setting"

    jobs: int = setting(
        1, "Number of bakes that run at the same time, each in a separate process.", ge=1, le=1024
    )
    memory: Text | None = setting(
        None,
        "Limit of the estimated memory of all running bakes together, such as 8G.",
        unit="bytes",
        metavar="SIZE",
    )
    dry_run: bool = setting(False, "Only report the jobs that would be baked, with reasons.")
    fail_fast: bool = setting(False, "Start no further jobs after a failure.")
    force: bool = setting(False, "Bake all jobs, also into folders that baker did not write.")
    seed: int | None = setting(
        None, "Seed of all bakes; by default, each job uses the seed in its settings.", ge=0, le=2**31 - 1
    )
    threads: int | None = threads_setting()
