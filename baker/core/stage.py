"""Names the stages of a bake and of other work, for progress reports, timings and ray counts."""

from __future__ import annotations

from enum import StrEnum

# Detail of progress reports while kernels are compiled, which only the first run after an install does.
COMPILING = "compiling kernels, first run only"


class Stage(StrEnum):
    """A step of work that reports its progress.

    The values are keys of `timings` and `rays` in the manifest.
    """

    # Stages of a bake, in the order in which they run.
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
    # Work before a bake, and the progress of several bakes or of a cluster.
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
