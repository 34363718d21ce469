"""Answers flags of other bakers: the flag of baker with the same purpose, or the section of LIMITS.md.

Without these answers, an unknown flag such as `--hdri` gets the flag with the most similar spelling, which
usually has another purpose.
"""

from __future__ import annotations

from typing import Any

# Flag of baker -> flags of other programs with the same purpose, without dashes.
SAME = {
    "--samples": ("rays", "ray-count", "sample-count", "num-samples", "spp", "aa", "indirect-samples"),
    "--light-samples": ("shadow-samples", "shadow-rays", "direct-samples"),
    "--ao-samples": ("ao-rays", "occlusion-samples"),
    "--ao-distance": ("ao-radius", "ao-max-distance", "max-ray-distance", "occlusion-distance"),
    "--resolution": (
        "size",
        "width",
        "height",
        "res",
        "texture-size",
        "lightmap-size",
        "map-size",
        "atlas-size",
    ),
    "--density": (
        "texel-density",
        "texels-per-unit",
        "texels-per-metre",
        "texels-per-meter",
        "lightmap-scale",
    ),
    "--padding": ("margin", "bleed", "gutter", "dilation", "dilate", "chart-padding", "pack-margin"),
    "--bounces": ("max-bounces", "indirect-bounces", "gi-bounces", "bounce", "diffuse-bounces"),
    "--denoise": ("denoiser", "filter", "filtering", "oidn", "denoise-strength", "noise-filter"),
    "--sky": (
        "ambient",
        "ambient-color",
        "ambient-colour",
        "sky-color",
        "sky-colour",
        "world-color",
        "background",
    ),
    "--sky-strength": ("sky-intensity", "environment-intensity", "world-strength", "sky-exposure"),
    "--threads": ("cores", "workers", "cpus", "num-threads"),
    "--export": ("engine", "target", "platform"),
    "--encode": ("format", "file-format", "output-format", "hdr", "rgbm", "png"),
    "--channels": ("passes", "pass", "maps", "bake-type", "type", "aov", "layers"),
    "--quality": ("preset", "fast", "preview", "draft", "final"),
    "--force": ("overwrite", "yes"),
    "--out": ("output", "output-dir", "output-folder", "destination"),
    "--dtype": ("depth", "bit-depth", "half", "float"),
    "--uv": ("uv-channel", "uv-set", "lightmap-uv", "uv-index", "unwrap"),
    "--max-pages": ("max-atlases", "atlas-count", "max-lightmaps"),
}

# Title of a section of docs/LIMITS.md -> flags of other programs for what it describes, without dashes.
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
        "animation",
        "time",
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

_WANTED = {name: flag for flag, names in SAME.items() for name in names}
_SECTION = {name: title for title, names in LIMITED.items() for name in names}


def answer(option: str, known: set[str], command: str) -> str | None:
    """Return a sentence about an unknown flag that other bakers have.

    Parameters
    ----------
    option : str
        The unknown flag, as typed.
    known : set of str
        Flags of the command. A flag that the command does not have is not recommended.
    command : str
        The command as typed, such as "baker bake".

    Returns
    -------
    str or None
        None if the flag is in no list.
    """
    name = option.lstrip("-").lower().replace("_", "-")
    name = name if name in _WANTED or name in _SECTION else name.removeprefix("no-").removeprefix("use-")
    flag = _WANTED.get(name)
    if flag in known:
        return f"{command} has no {option}: use {flag}; `{command} --help-all` describes it"
    if name in _SECTION:
        return f"{command} has no {option}: see '{_SECTION[name]}' in docs/LIMITS.md"
    return None


def answer_error(error: Any) -> str | None:
    """Return the sentence of `answer` for an error of the parser; None for other errors."""
    option, context = getattr(error, "option_name", None), getattr(error, "ctx", None)
    if type(error).__name__ != "NoSuchOption" or option is None or context is None:
        return None
    known = {name for param in context.command.params for name in (*param.opts, *param.secondary_opts)}
    return answer(option, known, context.command_path)
