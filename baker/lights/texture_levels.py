"""Computes emissive textures at lower resolutions, for triangles whose edges cross too many texel lines.

A texel line is a border between two rows or columns of texels. Each texel of a smaller texture contains the
mean RGB of the original texture over its area, and, in the fourth column, the variance of the original
texture inside this area. Width and height are halved independently. So a long narrow triangle that crosses
many repeats of the texture loses resolution only along its length.

Based on: Heckbert, Survey of texture mapping, 1986 (box-filtered levels).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.textures import HEIGHT, STORAGE, WIDTH, TexturePack, decoded, level_rows
from baker.lights.uv_integral import BLOCK, N_SUMS, RowSums, fill_row_sums

_CLAMP = 2
# Limit of the width and height of a mip level, texels. Above this limit, the next coarser level is used
# instead, if width and height are even. (If one is odd, the next level omits the last row or column and has
# different means.)
LARGEST_SIDE = 2048
# Largest number of rows or columns that are averaged in one step, which limits the working memory.
_STRIP = 256


class Level(NamedTuple):
    """A texture at one resolution.

    pixels : (h * w, 4) float32; w, h : width and height, texels; sums : running sums along the rows
    """

    pixels: NDArray[np.float32]
    w: int
    h: int
    sums: RowSums


class TextureLevels:
    """One texture of a pack at all resolutions; each resolution is computed on first use."""

    def __init__(self, pack: TexturePack, texture: int, weight: NDArray[np.float64]) -> None:
        """Prepare a texture.

        texture : number of the texture in `pack`
        weight : (3,) factors of R^2, G^2 and B^2 in sums of squares
        """
        finest = finest_level(pack, texture, weight)
        self.wrap = pack.wrap[texture]
        self.size = np.array([finest.w, finest.h])
        self._texture, self._weight = texture, weight
        self._made = {(0, 0): finest}
        # List of the widths of all levels down to one texel, and list of the heights.
        self._sizes = [_halvings(finest.w), _halvings(finest.h)]

    def at(self, along_u: int, along_v: int) -> Level:
        """Return the texture after `along_u` halvings of its width and `along_v` halvings of its height.

        A width or height of one texel is not halved further.
        """
        key = min(along_u, len(self._sizes[0]) - 1), min(along_v, len(self._sizes[1]) - 1)
        if key not in self._made:
            u, v = key
            before = self.at(u - 1, v) if u > v or v == 0 else self.at(u, v - 1)
            image = before.pixels.reshape(before.h, before.w, 4)
            image = _halved(image, 1 if u > v or v == 0 else 0, self._weight, before.sums.weight[3] != 0)
            h, w = image.shape[:2]
            pixels = np.ascontiguousarray(image.reshape(-1, 4))
            self._made[key] = Level(pixels, w, h, _sums(pixels, h, self._weight, 1.0, self._texture))
        return self._made[key]

    def crossed(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 2) float64: about how many texel lines each triangle's edges cross along u and v.

        uv : (n, 3, 2) float64, corners of the triangles
        """
        lines = np.abs(uv - uv[:, [1, 2, 0]]) * self.size
        # For clamped axes, limit the number, because there are no texel lines outside the texture.
        most = np.where(self.wrap[:2] == _CLAMP, self.size + 2.0, np.inf)
        total: NDArray[np.float64] = np.minimum(lines, most).sum(axis=1)
        return total

    def choose(
        self, lines: NDArray[np.float64], most: float
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Choose a resolution for each triangle at which its edges cross at most `most` texel lines.

        Parameters
        ----------
        lines : (n, 2) float64
            Numbers of texel lines that the triangles cross at the finest resolution, from `crossed`.
        most : float
            Largest number of texel lines crossed by one triangle.

        Returns
        -------
        halved : (n, 2) int64
            Number of halvings along u and along v. If it is one more than the number of halvings to one
            texel, the texture is treated as constant along that axis (`is_constant`).
        crossed : (n,) float64
            Number of texel lines that each triangle crosses at the chosen resolution.
        """
        halved = np.zeros((len(lines), 2), np.int64)
        # Compute the share of the texel lines that remains after each number of halvings; 0 for a constant
        # axis.
        left = [np.append(np.array(sizes) / sizes[0], 0.0) for sizes in self._sizes]
        now = lines.copy()
        while len(over := np.flatnonzero(now.sum(axis=1) > most)):
            axis = now[over].argmax(axis=1)
            halved[over, axis] += 1
            for a in range(2):
                own = over[axis == a]
                now[own, a] = lines[own, a] * left[a][halved[own, a]]
        return halved, now.sum(axis=1)

    def is_constant(self, axis: int, halved: int) -> bool:
        """Return whether the texture is treated as constant along an axis after `halved` halvings."""
        return halved >= len(self._sizes[axis])


def fair_limit(wanted: NDArray[np.float64], total: float) -> float:
    """Return the largest x for which sum(min(wanted, x)) <= total; inf if sum(wanted) <= total.

    wanted : (n,) float64
    """
    ascending = np.sort(wanted)
    before = np.concatenate([[0.0], np.cumsum(ascending)[:-1]])
    # equal[k] is the limit x if exactly the k smallest amounts are below x: sum of these k amounts + (n - k)
    # x = total.
    equal = (total - before) / np.arange(len(wanted), 0, -1)
    short = np.flatnonzero(equal < ascending)
    return float(equal[short[0]]) if len(short) else np.inf


def finest_level(pack: TexturePack, texture: int, weight: NDArray[np.float64]) -> Level:
    """Return the mip level of a texture from which the means of its emission are computed.

    This is the finest level whose width and height are at most `LARGEST_SIDE` texels. If a finer level has
    odd width or height, that level is returned instead.

    Parameters
    ----------
    pack : TexturePack
        The textures.
    texture : int
        Number of the texture.
    weight : (3,) float64
        Factors of R^2, G^2 and B^2 in sums of squares.

    Returns
    -------
    Level
        Linear texels, and the running sums along their rows.
    """
    n = 0
    size = pack.level[texture, :, [WIDTH, HEIGHT]].T
    while size[n].max() > LARGEST_SIDE and not (size[n] % 2).any():
        n += 1
    w, h = (int(x) for x in size[n])
    pixels = decoded(level_rows(pack, texture, n), int(pack.wrap[texture, STORAGE]))
    return Level(pixels, w, h, _sums(pixels, h, weight, 0.0, texture))


def _sums(
    pixels: NDArray[np.float32], h: int, weight: NDArray[np.float64], fourth: float, texture: int
) -> RowSums:
    block = np.zeros((h, len(pixels) // h // BLOCK + 1, N_SUMS))
    weights = np.append(weight, fourth)
    fill_row_sums(pixels, 0, weights, block)
    return RowSums(block, weights, texture)


def _halvings(n: int) -> list[int]:
    sizes = [n]
    while sizes[-1] > 1:
        sizes.append((sizes[-1] + 1) // 2)
    return sizes


def _halved(
    image: NDArray[np.float32], axis: int, weight: NDArray[np.float64], has_variance: bool
) -> NDArray[np.float32]:
    """Halve the number of texels along an axis, rounded up, by averages over the areas of the new texels.

    image : (h, w, 4) float32; axis : 0 halves the height, 1 the width
    weight : (3,) float64, see `TextureLevels`; has_variance : whether column 3 of `image` is a variance
    """
    shape = list(image.shape)
    n = shape[axis]
    shape[axis] = (n + 1) // 2
    out = np.zeros(shape, np.float32)
    wide = n / shape[axis]
    low = wide * np.arange(shape[axis])
    first = np.floor(low + 1e-9).astype(np.int64)
    # A new texel overlaps at most three old texels.
    which = first[:, None] + np.arange(3)
    share = np.minimum(which + 1, (low + wide)[:, None]) - np.maximum(which, low[:, None])
    share = np.where(share > 1e-9, share, 0.0) / wide
    which = np.minimum(which, n - 1)
    for start in range(0, shape[1 - axis], _STRIP):
        strip = slice(start, start + _STRIP)
        source = (image[:, strip] if axis == 0 else image[strip]).astype(np.float64)
        span = (-1, 1, 1) if axis == 0 else (1, -1, 1)
        taken = [
            (share[:, k].reshape(span), source.take(which[:, k], axis)) for k in range(3) if share[:, k].any()
        ]
        mean = sum((s * t for s, t in taken), np.zeros(1))
        square = sum((s * ((t - mean)[..., :3] ** 2 @ weight)[..., None] for s, t in taken), np.zeros(1))
        mean[..., 3:] = square + (mean[..., 3:] if has_variance else 0.0)
        if axis == 0:
            out[:, strip] = mean
        else:
            out[strip] = mean
    return out
