"""How much memory a bake will take at its peak, and how people write sizes.

An upper estimate from what decides it: texels of the pages, form-factor rays, triangles, textures.
docs/BATCH.md compares it with measured peaks.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from baker.core.errors import SettingsError
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.io.load import load_for_bake

# Python, libraries and compiled kernels.
_BASE = 300 * 2**20
_PER_PIXEL = 250
_PER_TRIANGLE = 1000
# Open Image Denoise takes large pages in pieces.
_DENOISE_PER_PIXEL = 500
_DENOISE_MOST = 650 * 2**20
# A form factor, its reciprocal and both merged, for each ray of each patch.
_PER_PATCH_RAY = 45
_MOST_PATCHES = 32768
# Share of a page that charts fill when --density asks for several.
_FILL = 0.5
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


def parse_size(text: str) -> int:
    """Return the bytes that "8G", "512M" or "1.5GiB" stand for; units are powers of 1024.

    Raises
    ------
    SettingsError
        If the text is no such size.
    """
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([KMGT]?)(?:I?B)?\s*", text.upper())
    size = 0 if match is None else int(float(match.group(1)) * _UNITS[match.group(2)])
    if size <= 0:
        raise SettingsError(f"memory '{text}' is no size; write it like 8G or 512M", object="memory")
    return size


def size_words(size: int) -> str:
    """Return a size as one would type it."""
    for unit in ("T", "G", "M", "K"):
        if size >= _UNITS[unit]:
            return f"{size / _UNITS[unit]:.3g}{unit}"
    return str(size)


def estimate_peak(path: Path, settings: BakeSettings) -> int:
    """Estimate the most memory that a bake of this scene takes, bytes.

    Parameters
    ----------
    path : Path
        The scene is read, but nothing of it is kept.
    settings : BakeSettings

    Raises
    ------
    InputError
        If the scene cannot be read.
    """
    scene = load_for_bake(path, settings)
    page = settings.resolution**2
    pixels = page * _pages(scene, settings)
    # As many as the pipeline casts from each patch.
    rays = min(max(settings.hemisphere_samples, 128), 512)
    patches = min(pixels, _MOST_PATCHES) if "irradiance" in settings.channels else 0
    textures = [t for m in scene.materials for t in (m.base_colour_texture, m.emission_texture)]
    images = {id(t.image): t.image.nbytes for t in textures if t is not None}
    # Colours are kept decoded, as floats.
    lasting = _BASE + _PER_PIXEL * pixels + _PER_TRIANGLE * scene.n_triangles + 5 * sum(images.values())
    # One after the other.
    denoising = min(_DENOISE_PER_PIXEL * page, _DENOISE_MOST) if settings.denoise else 0
    return lasting + max(_PER_PATCH_RAY * rays * patches, denoising)


def _pages(scene: Scene, settings: BakeSettings) -> int:
    if settings.density is None:
        return 1
    area = 0.0
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
        corner = (mesh.position.astype(np.float64) @ matrix[:3, :3].T)[mesh.triangle]
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        area += 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    texels = area * settings.density**2 / _FILL
    return min(max(math.ceil(texels / settings.resolution**2), 1), settings.max_pages)
