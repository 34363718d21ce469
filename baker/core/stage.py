"""Names the stages of bakes and other commands, for progress reports, timings and ray counts."""

from __future__ import annotations

from enum import StrEnum

# Text of progress reports while kernels are compiled, usually only in the first run after an install.
COMPILING = "compiling kernels, first run only"


class Stage(StrEnum):
    """A step of work that reports its progress under the name in its value.

    In the manifest, `timings` has the stages of a bake as keys, except `NARROW_GAPS`, which is a part of
    `FORM_FACTORS`, and `DENOISE`, which is a part of `FINISH`. The keys of `rays` are those stages among the
    keys of `timings` that cast rays.
    """

    # Stages of a bake, in the order in which they begin. A bake leaves out stages that it does not need.
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
    # Start of a command, compilation of kernels, a batch, and a bake that runs on a cluster.
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
