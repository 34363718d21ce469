"""Defines the interface of exports, which convert a finished bake for one engine.

Files of `baker.exporters` register the exports.

Callers look up an export by its name in `EXPORTS` and do not import it. A new engine is therefore supported
by one new file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from baker.core.errors import SettingsError
from baker.core.registry import Registry


class Export(Protocol):
    """Writes a folder of files for one engine.

    Attributes
    ----------
    needs : tuple of str
        Names of the channels that the bake must contain.
    """

    needs: tuple[str, ...]

    def write(self, bake: Path, target: Path) -> None:
        """Convert the bake in the folder `bake` and write the files to the existing, empty folder `target`.

        The same bake gives the same bytes.
        """


EXPORTS: Registry[Export] = Registry("baker.exporters")


def check_exports(names: tuple[str, ...], channels: tuple[str, ...]) -> None:
    """Raise an error if an export does not exist, or if a channel that it needs is not baked.

    Parameters
    ----------
    names : tuple of str
        Names of exports.
    channels : tuple of str
        Channels to be baked.

    Raises
    ------
    SettingsError
        For the first export that does not exist or lacks a channel.
    """
    for name in names:
        for channel in EXPORTS.require(name, "export", setting="export").needs:
            if channel not in channels:
                message = f"the export '{name}' needs the channel {channel}; add it to `channels`"
                raise SettingsError(message, object="export")
