"""`uv_means` gives the same means of textures over uv triangles as clipping the triangle to each texel."""

from __future__ import annotations

import numpy as np
import pytest
from inner import compiled

from baker.kernels.textures import PackImage, pack_textures, sample_texture
from baker.lights.texture_levels import TextureLevels, finest_level
from baker.lights.uv_integral import uv_means

(sample_texture,) = compiled(sample_texture)
WRAPS = ("repeat", "mirror", "clamp")
# (height, width) of the test images.
SIZES = ((6, 5), (1, 40), (37, 2), (3, 67))


def picture(size, seed=0, lit=0.5):
    rng = np.random.default_rng(seed)
    image = np.zeros((*size, 4), np.float32)
    image[..., :3] = rng.random((*size, 3)) * (rng.random((*size, 1)) < lit)
    return image


def means(image, wrap, nearest, uv, weight=(1.0, 1.0, 1.0)):
    """Return the results of `uv_means` for the uv triangles `uv` (n, 3, 2): mean (n, 3), spread (n,)."""
    pack = pack_textures([PackImage(image, wrap, nearest)])
    pixels, w, h, sums = finest_level(pack, 0, np.array(weight))
    mean, spread = np.zeros((len(uv), 3)), np.zeros(len(uv))
    uv_means(np.asarray(uv, float), pixels, w, h, pack.wrap[0], sums.weight, sums.block, mean, spread)
    return mean, spread


def wrapped(i, n, mode):
    if mode == "repeat":
        return i % n
    if mode == "mirror":
        return i % (2 * n) if i % (2 * n) < n else 2 * n - 1 - i % (2 * n)
    return min(max(i, 0), n - 1)


def cut_off(corners, axis, bound, sign):
    """Return the part of a polygon in which sign * (x[axis] - bound) >= 0."""
    out = []
    for p, q in zip(corners, [*corners[1:], *corners[:1]], strict=True):
        a, b = sign * (p[axis] - bound), sign * (q[axis] - bound)
        if a >= 0:
            out.append(p)
        if (a >= 0) != (b >= 0):
            out.append(p + (q - p) * a / (a - b))
    return out


