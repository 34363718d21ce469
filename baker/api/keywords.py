"""Settings as keywords of the functions of the Python API, for editors and type checkers.

Made by `docs/make_keywords.py` from the models of settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypedDict


class BakeKeywords(TypedDict, total=False):
    """Keywords of `BakeSettings`."""

    # Channels to bake. Default for a scene without light: ao.
    channels: str | Sequence[str]

    # Width and height of each page.
    resolution: int

    # Texels per metre; adds pages as needed.
    density: float | None

    # Largest number of pages if `density` is set.
    max_pages: int

    # Number of pages and their width, such as 2x1024: all objects get the largest density that
    # fits.
    budget: str | None

    # Empty texels between charts.
    padding: int

    # Keep TEXCOORD_1 as lightmap uv, or unwrap; `auto` keeps it if it is valid.
    uv: Literal["auto", "keep", "unwrap"]

    # Instances of a mesh share one mesh and TEXCOORD_1 in scene.glb, or each has its own copy.
    instances: Literal["share", "unique"]

    # Library that cuts surfaces into charts and packs them.
    unwrapper: Literal["xatlas"]

    # Preset of `samples`: preview 16, medium 64, high 256, ultra 1024.
    quality: Literal["preview", "medium", "high", "ultra"]

    # Hemisphere rays per texel; default: by `quality`.
    samples: int | None

    # Rays per texel to emissive surfaces; default: `samples`.
    light_samples: int | None

    # AO rays per texel; default: `samples`.
    ao_samples: int | None

    # Maximum distance of AO: metres, `10%` of the scene's diagonal, or `inf`.
    ao_distance: str | float

    # Sky radiance R,G,B in cd/m2. Default: black.
    sky: str | float | Sequence[float] | None

    # Factor of the sky radiance.
    sky_strength: float

    # Number of reflections of light; default: until converged.
    bounces: int | None

    # Denoise with Open Image Denoise.
    denoise: bool

    # Additional file formats of each page: `hdr`, `ktx2`, `rgbm`, `webp` for maps with three
    # colours; `png16`, `png8` for maps with one value per texel.
    encode: str | Sequence[str]

    # Engines for which a subfolder is written: `three`, `babylon`, `godot`, `unity` ..., see
    # ENGINES.md.
    export: str | Sequence[str]

    # Bake only objects with these node names or node paths; `*` and `?` are wildcards.
    include: str | Sequence[str]

    # Leave out objects and lights with these node names or node paths, and their descendants.
    exclude: str | Sequence[str]

    # Settings of the objects with these node names or node paths, and of their descendants.
    object: str | Sequence[str]

    # Leave out collision hulls and lower levels of detail, recognised by their names, like
    # `UCX_Wall`.
    name_rules: bool

    # Up axis, for file formats that do not specify one.
    up: Literal["y", "z"]

    # Metres per unit, for file formats that do not specify their unit.
    scale: float

    # Name or number of the scene in a glTF file; default: the file's default scene.
    scene_name: str | float | None

    # Material variant of a glTF file; default: the materials without a variant.
    variant: str | None

    # Name or number of the animation that poses a glTF scene; default with `time`: the first one.
    animation: str | float | None

    # Time of the animation that poses a glTF scene; default: the pose of the file, with `animation`
    # 0.
    time: float | None

    # Colour that replaces unreadable textures of base colour, emission and alpha, or error.
    missing_textures: Literal["error", "white", "grey", "magenta"]

    # What becomes an object of an OBJ file: each object and group, each object, or the whole file.
    split: Literal["groups", "objects", "none"]

    # Unlit materials of glTF only block light (`block`), or also reflect it like others (`lit`).
    unlit: Literal["block", "lit"]

    # Also read referenced files outside the scene's folder.
    allow_outside: bool

    # Seed of all random numbers.
    seed: int

    # Number of threads; default: all cores.
    threads: int | None

    # Number format of the EXR files.
    dtype: Literal["half", "float"]

    # Compression of the EXR files.
    exr_compression: Literal["zip", "piz"]

    # Largest irradiance that RGBM can store, lx; `auto` uses the brightest texel.
    rgbm_range: str | float


class AoKeywords(TypedDict, total=False):
    """Keywords of `BakeSettings` except `channels`."""

    resolution: int
    density: float | None
    max_pages: int
    budget: str | None
    padding: int
    uv: Literal["auto", "keep", "unwrap"]
    instances: Literal["share", "unique"]
    unwrapper: Literal["xatlas"]
    quality: Literal["preview", "medium", "high", "ultra"]
    samples: int | None
    light_samples: int | None
    ao_samples: int | None
    ao_distance: str | float
    sky: str | float | Sequence[float] | None
    sky_strength: float
    bounces: int | None
    denoise: bool
    encode: str | Sequence[str]
    export: str | Sequence[str]
    include: str | Sequence[str]
    exclude: str | Sequence[str]
    object: str | Sequence[str]
    name_rules: bool
    up: Literal["y", "z"]
    scale: float
    scene_name: str | float | None
    variant: str | None
    animation: str | float | None
    time: float | None
    missing_textures: Literal["error", "white", "grey", "magenta"]
    split: Literal["groups", "objects", "none"]
    unlit: Literal["block", "lit"]
    allow_outside: bool
    seed: int
    threads: int | None
    dtype: Literal["half", "float"]
    exr_compression: Literal["zip", "piz"]
    rgbm_range: str | float


class BatchKeywords(TypedDict, total=False):
    """Keywords of `BatchSettings`."""

    # Number of bakes that run at the same time, each in a separate process.
    jobs: int

    # Limit of the estimated memory of all running bakes together, such as 8G.
    memory: str | float | None

    # Only report the jobs that would be baked, with reasons.
    dry_run: bool

    # Start no further jobs after a failure.
    fail_fast: bool

    # Bake all jobs, also into folders that baker did not write.
    force: bool

    # Seed of all bakes; by default, each job uses the seed in its settings.
    seed: int | None

    # Number of threads; default: all cores.
    threads: int | None


class CheckKeywords(TypedDict, total=False):
    """Keywords of `CheckSettings`."""

    # Lowest severity that fails the check; default: the scene's extras, else error.
    fail_on: Literal["warning", "error"] | None

    # Findings to ignore; `*` matches any characters. Repeatable.
    ignore: str | Sequence[str]

    # Coarsest mip level at which charts must not bleed into each other; 0 is the page.
    mip: int

    # Folder of an earlier bake whose speed is used to estimate time; default: the latest bake of
    # the scene in a folder beside it.
    rates: str | Path | None

    # Estimate time and memory of a bake; measures the speed of rays for about a second.
    cost: bool


class DiffKeywords(TypedDict, total=False):
    """Keywords of `DiffSettings`."""

    # Number of texels of A to compare.
    texels: int

    # Also compute the FLIP error of the pages.
    flip: bool

    # Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.flip > 0.02". Default:
    # none.
    fail_if: str | None

    # Seed of all random numbers.
    seed: int

    # Number of threads; default: all cores.
    threads: int | None


class LoadKeywords(TypedDict, total=False):
    """Keywords of `LoadSettings`."""

    # Up axis, for file formats that do not specify one.
    up: Literal["y", "z"]

    # Metres per unit, for file formats that do not specify their unit.
    scale: float

    # Name or number of the scene in a glTF file; default: the file's default scene.
    scene_name: str | float | None

    # Material variant of a glTF file; default: the materials without a variant.
    variant: str | None

    # Name or number of the animation that poses a glTF scene; default with `time`: the first one.
    animation: str | float | None

    # Time of the animation that poses a glTF scene; default: the pose of the file, with `animation`
    # 0.
    time: float | None

    # Colour that replaces unreadable textures of base colour, emission and alpha, or error.
    missing_textures: Literal["error", "white", "grey", "magenta"]

    # What becomes an object of an OBJ file: each object and group, each object, or the whole file.
    split: Literal["groups", "objects", "none"]

    # Unlit materials of glTF only block light (`block`), or also reflect it like others (`lit`).
    unlit: Literal["block", "lit"]

    # Also read referenced files outside the scene's folder.
    allow_outside: bool


class RenderKeywords(TypedDict, total=False):
    """Keywords of `RenderSettings`."""

    # Position, target and vertical field of view in degrees; or name or number of a camera in the
    # file. Default: the file's first camera.
    camera: str | float | Sequence[float] | None

    # Width of the picture.
    width: int

    # Height of the picture.
    height: int

    # Number of paths per pixel; at least two are traced. Default: 64, or no limit with
    # `time_limit`.
    spp: int | None

    # Stop after this time, which includes loading. At least two paths per pixel are traced.
    time_limit: float | None

    # Estimator: uniform, cosine, stratified, light, bsdf, mis, mis-power or bdpt.
    estimator: str

    # Largest number of surface points that reflect light on a path; 1 is direct light only.
    # Default: no limit.
    max_depth: int | None

    # Render ambient occlusion.
    ao: bool

    # Largest distance of occluders for `ao`: metres, `10%` of the scene's diagonal, or `inf`.
    ao_distance: str | float | None

    # Further layers: albedo, normal, depth.
    aov: str | Sequence[str]

    # Run Open Image Denoise over the picture.
    denoise: bool

    # Output folder of a bake. Instead of the input, its scene is rendered, lit by its lightmaps,
    # without path tracing.
    lightmap: str | Path | None

    # Sky radiance R,G,B in cd/m2. Default: black; with `lightmap`, the sky of the bake.
    sky: str | float | Sequence[float] | None

    # Factor of the sky radiance.
    sky_strength: float

    # Name or number of the scene in a glTF file; default: the file's default scene.
    scene_name: str | float | None

    # Material variant of a glTF file; default: the materials without a variant.
    variant: str | None

    # Name or number of the animation that poses a glTF scene; default with `time`: the first one.
    animation: str | float | None

    # Time of the animation that poses a glTF scene; default: the pose of the file, with `animation`
    # 0.
    time: float | None

    # Colour that replaces unreadable textures of base colour, emission and alpha, or error.
    missing_textures: Literal["error", "white", "grey", "magenta"]

    # What becomes an object of an OBJ file: each object and group, each object, or the whole file.
    split: Literal["groups", "objects", "none"]

    # Unlit materials of glTF only block light (`block`), or also reflect it like others (`lit`).
    unlit: Literal["block", "lit"]

    # Bake only objects with these node names or node paths; `*` and `?` are wildcards.
    include: str | Sequence[str]

    # Leave out objects and lights with these node names or node paths, and their descendants.
    exclude: str | Sequence[str]

    # Settings of the objects with these node names or node paths, and of their descendants.
    object: str | Sequence[str]

    # Leave out collision hulls and lower levels of detail, recognised by their names, like
    # `UCX_Wall`.
    name_rules: bool

    # Also read referenced files outside the scene's folder.
    allow_outside: bool

    # Seed of all random numbers.
    seed: int

    # Number of threads; default: all cores.
    threads: int | None


class RepairKeywords(TypedDict, total=False):
    """Keywords of `RepairSettings`."""

    # Fix, and also repair the shape of meshes: non-manifold edges, holes, orientation, slivers
    # (needs pip install pymeshlab).
    repair: bool

    # Width of the page for which lightmap uv are tested and made.
    resolution: int

    # Up axis, for file formats that do not specify one.
    up: Literal["y", "z"]

    # Metres per unit, for file formats that do not specify their unit.
    scale: float

    # Also read referenced files outside the scene's folder.
    allow_outside: bool

    # Number of threads; default: all cores.
    threads: int | None


class UnwrapKeywords(TypedDict, total=False):
    """Keywords of `UnwrapSettings`."""

    # Width and height of each page.
    resolution: int

    # Texels per metre; adds pages as needed.
    density: float | None

    # Largest number of pages if `density` is set.
    max_pages: int

    # Empty texels between charts.
    padding: int

    # Keep TEXCOORD_1 as lightmap uv, or unwrap; `auto` keeps it if it is valid.
    uv: Literal["auto", "keep", "unwrap"]

    # Instances of a mesh share one mesh and TEXCOORD_1 in scene.glb, or each has its own copy.
    instances: Literal["share", "unique"]

    # Library that cuts surfaces into charts and packs them.
    unwrapper: Literal["xatlas"]

    # Number of threads; default: all cores.
    threads: int | None


class VerifyKeywords(TypedDict, total=False):
    """Keywords of `VerifySettings`."""

    # Number of random texels to compare. Points at edges are added. Texels that differ from all
    # their neighbours, that have large gradients or that have rare light levels are added, too.
    texels: int

    # Fixed number of paths for each texel.
    spp: int | None

    # Relative standard error at which path tracing of a texel stops.
    target_se: float

    # Time for path tracing; `inf` is no limit. Default: 40, or no limit if `spp` is set.
    time_limit: float | None

    # Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.rmse > 0.02". Default:
    # the limits of `baker` for each channel.
    fail_if: str | None

    # Seed of all random numbers.
    seed: int

    # Number of threads; default: all cores.
    threads: int | None
