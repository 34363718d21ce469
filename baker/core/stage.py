"""Names of the stages of a bake and of other work, as progress, timings and ray counts show them."""

from __future__ import annotations

from enum import StrEnum


class Stage(StrEnum):
    """A step of work that reports its progress.

    The manifest's `timings` and `rays` have these names as keys.
    """

    # Stages of a bake, in their order.
    LOAD = "load"
    UNWRAP = "unwrap"
    TEXELS = "texels"
    RAY_TREE = "ray tree"
    INSIDE_GEOMETRY = "inside geometry"
    TEXEL_SIDES = "texel sides"
    DIRECT_LIGHT = "direct light"
    NARROW_GAPS = "narrow gaps"
    FORM_FACTORS = "form factors"
    SOLVE = "solve"
    FINAL_GATHER = "final gather"
    AMBIENT_OCCLUSION = "ambient occlusion"
    FINISH = "finish"
    DENOISE = "denoise"
    WRITE = "write"
    # Before and around a bake.
    START = "start"
    COMPILE = "compile"
    BATCH = "batch"
    CLUSTER = "on the cluster"
    # Other commands.
    CHECKS = "checks"
    FIX = "fix"
    REPAIR = "repair"
    RENDERING = "rendering"
    PATH_TRACING = "path tracing"
    CROPS = "crops"
    COMPARE = "compare"
    PICTURES = "pictures"
