"""Divides triangles of textured emission into parts of low variance, with exact mean radiance.

A triangle is cut at the midpoints of its edges into four parts. The parts that cause most noise are cut
again. Black parts are dropped. The radiance at uniformly distributed points of a remaining part then has a
low variance. The noise of a triangle is

    noise = sum share (E[L^2] / E[L]^2 - 1)

The sum is over the parts of a triangle. L is the radiance in a part, and share is the part's power divided by
the triangle's power.

Based on: Clarberg, Jarosz, Akenine-Moller and Jensen, Wavelet importance sampling, 2005 (means of a texture
in a tree). Here the tree divides the triangle instead of the texture, so that no part has to be clipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.kernels.shading import Shading
from baker.kernels.textures import TexturePack
from baker.lights.texture_levels import TextureLevels, fair_limit
from baker.lights.uv_integral import uv_means

# Limit of the noise of a triangle, which the module's docstring defines. Up to this limit, the triangle is
# not cut further.
ENOUGH = 0.05
# Edge length of a part, as a share of its triangle's edge. A part this small is not cut further, because
# float32 barycentrics would not distinguish smaller parts.
_SMALLEST = 2.0**-14
# Limit of the gain (noise times weight) of a part, as a share of the largest gain. All parts above this limit
# are cut in the same round.
_TOGETHER = 0.125
# MOST_CROSSED: total number of texel lines (borders between two rows or columns of texels) that the edges of
# all parts may cross, which limits the time to about a second. To stay below this limit, means of parts are
# computed from a smaller version of their texture. FEW_CROSSED: limit of the number of texel lines that the
# edges of one part cross. Up to this limit, the part always uses the full resolution.
MOST_CROSSED, FEW_CROSSED = 4.0e6, 64.0
# Smallest share of the remaining number of texel lines that a round of cutting may cross, however many rounds
# follow.
_ROUND = 0.25
# Number of texel lines that the parts of one call of the kernel cross. Signals such as Ctrl-C are handled
# between calls.
_CALL = 2.5e5


@dataclass(frozen=True)
class Parts:
    """The m parts that are not black, of n textured triangles.

    Attributes
    ----------
    owner : (m,) int64
        Triangle of each part.
    inside : (m, 3) float64
        Barycentrics b1, b2 of the part's corner 0 in its triangle, and its size. Barycentrics (u, v) of the
        part are (b1 + size u, b2 + size v) in the triangle. The size is the part's edge length divided by the
        triangle's edge length, negative if the part is rotated by 180 degrees.
    mean : (m, 3) float64
        Mean radiance, cd/m2.
    spread : (m,) float64
        Variance / mean^2 of the radiance inside the part; 0 for parts that are treated as uniform.
    node : (k, 4) int32
        Codes of the four parts of each subdivision, see `kernels.emitters.emitter_at`: the number of a part,
        -1 for a black part, -2 - k for subdivision k.
    root : (n,) int32
        Code of each triangle.
    """

    owner: NDArray[np.int64]
    inside: NDArray[np.float64]
    mean: NDArray[np.float64]
    spread: NDArray[np.float64]
    node: NDArray[np.int32]
    root: NDArray[np.int32]


class EmissiveTextures:
    """Computes the mean emission over parts of n textured triangles."""

    def __init__(
        self,
        pack: TexturePack,
        texture: NDArray[np.integer[Any]],
        factor: NDArray[np.float64],
        uv: NDArray[np.float64],
    ) -> None:
        """Prepare n triangles.

        texture : (n,) int, number of each triangle's texture in `pack`
        factor : (n, 3), radiance without the texture, cd/m2; uv : (n, 3, 2), image uv of the corners
        """
        self.pack, self.factor, self.uv = pack, factor, uv.copy()
        # Use the same running sums for materials that differ only in a common factor of R, G and B.
        scaled = self.factor / np.maximum(self.factor.max(axis=1, keepdims=True), 1e-300)
        key = np.column_stack([texture, scaled])
        kinds, kind = np.unique(key, axis=0, return_inverse=True)
        self.kind = kind.reshape(-1)
        self.levels = [TextureLevels(pack, int(row[0]), row[1:] ** 2) for row in kinds]
        # Remaining number of texel lines that edges of parts may cross.
        self.left = MOST_CROSSED
        # (n,) the larger of width and height of each triangle's bounding box in uv, in texels.
        self.texels = np.zeros(len(uv))
        self._bring_near()

    @classmethod
    def of(cls, shading: Shading, triangle: NDArray[np.int64]) -> EmissiveTextures:
        """Prepare triangles of the scene whose materials have an emissive texture.

        triangle : (n,) int64, numbers of the triangles
        """
        material = shading.material[triangle]
        uv = np.zeros((len(triangle), 3, 2))
        if len(shading.emission_uv) > 1:
            uv = shading.emission_uv[shading.triangle[triangle]].astype(np.float64)
        factor = shading.emission[material].astype(np.float64)
        return cls(shading.pack, shading.emission_texture[material], factor, uv)

    def _bring_near(self) -> None:
        """Shift the uv of each triangle by whole periods of the texture, so that the uv are near 0."""
        for k, levels in enumerate(self.levels):
            own = np.flatnonzero(self.kind == k)
            uv = self.uv[own]
            repeats = levels.wrap[:2] != 2
            uv -= np.where(repeats, 2.0 * np.floor(0.5 * uv.min(axis=1)), 0.0)[:, None]
            self.texels[own] = (np.ptp(uv, axis=1) * levels.size).max(axis=1)
            self.uv[own] = uv

    def means(
        self, owner: NDArray[np.int64], inside: NDArray[np.float64], ahead: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return `mean` (m, 3) and `spread` (m,) of parts, see `Parts`.

        owner (m,), inside (m, 3) : see `Parts`
        ahead : largest number of parts in this call and all later calls together; it determines the share of
            the remaining texel lines that the parts of this call may cross
        """
        corner = self.uv[owner]
        edge = corner[:, 1:] - corner[:, :1]
        first = corner[:, 0] + np.einsum("mk,mka->ma", inside[:, :2], edge)
        size = inside[:, 2, None]
        uv = np.stack([first, first + size * edge[:, 0], first + size * edge[:, 1]], axis=1)
        mean, spread = np.zeros((len(owner), 3)), np.zeros(len(owner))
        kind = self.kind[owner]
        members = [(self.levels[k], np.flatnonzero(kind == k)) for k in np.unique(kind)]
        lines = np.zeros((len(owner), 2))
        for levels, own in members:
            lines[own] = levels.crossed(uv[own])
        share = max(_ROUND, len(owner) / max(ahead, len(owner)))
        most = max(fair_limit(lines.sum(axis=1), share * self.left), FEW_CROSSED)
        for levels, own in members:
            halved, crossed = levels.choose(lines[own], most)
            self.left = max(self.left - float(crossed.sum()), 0.0)
            call = (np.cumsum(crossed) // _CALL).astype(np.int64)
            group, number = np.unique(np.column_stack([halved, call]), axis=0, return_inverse=True)
            order = np.argsort(number.reshape(-1), kind="stable")
            ends = np.cumsum(np.bincount(number.reshape(-1)))
            for row, which in zip(group, np.split(order, ends[:-1]), strict=True):
                level, at = levels.at(int(row[0]), int(row[1])), uv[own[which]]
                for axis in range(2):
                    if levels.is_constant(axis, int(row[axis])):
                        at[:, :, axis] = 0.0
                part, varied = np.zeros((len(at), 3)), np.zeros(len(at))
                weight, block = level.sums.weight, level.sums.block
                uv_means(at, level.pixels, level.w, level.h, levels.wrap, weight, block, part, varied)
                mean[own[which]], spread[own[which]] = part, varied
        return mean * self.factor[owner], spread


def brightness(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of R, G and B of radiances.

    It is used instead of luminance, because luminance would give few samples to parts that emit blue.

    Parameters
    ----------
    radiance : (n, 3) float64
        RGB, cd/m2.

    Returns
    -------
    (n,) float64
        Mean, cd/m2.
    """
    mean: NDArray[np.float64] = radiance.mean(axis=1)
    return mean


def cut(
    textures: EmissiveTextures, area: NDArray[np.float64], finest: NDArray[np.float64], most: int
) -> Parts:
    """Cut n triangles into parts until the noise of each triangle is at most `ENOUGH`, or a limit is reached.

    Parameters
    ----------
    textures : EmissiveTextures
        Emission of the triangles.
    area : (n,) float64, m2
        Areas of the triangles.
    finest : (n,) float64
        Size (see `Parts.inside`). Parts up to this size that are at most one texel wide are treated as
        uniform.
    most : int
        Largest number of parts that the cuts may add to the n triangles.

    Returns
    -------
    Parts
        All parts that are not black.
    """
    n = len(area)
    owner = np.arange(n)
    inside = np.tile([0.0, 0.0, 1.0], (n, 1))
    finest = np.minimum(finest, 1.0 / np.maximum(textures.texels, 1e-300))
    mean, spread = _means_of_parts(textures, owner, inside, finest, n + 4 * max(most // 3, 0))
    whole = area * brightness(mean)
    # Weight triangles half by power and half equally, so that triangles of low power are cut, too.
    lit = max(int((whole > 0).sum()), 1)
    weight = 0.5 * whole / max(float(whole.sum()), 1e-300) + 0.5 / lit
    child = np.full(n, -1, np.int64)
    while True:
        share = area[owner] * inside[:, 2] ** 2 * brightness(mean) / np.maximum(whole[owner], 1e-300)
        noise = np.where(child < 0, share * spread, 0.0)
        gain = noise * weight[owner] * (np.abs(inside[:, 2]) > _SMALLEST)
        gain[np.bincount(owner, noise, n)[owner] <= ENOUGH] = 0.0
        room = (most - (len(owner) - n) * 3 // 4) // 3
        chosen = np.flatnonzero(gain > _TOGETHER * gain.max(initial=0.0))
        chosen = np.sort(chosen[np.argsort(-gain[chosen], kind="stable")[: max(room, 0)]])
        if not len(chosen):
            break
        child[chosen] = len(owner) + 4 * np.arange(len(chosen))
        quarter = _quarters(inside[chosen]).reshape(-1, 3)
        fresh = np.repeat(owner[chosen], 4)
        quarter_mean, quarter_spread = _means_of_parts(textures, fresh, quarter, finest, 4 * room)
        owner, inside = np.concatenate([owner, fresh]), np.concatenate([inside, quarter])
        mean, spread = np.concatenate([mean, quarter_mean]), np.concatenate([spread, quarter_spread])
        child = np.concatenate([child, np.full(len(fresh), -1)])
    is_cut = child >= 0
    kept = np.flatnonzero(~is_cut & (mean.max(axis=1) > 0))
    code = np.full(len(owner), -1, np.int32)
    code[kept] = np.arange(len(kept))
    code[is_cut] = -2 - np.arange(is_cut.sum())
    node = code[child[is_cut, None] + np.arange(4)]
    return Parts(owner[kept], inside[kept], mean[kept], spread[kept], node, code[:n])


def _means_of_parts(
    textures: EmissiveTextures,
    owner: NDArray[np.int64],
    inside: NDArray[np.float64],
    finest: NDArray[np.float64],
    ahead: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    mean, spread = textures.means(owner, inside, ahead)
    return mean, np.where(np.abs(inside[:, 2]) <= finest[owner], 0.0, spread)


def _quarters(inside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `inside` (m, 4, 3) of the four parts of each part: at corners 0 to 2, and in the middle.

    inside : (m, 3) float64, see `Parts`
    """
    half = 0.5 * inside[:, 2]
    step = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, -1.0]])
    out: NDArray[np.float64] = half[:, None, None] * step
    out[..., :2] += inside[:, None, :2]
    return out
