"""Checks whether an output folder is up to date, by hashes of file contents and not by file times or paths.

An output folder is up to date if these entries of its manifest equal the current values:

- the hash of the scene file and the files that it refers to;
- the settings, except those in `_NOT_COMPARED`;
- the versions of baker and its libraries;
- the hash of each written file.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baker.core.settings import BakeSettings
from baker.io.bake.manifest import library_versions, resolved_settings
from baker.io.bake.output_folder import AS_BAKED, MANIFEST_NAME, file_state
from baker.io.regular_file import read_regular

# Settings in the manifest that are not compared, because values that are compared determine them. `quality`
# only sets the default of `samples`, and `ao_distance_metres` follows from `ao_distance` and the scene.
_NOT_COMPARED = {"quality", "ao_distance_metres"}
# Largest number of differences that `why` lists.
_TOLD = 3


@dataclass(frozen=True)
class Freshness:
    """Result of `check_output`.

    Attributes
    ----------
    fresh : bool
        Whether the folder is up to date.
    why : str
        The reason as text for users: up to `_TOLD` differences, or a sentence.
    manifest : bytes
        Content of `bake.json`, empty if there is none.
    """

    fresh: bool
    why: str
    manifest: bytes = b""


def check_output(out: Path, sha256: str, settings: BakeSettings) -> Freshness:
    """Compare the manifest of an output folder with the current scene, settings, versions and files.

    Parameters
    ----------
    out : Path
        The output folder; need not exist.
    sha256 : str
        Hash of the scene and of the files that it refers to; see `baker.io.scene_hash`.
    settings : BakeSettings
        Settings of the bake.

    Returns
    -------
    Freshness
        The result; not fresh if the manifest is missing or unreadable.
    """
    try:
        data = read_regular(out / MANIFEST_NAME)
    except OSError:
        return Freshness(False, "not baked yet")
    try:
        manifest = json.loads(data)
        found = _differences(manifest["versions"], library_versions())
        if manifest["input"]["sha256"] != sha256:
            found.append("the scene, or a file that it names, changed")
        found += _differences(
            manifest["settings"], _as_baked(resolved_settings(settings), settings, manifest)
        )
        for entry in [] if found else manifest["files"]:
            state = file_state(out / str(entry["file"]), str(entry["sha256"]))
            if state != AS_BAKED:
                words = "is missing" if state == "missing" else "is not as it was baked"
                found.append(f"{entry['file']} {words}")
    except (ValueError, KeyError, TypeError, AttributeError, OSError):
        return Freshness(False, f"its {MANIFEST_NAME} is unreadable", data)
    if not found:
        return Freshness(True, "nothing changed", data)
    more = f"; and {len(found) - _TOLD} more" if len(found) > _TOLD else ""
    return Freshness(False, "; ".join(found[:_TOLD]) + more, data)


def _as_baked(values: dict[str, Any], settings: BakeSettings, manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the resolved settings `values` with the channels that a bake chose for a scene without light."""
    dark = any(warning["code"] == "no-light" for warning in manifest["warnings"])
    if dark and not settings.is_given("channels"):
        return {**values, "channels": manifest["settings"]["channels"]}
    return values


def _differences(before: dict[str, Any], now: dict[str, Any]) -> list[str]:
    names = [name for name in dict.fromkeys([*now, *before]) if name not in _NOT_COMPARED]
    return [
        f"{name} {_words(before.get(name))} -> {_words(now.get(name))}"
        for name in names
        if before.get(name) != now.get(name)
    ]


def _words(value: Any) -> str:
    if value is None:
        return "none"
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)
