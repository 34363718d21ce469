"""The closed-form irradiance of triangles agrees with another formula and with sums over small pieces."""

from __future__ import annotations

import numpy as np
import pytest
from inner import compiled

from baker.kernels.emitters import AREA, NORMAL, RADIANCE, ROW_LENGTH, TWO_SIDED
from baker.radiosity.kernels.polygon_light import angle_over_sine, unoccluded_irradiance
from baker.trace.packets import PACKET_WIDTH

angle_over_sine, unoccluded_irradiance = compiled(angle_over_sine, unoccluded_irradiance)


def emitter(corners, radiance=(1.0, 1.0, 1.0), two_sided=False):
    row = np.zeros(ROW_LENGTH, np.float32)
    a, b, c = np.asarray(corners, float)
    across = np.cross(b - a, c - a)
    row[:9] = np.ravel(corners)
    row[NORMAL : NORMAL + 3] = across / np.linalg.norm(across)
    row[AREA] = np.linalg.norm(across) / 2
    row[TWO_SIDED] = two_sided
    row[RADIANCE : RADIANCE + 3] = radiance
    return row


def clear(origin, normal, rows, lanes=PACKET_WIDTH):
    found = np.full(3 * PACKET_WIDTH, np.nan, np.float32)
    unoccluded_irradiance(np.float32(origin), np.float32(normal), 0, lanes, np.stack(rows), found)
    return found.reshape(3, PACKET_WIDTH).T[:lanes]


def by_pieces(corners, origin, normal, side=300):
    """Return E / L (16, 16) of a two-sided triangle, summed over side^2 pieces for each point."""
    a, b, c = np.float32(corners).astype(float)
    i, j = np.divmod(np.arange(side * side), side)
    folded = i + j >= side
    i, j = np.where(folded, side - 1 - i, i), np.where(folded, side - 1 - j, j)
    # Centroids of the pieces: triangles similar to the large one, and rotated triangles between them.
    third = np.where(folded, 2 / 3, 1 / 3)
    u, v = (i + third) / side, (j + third) / side
    u, v = np.where(folded, (i + 1 - 1 / 3) / side, u), np.where(folded, (j + 1 - 1 / 3) / side, v)
    place = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    across = np.cross(b - a, c - a) / 2
    out = np.zeros(origin.shape[:2])
    for index in np.ndindex(out.shape):
        arm = place - origin[index]
        square = (arm * arm).sum(axis=1)
        height = np.maximum(arm @ np.asarray(normal[index], float), 0)
        out[index] = (height * np.abs(arm @ across) / square**2).mean()
    return out


def by_angles(corners, origin, normal):
    """Return E / L (16, 16) of a polygon above the horizon, by Lambert's sum over edges in float64."""
    arm = np.float32(corners).astype(float) - origin[:, :, None]
    arm /= np.linalg.norm(arm, axis=-1, keepdims=True)
    after = np.roll(arm, -1, axis=2)
    cross = np.cross(arm, after)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (arm * after).sum(axis=-1))
    return np.abs((angle * (cross / length[..., None] * normal[:, :, None]).sum(axis=-1)).sum(axis=-1)) / 2


def points_below(rng, depth, tilt=0.3):
    origin = np.float32(rng.normal(size=(PACKET_WIDTH, 16, 3)) * 0.5)
    origin[..., 2] = -np.abs(origin[..., 2]) - depth
    normal = rng.normal(size=(PACKET_WIDTH, 16, 3)) * tilt + [0, 0, 1]
    return origin, np.float32(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def test_the_angle_over_its_sine():
    angle = np.linspace(1e-4, np.pi - 1e-4, 20001)
    pairs = zip(np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32), strict=True)
    np.testing.assert_allclose([angle_over_sine(*p) for p in pairs], angle / np.sin(angle), rtol=1e-6)
    assert angle_over_sine(np.float32(1), np.float32(0)) == pytest.approx(1, rel=1e-6)