def clipped_mean(image, wrap, nearest, uv):
    """Return the mean (3,) and the mean square of an image over a uv triangle.

    The triangle is clipped to each texel, and the clipped polygon is divided into a fan of triangles. The
    mean of a quadratic function over a triangle is the mean of its values at the edge midpoints.
    """
    h, w = image.shape[:2]
    corner = uv * [w, h] - (0.0 if nearest else 0.5)
    total, squares, area = np.zeros(3), 0.0, 0.0
    for j in range(int(np.floor(corner[:, 1].min())), int(np.ceil(corner[:, 1].max()))):
        for i in range(int(np.floor(corner[:, 0].min())), int(np.ceil(corner[:, 0].max()))):
            piece = list(corner)
            for axis, low in ((0, i), (1, j)):
                piece = cut_off(cut_off(piece, axis, low, 1), axis, low + 1, -1) if piece else piece
            line = [wrapped(j + b, h, wrap[1]) for b in (0, 1)]
            column = [wrapped(i + a, w, wrap[0]) for a in (0, 1)]
            cell = image[np.ix_(line, column)][..., :3].astype(float)
            for k in range(1, len(piece) - 1):
                fan = np.array([piece[0], piece[k], piece[k + 1]])
                e, f = fan[1] - fan[0], fan[2] - fan[0]
                size = abs(e[0] * f[1] - e[1] * f[0]) / 2
                area += size
                for m in range(3):
                    x, y = 0.5 * (fan[m] + fan[(m + 1) % 3]) - [i, j]
                    value = cell[0, 0]
                    if not nearest:
                        value = (1 - y) * ((1 - x) * cell[0, 0] + x * cell[0, 1]) + y * (
                            (1 - x) * cell[1, 0] + x * cell[1, 1]
                        )
                    total += size * value / 3
                    squares += size * (value**2).sum() / 3
    return total / area, squares / area


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("wrap", [*((m, m) for m in WRAPS), ("clamp", "mirror")])
def test_triangles_of_any_size_and_place(wrap, nearest):
    rng = np.random.default_rng(1)
    uv = np.concatenate(
        [
            rng.uniform(-1.4, 2.4, (2, 3, 2)),
            rng.uniform(-0.5, 1.5, (2, 1, 2)) + rng.normal(0, 0.01, (2, 3, 2)),
        ]
    )
    for size in SIZES:
        image = picture(size)
        mean, spread = means(image, wrap, nearest, uv)
        for k, triangle in enumerate(uv):
            truth, square = clipped_mean(image, wrap, nearest, triangle)
            np.testing.assert_allclose(mean[k], truth, rtol=1e-9, atol=1e-12)
            if nearest and truth.any():
                assert spread[k] == pytest.approx(max(square / (truth**2).sum() - 1, 0), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("nearest", [False, True])
def test_both_triangles_of_a_rectangle_share_its_texels(nearest):
    image = picture((7, 9))
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    mean, _ = means(image, ("repeat", "repeat"), nearest, square)
    np.testing.assert_allclose(mean.mean(axis=0), image[..., :3].mean(axis=(0, 1)), rtol=1e-6)
    # The mean is the same for a square of whole repeats rotated by 45 degrees, and for reversed corners.
    turned = square @ np.array([[2.0, 2.0], [-2.0, 2.0]]) + 0.3
    np.testing.assert_allclose(
        means(image, ("repeat", "repeat"), nearest, turned)[0].mean(axis=0), mean.mean(axis=0), rtol=1e-9
    )
    back = means(image, ("repeat", "repeat"), nearest, square[:, ::-1])[0]
    np.testing.assert_allclose(back, mean, rtol=1e-9)


def test_uv_without_area():
    """The mean for three equal corners is the lookup there. For corners on a line, it is the line's mean."""
    image = picture((5, 8), lit=1.0)
    pack, out = pack_textures([PackImage(image, ("repeat", "clamp"))]), np.zeros(4)
    place = np.array([0.37, 0.61])
    mean, spread = means(image, ("repeat", "clamp"), False, np.tile(place, (1, 3, 1)))
    sample_texture(pack, 0, *place, 0.0, out)
    np.testing.assert_allclose(mean[0], out[:3], rtol=1e-9)
    assert spread[0] == 0
    line = np.array([0.1, -0.3]) + np.array([[0.0], [1.7], [0.6]]) * [1.0, 0.7]
    flat, _ = means(image, ("repeat", "clamp"), False, line[None])
    # A triangle with a tiny area is not handled as a line, but must give nearly the same mean.
    hair = np.array([[0, 0], [0, 0], [1e-5, -1e-5]])
    wide, _ = means(image, ("repeat", "clamp"), False, (line + hair)[None])
    np.testing.assert_allclose(flat, wide, rtol=1e-4)
    assert flat.min() > 0


def test_black_is_exactly_black():
    image = np.zeros((64, 70, 4), np.float32)
    image[20, 30, :3] = [0.3, 0.7, 0.1]
    rng = np.random.default_rng(2)
    # Centres of triangles outside of the lit texel's bilinear support. Some are in its row or column.
    centre = np.array([[30.5, 24.5], [35.5, 20.5], [25.0, 15.0], [100.5, 50.0]]) / [70, 64]
    uv = centre[:, None] + rng.uniform(-1, 1, (4, 3, 2)) * 2.5 / np.array([70, 64])
    for nearest in (False, True):
        mean, spread = means(image, ("repeat", "repeat"), nearest, uv)
        assert not mean.any()
        assert not spread.any()


def test_a_hundred_repeats_have_the_mean_of_the_texture():
    image = np.zeros((64, 64, 4), np.float32)
    image[5, 9, :3] = 1.0
    square = 100.0 * np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    mean, spread = means(image, ("repeat", "mirror"), True, square)
    np.testing.assert_allclose(mean.mean(axis=0), 1 / 4096, rtol=1e-9)
    np.testing.assert_allclose(spread, 4095, rtol=0.05)


@pytest.mark.parametrize("size", [(16, 24), (7, 13)])
def test_a_smaller_texture_keeps_mean_and_mean_square(size):
    image = picture(size, lit=1.0)
    weight = np.array([1.0, 0.3, 0.7])
    levels = TextureLevels(pack_textures([PackImage(image, ("repeat", "repeat"), True)]), 0, weight)
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    truth = image[..., :3].astype(float).mean(axis=(0, 1))
    squares = (image[..., :3].astype(float) ** 2 @ weight).mean()
    for halved in ((1, 0), (0, 2), (2, 1), (9, 9)):
        level, mean, spread = levels.at(*halved), np.zeros((2, 3)), np.zeros(2)
        assert level.w < size[1] or level.h < size[0]
        uv_means(
            square,
            level.pixels,
            level.w,
            level.h,
            levels.wrap,
            level.sums.weight,
            level.sums.block,
            mean,
            spread,
        )
        np.testing.assert_allclose(mean.mean(axis=0), truth, rtol=1e-6)
        # The mean square of a triangle is (1 + spread) times its squared mean.
        found = ((1 + spread) * (mean**2 @ weight)).mean()
        assert found == pytest.approx(squares, rel=1e-5)


@pytest.mark.parametrize(
    ("size", "used"), [((2, 4096), (1, 2048)), ((3, 4096), (3, 4096)), ((2, 2048), (2, 2048))]
)
def test_large_emissive_images_are_averaged_where_no_texel_is_lost(size, used):
    image = picture(size)
    pack = pack_textures([PackImage(image, ("repeat", "repeat"))])
    level = finest_level(pack, 0, np.ones(3))
    assert (level.h, level.w) == used
    assert level.pixels[:, :3].mean(axis=0) == pytest.approx(image[..., :3].mean(axis=(0, 1)), rel=1e-5)
