"""`baker ao SCENE -o OUT`: `bake` with ambient occlusion as the only channel."""

from __future__ import annotations

from typing import Any

from baker.cli.bake import job_flags
from baker.cli.bake import work as bake
from baker.cli.commands import COMMANDS
from baker.cli.options import build, common_flags, setting_flags


def command() -> Any:
    """Return the subcommand."""
    flags = [*job_flags(), *setting_flags(without={"channels"}), *common_flags()]
    return build("ao", COMMANDS["ao"], work, flags)


def work(**values: Any) -> None:
    """Bake with `--channels ao`; a configuration file's channels do not count."""
    bake(channels="ao", **values)