def test_close_to_the_edge_of_an_emitter_the_light_is_that_of_a_half_plane():
    """Near the edge of a perpendicular emitter, E / L tends to pi / 2, half the value of a hemisphere."""
    polygon = [emitter([(0, 0, 0), (0, 1, 0), (0, 0, 1)]), emitter([(0, 1, 1), (0, 0, 1), (0, 1, 0)])]
    for distance in (1e-2, 1e-3, 1e-4, 1e-5):
        origin = np.tile(np.float32([distance, -1e-7, 0.37]), (PACKET_WIDTH, 16, 1))
        normal = np.tile(np.float32([0, 1, 0]), (PACKET_WIDTH, 16, 1))
        square = np.array([(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)], float)
        truth = by_angles(square, origin[:1, :1].astype(float), normal[:1, :1])[0, 0]
        assert truth == pytest.approx(np.pi / 2, rel=5 * distance + 2e-4)
        np.testing.assert_allclose(clear(origin, normal, polygon)[:, 0], truth, rtol=1e-4)


@pytest.mark.parametrize(
    ("size", "depth", "rtol"), [(1, 3, 5e-5), (0.1, 3, 2e-4), (0.02, 4, 5e-4), (0.001, 4, 5e-4)]
)
def test_light_from_above_meets_lamberts_sum(size, depth, rtol):
    """Sizes vary from large triangles to small ones, for which the kernel uses only the centroid."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        corners = rng.normal(size=(3, 3)) * size + [0, 0, 3]
        origin, normal = points_below(rng, depth)
        arm = np.float32(corners) - origin[:, :, None]
        above = ((arm * normal[:, :, None]).sum(axis=-1) > 0.05).all(axis=(1, 2))
        truth = by_angles(corners, origin, normal).mean(axis=1)
        found = clear(origin, normal, [emitter(corners, (1, 2, 0.5), two_sided=True)])
        assert above.any()
        np.testing.assert_allclose(found[above] / [1, 2, 0.5], truth[above, None] * [1, 1, 1], rtol=rtol)


def test_what_lies_below_the_surface_does_not_shine():
    rng = np.random.default_rng(2)
    cut = 0
    for _ in range(3):
        corners = rng.normal(size=(3, 3)) * 1.5 + [0, 0, 1]
        origin, normal = points_below(rng, 0.5, tilt=3.0)
        height = ((np.float32(corners) - origin[:, :, None]) * normal[:, :, None]).sum(axis=-1)
        cut += ((height.min(axis=-1) < 0) & (height.max(axis=-1) > 0)).sum()
        truth = by_pieces(corners, origin, normal, 150).mean(axis=1)
        found = clear(origin, normal, [emitter(corners, two_sided=True)])[:, 0]
        np.testing.assert_allclose(found, truth, rtol=2e-3, atol=1e-5)
    assert cut > 200


def test_only_the_front_shines_unless_both_sides_do():
    origin, normal = points_below(np.random.default_rng(3), 1.0)
    down, up = [(0, 0, 1), (0, 1, 1), (1, 0, 1)], [(0, 0, 1), (1, 0, 1), (0, 1, 1)]
    shown = clear(origin, normal, [emitter(down)])
    assert (shown > 0).all()
    assert not clear(origin, normal, [emitter(up)]).any()
    np.testing.assert_allclose(clear(origin, normal, [emitter(up, two_sided=True)]), shown, rtol=1e-5)
    # The irradiance of emitters adds up. Only the first 5 lanes are computed.
    np.testing.assert_allclose(
        clear(origin, normal, [emitter(down), emitter(down)], 5), 2 * shown[:5], rtol=1e-6
    )


def test_a_surface_in_the_plane_of_an_emitter_is_dark():
    origin, normal = points_below(np.random.default_rng(4), 1.0)
    origin[..., 2] = 1.0
    normal[:] = [0, 0, -1]
    found = clear(origin, normal, [emitter([(0, 0, 1), (0, 1, 1), (1, 0, 1)], two_sided=True)])
    np.testing.assert_array_equal(found, 0)
