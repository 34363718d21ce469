"""Interface of exports: a file of `baker.exporters` converts a finished bake for one engine.

Callers find an export by its name in `EXPORTS` and never import it, so a new engine is one new file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from baker.core.errors import SettingsError
from baker.core.registry import Registry


class Export(Protocol):
    """Writes a folder of files for one engine.

    `needs` lists the channels that must have been baked.
    """

    needs: tuple[str, ...]

    def write(self, bake: Path, target: Path) -> None:
        """Write files for a whole bake in the folder `bake` into the existing empty folder `target`.

        The same bake gives the same bytes.
        """


EXPORTS: Registry[Export] = Registry("baker.exporters")


def check_exports(names: tuple[str, ...], channels: tuple[str, ...]) -> None:
    """Make sure that exports exist and that the channels they need are baked.

    Parameters
    ----------
    names : tuple of str
        Names of exports.
    channels : tuple of str
        Channels to be baked.

    Raises
    ------
    SettingsError
    """
    for name in names:
        for channel in EXPORTS.require(name, "export", setting="export").needs:
            if channel not in channels:
                message = f"the export '{name}' needs the channel {channel}; add it to `channels`"
                raise SettingsError(message, object="export")
