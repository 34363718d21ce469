"""Maps names of settings of other programs to the setting with the same purpose or to a section of LIMITS.md.

The error for an unknown setting recommends this setting or section. Without the two tables of this module, it
would recommend the setting with the most similar spelling, which usually has another purpose. All names are
written with dashes, like flags.
"""

from __future__ import annotations

from collections.abc import Collection

# Keys: settings of a bake. Values: names of settings of other programs with the same purpose.
SAME = {
    "samples": ("rays", "ray-count", "sample-count", "num-samples", "spp", "aa", "indirect-samples"),
    "light-samples": ("shadow-samples", "shadow-rays", "direct-samples"),
    "ao-samples": ("ao-rays", "occlusion-samples"),
    "ao-distance": ("ao-radius", "ao-max-distance", "max-ray-distance", "occlusion-distance"),
    "resolution": (
        "size",
        "width",
        "height",
        "res",
        "texture-size",
        "lightmap-size",
        "map-size",
        "atlas-size",
    ),
    "density": (
        "texel-density",
        "texels-per-unit",
        "texels-per-metre",
        "texels-per-meter",
        "lightmap-scale",
    ),
    "padding": ("margin", "bleed", "gutter", "dilation", "dilate", "chart-padding", "pack-margin"),
    "bounces": ("max-bounces", "indirect-bounces", "gi-bounces", "bounce", "diffuse-bounces"),
    "denoise": ("denoiser", "filter", "filtering", "oidn", "denoise-strength", "noise-filter"),
    "sky": (
        "ambient",
        "ambient-color",
        "ambient-colour",
        "sky-color",
        "sky-colour",
        "world-color",
        "background",
    ),
    "sky-strength": ("sky-intensity", "environment-intensity", "world-strength", "sky-exposure"),
    "threads": ("cores", "workers", "cpus", "num-threads"),
    "export": ("engine", "target", "platform"),
    "encode": ("format", "file-format", "output-format", "hdr", "ktx2", "rgbm", "png", "webp"),
    "channels": ("passes", "pass", "maps", "bake-type", "type", "aov", "layers"),
    "quality": ("preset", "fast", "preview", "draft", "final"),
    "force": ("overwrite", "yes"),
    "out": ("output", "output-dir", "output-folder", "destination"),
    "dtype": ("depth", "bit-depth", "half", "float"),
    "uv": ("uv-channel", "uv-set", "lightmap-uv", "uv-index", "unwrap"),
    "max-pages": ("max-atlases", "atlas-count", "max-lightmaps"),
}

# Keys: titles of sections of docs/LIMITS.md, each of which describes something that `baker` does not do.
# Values: names of settings of other programs that do it.
LIMITED = {
    "CPU only": ("gpu", "device", "cuda", "optix", "hip", "metal", "opencl", "vulkan", "backend", "cpu"),
    "A sky of one colour": (
        "hdri",
        "environment",
        "environment-map",
        "env",
        "envmap",
        "skybox",
        "sky-texture",
        "sky-rotation",
        "turbidity",
        "world",
    ),
    "Lights come from the file": (
        "sun",
        "sun-direction",
        "sun-intensity",
        "sun-colour",
        "sun-color",
        "light",
        "lights",
        "light-size",
        "light-radius",
        "sun-angle",
        "soft-shadows",
        "shadow-softness",
        "area-lights",
        "ies",
    ),
    "No probes": ("probes", "light-probes", "probe-grid", "reflection-probes", "volume", "voxels", "apv"),
    "One value per texel": (
        "directional",
        "directional-mode",
        "dominant-direction",
        "sh",
        "spherical-harmonics",
        "normal-maps",
        "normal-map",
        "bent-normals",
        "rnm",
    ),
    "Static light": (
        "shadowmask",
        "shadow-mask",
        "mixed",
        "mixed-lighting",
        "subtractive",
        "realtime",
        "frame",
        "frames",
        "light-groups",
        "group-lights",
        "relight",
    ),
    "Diffuse reflection": (
        "caustics",
        "specular",
        "glossy",
        "reflections",
        "refraction",
        "roughness",
        "metallic",
    ),
    "Maps, not pictures": (
        "exposure",
        "gamma",
        "tonemap",
        "tone-mapping",
        "srgb",
        "srgb-output",
        "contrast",
        "saturation",
        "boost",
        "albedo-boost",
        "indirect-intensity",
        "indirect-strength",
    ),
    "Textures and vertices": (
        "vertex",
        "vertices",
        "bake-to",
        "vertex-colours",
        "vertex-colors",
        "lods",
        "lod",
    ),
    "A whole scene at a time": ("region", "tile", "tiles", "selected", "objects", "resume", "progressive"),
}

_WANTED = {name: setting for setting, names in SAME.items() for name in names}
_SECTION = {name: title for title, names in LIMITED.items() for name in names}


def foreign_answer(name: str, known: Collection[str]) -> tuple[str, str] | None:
    """Return the setting or the section of LIMITS.md to recommend for an unknown name.

    Parameters
    ----------
    name : str
        The unknown name. Case is ignored, and underscores are read as dashes. If the name is in no table, it
        is searched again without the prefixes "no-" and "use-".
    known : collection of str
        Settings that may be recommended, with dashes.

    Returns
    -------
    tuple of (str, str) or None
        ("use", a setting in `known`) or ("see", a section of docs/LIMITS.md); None if no table has the name,
        or if its setting is not in `known`.
    """
    name = name.lower().replace("_", "-")
    name = name if name in _WANTED or name in _SECTION else name.removeprefix("no-").removeprefix("use-")
    if _WANTED.get(name) in known:
        return "use", _WANTED[name]
    return ("see", f"'{_SECTION[name]}' in docs/LIMITS.md") if name in _SECTION else None
