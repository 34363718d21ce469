"""Speed of bakes on this machine, from the manifest of a named bake or of one beside the scene."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from baker.core.errors import SettingsError
from baker.core.stage import Stage
from baker.io.bake.output_folder import MANIFEST_NAME

# Largest number of folders beside a scene that are searched, and largest manifest that is read, bytes.
_MOST_FOLDERS, _MOST_BYTES = 200, 1 << 24
# Stages whose time is proportional to texels, and to triangles; that of the rest is proportional to rays.
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
        Seconds per ray of each stage.
    texel, triangle : float
        Seconds per texel and per triangle of the stages that cast no rays.
    basis : str
        Source of the numbers, in words.
    """

    ray: Mapping[Stage, float]
    texel: float
    triangle: float
    basis: str


def rates_of_bake(manifest: Mapping[str, Any]) -> Rates:
    """Return the speed of an earlier bake from its manifest (`bake.json`)."""
    timings, rays = manifest["timings"], manifest["rays"]
    texels = sum(entry["texels"] for entry in manifest["instances"])
    ray = {
        stage: timings[stage] / rays[stage] for stage in RAY_STAGES if timings.get(stage) and rays.get(stage)
    }
    per_texel = sum(timings.get(stage, 0.0) for stage in BY_TEXEL) / max(texels, 1)
    # The manifest does not count triangles.
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

    Raises
    ------
    SettingsError
        If there is none, or its manifest lacks rays and timings.
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
            # Skip unreadable manifests: the user did not name these folders.
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
