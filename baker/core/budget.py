"""Estimates the texels, rays and memory of a bake before it runs, and defines limits of its work.

The rule `cost` of `baker check` and the memory limit of `baker batch` use the estimates. The stages of a bake
use the limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from baker.core.scene import Scene
from baker.core.stage import Stage

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings

# Intended largest number of patches, which are the blocks of texels that radiosity treats as one surface
# element. Blocks are enlarged up to 256 texels a side to stay within this number. Patches in narrow gaps have
# a separate limit of the same size.
MAX_PATCHES = 32768
# Smallest and largest number of rays from each patch for its form factors. The number is that of the
# hemisphere rays per texel, clamped to these limits.
MIN_PATCH_RAYS, MAX_PATCH_RAYS = 128, 512

# Assumed share of the texels of a page that charts cover, without and with the setting `density`. In this
# project's scenes at 512 and 1024 texels a side, the share was 0.67 to 0.83 without `density` and 0.55 to
# 0.69 with it. With `density` it is lower, because charts cannot be scaled until they fill the page.
FILLED, FILLED_AT_DENSITY = 0.8, 0.65
# Rays per texel that do not depend on settings: rays that find points inside geometry, shadow rays to each
# light without area, and hemisphere rays of texels near emitters.
INSIDE_RAYS, DELTA_LIGHT_RAYS, NEAR_RAYS = 4, 16, 4

MIB = 1 << 20
# All byte numbers are resident memory, fitted to peaks measured with `benchmarks/memory_peaks.py`.
# Memory of Python, libraries and compiled kernels together, and memory of each triangle, bytes.
BASE_BYTES, BYTES_PER_TRIANGLE = 205 * MIB, 350
# Side above which readers of images halve width and height by averaging blocks of 2 x 2 pixels, pixels.
LARGEST_IMAGE_SIDE = 8192
# Bytes of memory for each byte of decoded image pixels, rounded up: 1 for the image of the scene, 1 for the
# copy that kernels read, and 4/3 for the coarser mip levels of this copy, which are float32.
BYTES_PER_IMAGE_BYTE = 3.5
# Number of texels up to which the 16 sample points of each texel are cached between ray stages, and bytes per
# texel of these points (position and normal, float32). Bakes with more texels cache no points.
MAX_CACHED_TEXELS, CACHED_BYTES_PER_TEXEL = 262_144, 384
# Bytes of all other arrays per texel, in the ray stages and while pages are finished. The first line is for
# bakes without light, the second for bakes with light.
AO_RAY_BYTES_PER_TEXEL, AO_FINISH_BYTES_PER_TEXEL = 150, 230
LIGHT_RAY_BYTES_PER_TEXEL, LIGHT_FINISH_BYTES_PER_TEXEL = 200, 380
# Bytes for each ray from each patch: form factor, reciprocal form factor, and the merged form factor.
BYTES_PER_PATCH_RAY = 28
# Memory of Open Image Denoise for each pixel of a page, and its largest memory, bytes. The latter is constant
# because large pages are denoised in tiles.
DENOISE_BYTES_PER_PIXEL, MAX_DENOISE_BYTES = 520, 650 * MIB
# Estimated number of additional small patches at chart borders, at changes of the normal and in narrow gaps:
# number per triangle, and largest number of a bake.
EXTRA_PATCHES_PER_TRIANGLE, MAX_EXTRA_PATCHES = 0.4, 13000


def patch_rays(settings: BakeSettings) -> int:
    """Return the number of rays from each patch for its form factors.

    Parameters
    ----------
    settings : BakeSettings
        `hemisphere_samples` is read.

    Returns
    -------
    int
        From `MIN_PATCH_RAYS` to `MAX_PATCH_RAYS`.
    """
    return min(max(settings.hemisphere_samples, MIN_PATCH_RAYS), MAX_PATCH_RAYS)


def texels_and_pages(settings: BakeSettings, area: float) -> tuple[int, int]:
    """Estimate how many texels on surfaces and how many pages a bake has.

    Parameters
    ----------
    settings : BakeSettings
        `resolution`, `density`, `budget` and `max_pages` are read.
    area : float
        Area of all surfaces, m2.

    Returns
    -------
    texels : int
        Number of texels on surfaces, summed over all pages.
    pages : int
        Number of pages: 1 if no density is set, else at most `max_pages`.
    """
    page = settings.resolution**2
    if settings.density is None:
        pages = 1 if settings.budget is None else settings.max_pages
        return round(FILLED * page * pages), pages
    texels = area * settings.density**2
    pages = min(max(math.ceil(texels / (FILLED_AT_DENSITY * page)), 1), settings.max_pages)
    return round(min(texels, FILLED * page * pages)), pages


def surface_area(scene: Scene) -> float:
    """Return the area of all instances of a scene.

    Parameters
    ----------
    scene : Scene
        Its meshes and instances are read.

    Returns
    -------
    float
        Square metres, in world space.
    """
    area = 0.0
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
        corner = (mesh.position.astype(np.float64) @ matrix[:3, :3].T)[mesh.triangle]
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        area += 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    return area


def image_bytes(scene: Scene) -> tuple[int, int]:
    """Estimate the memory of the images that a bake reads.

    Parameters
    ----------
    scene : Scene
        Its textures of base colour and emission are read.

    Returns
    -------
    decoded : int
        Size of the pixels of all decoded images, bytes.
    loading : int
        Largest size while an image is read, bytes: `decoded` plus the largest 8-bit image at the resolution
        of its file. If the longer side of a decoded image is above `LARGEST_IMAGE_SIDE` / 2, the image in the
        file is assumed to have twice as many rows and columns, because it may have been halved.
    """
    textures = [t for m in scene.materials for t in (m.base_colour_texture, m.emission_texture)]
    images = {id(t.image): t.image for t in textures if t is not None}.values()
    decoded = sum(image.nbytes for image in images)
    in_file = [
        image.nbytes * (4 if 2 * max(image.shape[:2]) > LARGEST_IMAGE_SIDE else 1)
        for image in images
        if image.dtype == np.uint8
    ]
    return decoded, decoded + max(in_file, default=0)


@dataclass(frozen=True)
class Workload:
    """Size of a bake.

    Attributes
    ----------
    texels : int
        Number of texels on surfaces.
    pages, triangles : int
        Number of pages of the atlas, and number of triangles of all instances.
    image_bytes : tuple of int
        `decoded` and `loading`, the results of the function `image_bytes`, bytes.
    light, ambient_occlusion : bool
        Whether a channel of the bake needs light, and whether a channel needs ambient occlusion.
    """

    texels: int
    pages: int
    triangles: int
    image_bytes: tuple[int, int]
    light: bool
    ambient_occlusion: bool

    def patches(self, settings: BakeSettings) -> int:
        """Estimate the number of patches; 0 if the bake has no light or no bounces."""
        if not self.light or settings.bounces == 0:
            return 0
        even = float(self.texels)
        while even > MAX_PATCHES:
            even /= 4.0
        extra = min(EXTRA_PATCHES_PER_TRIANGLE * self.triangles, MAX_EXTRA_PATCHES)
        return min(round(even + extra), self.texels)

    def rays(self, settings: BakeSettings, *, delta_lights: int, emitters: bool) -> dict[Stage, int]:
        """Estimate the number of rays of each stage.

        If there are emitters, all texels count as texels near emitters. Left out are the second pass of
        `INSIDE_GEOMETRY`, the rays of `TEXEL_SIDES` and `NARROW_GAPS`, and rays from additional small
        patches.

        Parameters
        ----------
        settings : BakeSettings
        delta_lights : int
            Number of lights without area that are not black.
        emitters : bool
            Whether the scene has emitters.

        Returns
        -------
        dict of Stage to int
            Number of rays of each stage that the bake runs.
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

        Triangles and images stay in memory throughout. The estimate is the maximum of three numbers: the
        memory while images are read, the memory during the ray stages, which store all form factors, and the
        memory while pages are finished and denoised.

        Parameters
        ----------
        settings : BakeSettings

        Returns
        -------
        int
            Bytes, within 30 % of the peaks that `tests/unit/core/test_budget.py` measures.
        """
        decoded, loading = self.image_bytes
        scene = BASE_BYTES + BYTES_PER_TRIANGLE * self.triangles
        lasting = scene + math.ceil(BYTES_PER_IMAGE_BYTE * decoded)
        rays = BYTES_PER_PATCH_RAY * patch_rays(settings) * self.patches(settings)
        rays += self.texels * (LIGHT_RAY_BYTES_PER_TEXEL if self.light else AO_RAY_BYTES_PER_TEXEL)
        if self.texels <= MAX_CACHED_TEXELS:
            rays += CACHED_BYTES_PER_TEXEL * self.texels
        finish = self.texels * (LIGHT_FINISH_BYTES_PER_TEXEL if self.light else AO_FINISH_BYTES_PER_TEXEL)
        if settings.denoise:
            finish += min(DENOISE_BYTES_PER_PIXEL * settings.resolution**2, MAX_DENOISE_BYTES)
        return max(scene + loading, lasting + max(rays, finish))
