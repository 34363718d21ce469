"""Limits on the work of a bake, and estimates of its texels, rays and memory before it runs.

The stages, the checks and the memory limit of `baker batch` use these numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage

# Largest number of patches outside narrow gaps, and inside them; larger pages get larger blocks.
MAX_PATCHES = 32768
# Rays from each patch for its form factors: the hemisphere samples of a texel, within these limits.
MIN_PATCH_RAYS, MAX_PATCH_RAYS = 128, 512

# Share of a page that the packer fills: 0.67 to 0.83 in the project's own scenes at 512 and 1024 if the scale
# is free, 0.55 to 0.69 if a density is set, since each instance lies in one page.
FILLED, FILLED_AT_DENSITY = 0.8, 0.65
# Rays per texel that do not depend on settings: for points inside geometry, towards each light without area,
# near emitters.
INSIDE_RAYS, DELTA_LIGHT_RAYS, NEAR_RAYS = 4, 16, 4

MIB = 1 << 20
# Resident memory in bytes, fitted to measured peaks (`benchmarks/memory_peaks.py`): Python, libraries and
# compiled kernels; each triangle.
BASE_BYTES, BYTES_PER_TRIANGLE = 205 * MIB, 350
# Decoded images, per byte of pixels: as in the file, and as float32.
BYTES_PER_IMAGE_BYTE = 5
# Texels whose 16 points (position and normal, float32) are kept from one ray stage to the next. Bakes with
# more texels keep none.
MAX_CACHED_TEXELS, CACHED_BYTES_PER_TEXEL = 262_144, 384
# Other arrays of each texel, in the ray stages and when pages are finished: without light, and with it.
AO_RAY_BYTES_PER_TEXEL, AO_FINISH_BYTES_PER_TEXEL = 150, 230
LIGHT_RAY_BYTES_PER_TEXEL, LIGHT_FINISH_BYTES_PER_TEXEL = 200, 380
# A form factor, its reciprocal and the merged one, for each ray of each patch.
BYTES_PER_PATCH_RAY = 28
# Open Image Denoise, per pixel of one page; it processes larger pages in tiles.
DENOISE_BYTES_PER_PIXEL, MAX_DENOISE_BYTES = 520, 650 * MIB
# Patches beyond those of even blocks, where charts end, directions change and gaps are narrow: for each
# triangle, and at most.
EXTRA_PATCHES_PER_TRIANGLE, MAX_EXTRA_PATCHES = 0.4, 13000


def patch_rays(settings: BakeSettings) -> int:
    """Count the rays from each patch for its form factors.

    Parameters
    ----------
    settings : BakeSettings
        The hemisphere samples are read.

    Returns
    -------
    int
        From `MIN_PATCH_RAYS` to `MAX_PATCH_RAYS`.
    """
    return min(max(settings.hemisphere_samples, MIN_PATCH_RAYS), MAX_PATCH_RAYS)


def texels_and_pages(settings: BakeSettings, area: float) -> tuple[int, int]:
    """Estimate the texels on surfaces and the pages of a bake.

    Parameters
    ----------
    settings : BakeSettings
        Resolution, density and `max_pages` are read.
    area : float
        Area of all surfaces, m2.

    Returns
    -------
    texels : int
        Texels on surfaces, of all pages.
    pages : int
        1 unless a density is set, at most `max_pages`.
    """
    page = settings.resolution**2
    if settings.density is None:
        return round(FILLED * page), 1
    texels = area * settings.density**2
    pages = min(max(math.ceil(texels / (FILLED_AT_DENSITY * page)), 1), settings.max_pages)
    return round(min(texels, FILLED * page * pages)), pages


def surface_area(scene: Scene) -> float:
    """Sum the area of all instances of a scene.

    Parameters
    ----------
    scene : Scene
        Meshes and instances are read.

    Returns
    -------
    float
        Square metres, world.
    """
    area = 0.0
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
        corner = (mesh.position.astype(np.float64) @ matrix[:3, :3].T)[mesh.triangle]
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        area += 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    return area


def image_bytes(scene: Scene) -> int:
    """Sum the sizes of all images that a bake reads.

    Parameters
    ----------
    scene : Scene
        Textures of base colour and emission are read.

    Returns
    -------
    int
        Bytes of pixels as decoded.
    """
    textures = [t for m in scene.materials for t in (m.base_colour_texture, m.emission_texture)]
    return sum({id(t.image): t.image.nbytes for t in textures if t is not None}.values())


@dataclass(frozen=True)
class Workload:
    """Size of a bake.

    Attributes
    ----------
    texels : int
        Texels on surfaces.
    pages, triangles : int
        Pages of the atlas; triangles of all instances.
    image_bytes : int
        Decoded pixels of the images that are read, bytes.
    light, ambient_occlusion : bool
        Whether a channel needs light, and whether one needs ambient occlusion.
    """

    texels: int
    pages: int
    triangles: int
    image_bytes: int
    light: bool
    ambient_occlusion: bool

    def patches(self, settings: BakeSettings) -> int:
        """Estimate the patches of the solve: blocks of 2^k x 2^k texels, and smaller ones at borders."""
        if not self.light or settings.bounces == 0:
            return 0
        even = float(self.texels)
        while even > MAX_PATCHES:
            even /= 4.0
        extra = min(EXTRA_PATCHES_PER_TRIANGLE * self.triangles, MAX_EXTRA_PATCHES)
        return min(round(even + extra), self.texels)

    def rays(self, settings: BakeSettings, *, delta_lights: int, emitters: bool) -> dict[Stage, int]:
        """Estimate the rays of each stage; the early out may save some of them.

        Parameters
        ----------
        settings : BakeSettings
        delta_lights : int
            Lights without area that are not black.
        emitters : bool
            Whether a triangle emits.

        Returns
        -------
        dict of Stage to int
        """
        hemisphere = settings.hemisphere_samples
        occlusion = settings.ao_samples or hemisphere
        rays = {Stage.INSIDE_GEOMETRY: INSIDE_RAYS * self.texels}
        if self.light:
            near = (settings.light_samples or hemisphere) + NEAR_RAYS
            rays[Stage.DIRECT_LIGHT] = self.texels * (DELTA_LIGHT_RAYS * delta_lights + near * emitters)
            if settings.bounces != 0:
                rays[Stage.FORM_FACTORS] = min(self.texels, MAX_PATCHES) * patch_rays(settings)
            rays[Stage.FINAL_GATHER] = self.texels * hemisphere
        if self.ambient_occlusion and not (self.light and occlusion == hemisphere):
            rays[Stage.AMBIENT_OCCLUSION] = self.texels * occlusion
        return rays

    def peak_bytes(self, settings: BakeSettings) -> int:
        """Estimate the largest resident memory of a bake.

        Triangles and images are held throughout. The peak is either in the ray stages, with all form factors,
        or when pages are finished, with the denoiser's memory.

        Parameters
        ----------
        settings : BakeSettings

        Returns
        -------
        int
            Bytes; within 30 % of what is measured in `tests/unit/core/test_budget.py`.
        """
        lasting = BASE_BYTES + BYTES_PER_TRIANGLE * self.triangles + BYTES_PER_IMAGE_BYTE * self.image_bytes
        rays = BYTES_PER_PATCH_RAY * patch_rays(settings) * self.patches(settings)
        rays += self.texels * (LIGHT_RAY_BYTES_PER_TEXEL if self.light else AO_RAY_BYTES_PER_TEXEL)
        if self.texels <= MAX_CACHED_TEXELS:
            rays += CACHED_BYTES_PER_TEXEL * self.texels
        finish = self.texels * (LIGHT_FINISH_BYTES_PER_TEXEL if self.light else AO_FINISH_BYTES_PER_TEXEL)
        if settings.denoise:
            finish += min(DENOISE_BYTES_PER_PIXEL * settings.resolution**2, MAX_DENOISE_BYTES)
        return lasting + max(rays, finish)
