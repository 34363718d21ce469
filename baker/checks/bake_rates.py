"""Reads the speed of bakes on this machine from the manifest of an earlier bake.

The earlier bake is the one that the setting `rates` names, or else the latest bake of the scene in a folder
beside the scene file.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from baker.core.errors import BakerError, InputError, SettingsError
from baker.core.printable import json_text
from baker.core.stage import Stage
from baker.io.bake.output_folder import MANIFEST_NAME
from baker.io.bake.read_manifest import read_manifest, read_unrecovered
from baker.io.regular_file import read_regular

# Largest number of entries of the scene's folder, in alphabetical order, that are searched for `bake.json`.
# Size above which a manifest is not read, bytes.
_MOST_FOLDERS, _MOST_BYTES = 200, 1 << 24
# Stages whose time is assumed to be proportional to the number of texels, to the number of triangles, and to
# their number of rays.
BY_TEXEL = (Stage.TEXELS, Stage.FINISH, Stage.WRITE, Stage.SOLVE)
BY_TRIANGLE = (Stage.LOAD, Stage.UNWRAP, Stage.RAY_TREE)
RAY_STAGES = (
    Stage.INSIDE_GEOMETRY,
    Stage.DIRECT_LIGHT,
    Stage.FORM_FACTORS,
    Stage.FINAL_GATHER,
    Stage.AMBIENT_OCCLUSION,
)


@dataclass(frozen=True)
class Rates:
    """Speed of bakes on this machine.

    Attributes
    ----------
    ray : dict of Stage to float
        Seconds per ray, for those of `RAY_STAGES` whose speed is known.
    texel : dict of Stage to float
        Seconds per texel, for those of the stages `BY_TEXEL` whose speed is known.
    triangle : float
        Seconds per triangle, summed over the stages `BY_TRIANGLE`; 0 if unknown.
    basis : str
        Where the rates come from, for messages: "an earlier bake", "a probe of one second", ...
    """

    ray: Mapping[Stage, float]
    texel: Mapping[Stage, float]
    triangle: float
    basis: str


def rates_of_bake(manifest: Mapping[str, Any]) -> Rates:
    """Return the speed of an earlier bake from its manifest (`bake.json`)."""
    timings, rays = manifest["timings"], manifest["rays"]
    texels = sum(entry["texels"] for entry in manifest["instances"])
    ray = {
        stage: timings[stage] / rays[stage] for stage in RAY_STAGES if timings.get(stage) and rays.get(stage)
    }
    per_texel = {stage: timings[stage] / max(texels, 1) for stage in BY_TEXEL if timings.get(stage)}
    # The manifest has no number of triangles, so the time per triangle is unknown.
    return Rates(ray, per_texel, 0.0, "an earlier bake")


def rates_of(folder: Path) -> Rates:
    """Return the speed of the bake in a folder.

    Parameters
    ----------
    folder : Path
        Output folder of a bake.

    Returns
    -------
    Rates
        The rates of that bake.

    Raises
    ------
    SettingsError
        If the folder has no bake, or its manifest is damaged.
    """
    try:
        return rates_of_bake(read_manifest(folder))
    except InputError:
        why = f"the folder holds no bake whose {MANIFEST_NAME} tells its rays and timings; name another one"
        raise SettingsError(why, file=str(folder), object="rates") from None


def rates_beside(scene: Path) -> Rates | None:
    """Return the speed of the latest bake of a scene in the folders beside the scene file.

    A folder contains a bake of the scene if its manifest names the scene file. The file may have changed
    after that bake. None is returned if there is no such folder.
    """
    found: list[tuple[str, str, Rates]] = []
    # Python raises RuntimeError for a loop of symbolic links.
    with contextlib.suppress(OSError, ValueError, RuntimeError):
        for folder in sorted(scene.resolve().parent.iterdir())[:_MOST_FOLDERS]:
            # The user did not name these folders: write nothing there, and skip unreadable manifests.
            with contextlib.suppress(OSError, ValueError, BakerError):
                # Validation takes long, so skip the bakes of other scenes first.
                text = read_regular(folder / MANIFEST_NAME, most=_MOST_BYTES)
                if json_text(scene.name)[1:-1].encode() not in text:
                    continue
                manifest = read_unrecovered(folder)
                if (folder / str(manifest["input"]["path"])).resolve() == scene.resolve():
                    found.append((str(manifest["created"]), folder.name, rates_of_bake(manifest)))
    if not found:
        return None
    _, name, rates = max(found, key=lambda entry: entry[:2])
    return replace(rates, basis=f"the bake in '{name}'")
