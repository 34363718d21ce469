"""Finds out how fast bakes are here: by the bake that was named, or one that lies beside the scene."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from baker.core.errors import SettingsError
from baker.io.output_folder import MANIFEST_NAME
from baker.lint.cost import Rates, rates_of_bake

# Folders beside a scene that are looked into, and bytes of a manifest that are read.
_MOST_FOLDERS, _MOST_BYTES = 200, 1 << 24


def rates_of(folder: Path) -> Rates:
    """Return the speed of the bake in a folder.

    Raises
    ------
    SettingsError
        If there is none, or it does not tell its rays and timings.
    """
    try:
        return rates_of_bake(json.loads((folder / MANIFEST_NAME).read_text("utf-8")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        why = f"the folder holds no bake whose {MANIFEST_NAME} tells its rays and timings; name another one"
        raise SettingsError(why, file=str(folder), object="rates") from None


def rates_beside(scene: Path) -> Rates | None:
    """Return the speed of the latest bake of a scene among the folders beside it; None if there is none.

    Notes
    -----
    A bake is the scene's if its manifest names this file, whether or not that has changed since.
    """
    found: list[tuple[str, str, Rates]] = []
    with contextlib.suppress(OSError):
        for folder in sorted(scene.resolve().parent.iterdir())[:_MOST_FOLDERS]:
            path = folder / MANIFEST_NAME
            # Whatever lies there was not asked for: what cannot be read is none of ours.
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
                if path.stat().st_size > _MOST_BYTES:
                    continue
                manifest: dict[str, Any] = json.loads(path.read_text("utf-8"))
                if (folder / manifest["input"]["path"]).resolve() == scene.resolve():
                    found.append((str(manifest["created"]), folder.name, rates_of_bake(manifest)))
    if not found:
        return None
    _, name, rates = max(found, key=lambda entry: entry[:2])
    return replace(rates, basis=f"the bake in '{name}'")
