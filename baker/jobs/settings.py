"""The settings of a batch."""

from __future__ import annotations

from typing import ClassVar

from baker.core.settings_model import Settings, Text, setting, threads_setting


class BatchSettings(Settings):
    """Holds the settings of a batch, checked."""

    what: ClassVar[str] = "batch setting"

    jobs: int = setting(1, "Bakes at a time, each in a process of its own.", ge=1, le=1024)
    memory: Text | None = setting(
        None, "Memory of all bakes together, like 8G; jobs wait for it.", unit="bytes", metavar="SIZE"
    )
    dry_run: bool = setting(False, "Only report the jobs that would be baked, with reasons.")
    fail_fast: bool = setting(False, "Start nothing more after a failure.")
    force: bool = setting(False, "Bake all, and replace outputs even if baker did not write them.")
    seed: int | None = setting(None, "Seed of all bakes; default: that of each job.", ge=0, le=2**31 - 1)
    threads: int | None = threads_setting()
