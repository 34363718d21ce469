"""Reports objects that are invisible everywhere because of their alpha.

Alpha is factor x texture x vertex alpha. A point is visible if alpha is at least the cutoff (mode MASK) or at
least `LEAST_ALPHA` (mode BLEND).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.core.scene import Material, Texture

# Smallest alpha that counts as visible in mode BLEND, half a level of an 8-bit image.
LEAST_ALPHA = 0.5 / 255.0
# Barycentric coordinates of the points of each triangle at which the texture is sampled first.
_SAMPLES = np.array(
    [[1 / 3, 1 / 3, 1 / 3], [2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]]
)


@check(
    "invisible",
    group="light",
    severity="warning",
    fix="raise its alpha (in MTL write `d 1`; `Tr 1` alone means transparent) or lower the alphaCutoff; "
    "else leave the object out",
    in_bake=True,
)
def invisible(context: CheckContext) -> Iterator[RawFinding]:
    """An object that is invisible everywhere because of its alpha.

    Alpha is the product of factor, texture and vertex alpha. It is practically 0 everywhere (mode BLEND) or
    below the cutoff everywhere (mode MASK). Such an object neither blocks nor reflects nor emits light.
    Typical causes are exporters that interpret `Tr` of MTL files as opacity, and alpha channels that were
    never painted. An object with a visible part is not reported.
    """
    fades = np.array([material.alpha_mode != "OPAQUE" for material in context.scene.materials], bool)
    if not fades.any():
        return
    for m, facts in enumerate(context.meshes):
        material = facts.material[facts.good]
        if not len(material) or not fades[material].all():
            continue
        used = [int(k) for k in np.unique(material)]
        if any(_seen(facts, k, context.scene.materials[k]) for k in used):
            continue
        n_shown = len(context.instances_of.get(m, ()))
        if n_shown:
            yield RawFinding(
                _sentence([context.scene.materials[k] for k in used]), context.location(m), n_shown
            )


def _sentence(materials: list[Material]) -> str:
    why = [
        f"'{m.name}' has alpha below its cutoff of {m.alpha_cutoff:g}"
        if m.alpha_mode == "MASK"
        else f"'{m.name}' has alpha 0"
        for m in materials[:3]
    ]
    noun = "material" if len(materials) == 1 else "materials"
    return f"nothing of it is visible, and it takes no part in the light: {noun} {', '.join(why)} everywhere"


def _seen(facts: MeshFacts, number: int, material: Material) -> bool:
    """Return whether any good face with this material, whose index is `number`, may be visible somewhere."""
    if material.reflectance is not None:
        return True
    least_alpha = material.alpha_cutoff if material.alpha_mode == "MASK" else LEAST_ALPHA
    face = facts.good[facts.material[facts.good] == number]
    alpha = material.base_colour[3] * _vertex_alpha(facts)[facts.triangle[face]]
    # Compare in float32 as the kernels do, with a margin for rounding of the last digit.
    enough = np.float32(least_alpha) * np.float32(1.0 - 1e-6)
    strong = alpha.max(axis=1) >= enough
    if not strong.any():
        return False
    texture = material.base_colour_texture
    if texture is None:
        return True
    image = texture.image[..., 3].astype(np.float32) / (255.0 if texture.image.dtype == np.uint8 else 1.0)
    if float(image.max(initial=0.0)) * float(alpha.max()) < enough:
        return False
    face, alpha = face[strong], alpha[strong]
    uv = _image_uv(facts, texture)[facts.triangle[face]]
    sample = np.einsum("kc,tcx->tkx", _SAMPLES, uv)
    vertex_alpha = alpha @ _SAMPLES.T
    size = np.array(image.shape[::-1])
    column, row = (np.floor(sample % 1.0 * size).astype(np.int64).clip(0, size - 1)[..., i] for i in (0, 1))
    if texture.wrap == ("repeat", "repeat") and (image[row, column] * vertex_alpha >= enough).any():
        return True
    return _any_within(image * float(alpha.max()) >= enough, uv, texture.wrap)


def _vertex_alpha(facts: MeshFacts) -> NDArray[np.float32]:
    """Return the vertex alpha of a mesh, (V,) float32; 1 in primitives without vertex colours."""
    parts = [
        np.ones(len(p.position), np.float32)
        if p.colour is None
        else np.clip(np.nan_to_num(p.colour[:, 3], nan=1.0), 0.0, 1.0).astype(np.float32)
        for p in facts.source.primitives
    ]
    return np.concatenate(parts)


def _image_uv(facts: MeshFacts, texture: Texture) -> NDArray[np.float64]:
    """Return the texture uv of each vertex, (V, 2) float64.

    The untransformed uv are 0 in primitives that lack the texture's uv set.
    """
    parts = [
        np.nan_to_num(
            p.texcoord.get(texture.texcoord, np.zeros((len(p.position), 2))), nan=0.0, posinf=0.0, neginf=0.0
        )
        for p in facts.source.primitives
    ]
    return np.concatenate(parts).astype(np.float64) @ texture.transform[:, :2].T + texture.transform[:, 2]


def _any_within(mask: NDArray[np.bool_], uv: NDArray[np.float64], wrap: tuple[str, str]) -> bool:
    """Return whether the uv bounding box of any triangle contains a texel at which `mask` is true.

    The bounding box is enlarged by the neighbouring texels that a bilinear lookup reads.

    Parameters
    ----------
    mask : (H, W) bool
        Texels of the texture with visible alpha.
    uv : (T, 3, 2) float64
        Texture uv of the triangles' corners.
    wrap : (str, str)
        Wrap mode of u and v: "repeat", "mirror" or "clamp".
    """
    # Build a summed-area table, with which four lookups count the true texels in a box.
    total = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), np.int64)
    total[1:, 1:] = mask.cumsum(axis=0).cumsum(axis=1)
    (left, right), (top, bottom) = (
        _range(uv[..., axis], mask.shape[1 - axis], wrap[axis]) for axis in (0, 1)
    )
    count = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
    return bool((count > 0).any())


def _range(value: NDArray[np.float64], size: int, wrap: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the range [first, last) of texels that each triangle samples along one axis, (T,) int64 each.

    `value` (T, 3) is u or v of the triangles' corners, and `size` the number of texels along this axis. The
    range is the whole image if a triangle crosses from one repeat of the image to the next. If `wrap` is
    "repeat", the range is also the whole image for a triangle within half a texel of the image's border.
    """
    low, high = value.min(axis=1), value.max(axis=1)
    if wrap == "clamp":
        low, high = low.clip(0.0, 1.0), high.clip(0.0, 1.0)
        whole = np.zeros(len(low), bool)
    else:
        tile = np.floor(low)
        whole = high > tile + 1.0
        odd = (tile % 2 == 1) & (wrap == "mirror")
        low, high = low - tile, high - tile
        low, high = np.where(odd, 1.0 - high, low), np.where(odd, 1.0 - low, high)
        whole |= (wrap == "repeat") & ((low * size < 0.5) | (high * size > size - 0.5))
    first = np.floor(low * size - 0.5).clip(0, size - 1).astype(np.int64)
    last = (np.floor(high * size - 0.5) + 2).clip(1, size).astype(np.int64)
    return np.where(whole, 0, first), np.where(whole, size, last)
