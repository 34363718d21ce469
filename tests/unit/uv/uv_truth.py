"""Computes covered texels, gaps between charts and stretch of an atlas with slow, simple functions."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.scene import Mesh, Scene


def covered_texels(uv, resolution: int) -> set[tuple[int, int]]:
    """Return the (row, column) of texels whose square overlaps a uv triangle (3, 2), by separating axes."""
    p = np.asarray(uv, float) * resolution
    low, high = np.floor(p.min(axis=0)).astype(int), np.floor(p.max(axis=0)).astype(int)
    r, c = np.meshgrid(np.arange(low[1], high[1] + 1), np.arange(low[0], high[0] + 1), indexing="ij")
    inside = (c + 1 > p[:, 0].min() + 1e-4) & (c < p[:, 0].max() - 1e-4)
    inside &= (r + 1 > p[:, 1].min() + 1e-4) & (r < p[:, 1].max() - 1e-4)
    for k in range(3):
        edge = p[(k + 1) % 3] - p[k]
        normal = np.array([-edge[1], edge[0]])
        length = np.linalg.norm(normal)
        if length == 0:
            continue
        normal /= length
        if normal @ (p[(k + 2) % 3] - p[k]) < 0:
            normal = -normal
        farthest = normal[0] * (c + (normal[0] > 0) - p[k, 0]) + normal[1] * (r + (normal[1] > 0) - p[k, 1])
        inside &= farthest > 1e-4
    return set(zip(r[inside].tolist(), c[inside].tolist(), strict=True))


def owner_maps(atlas: Atlas) -> np.ndarray:
    """Return (P, H, W): chart + 1 of covered texels, 0 elsewhere. Fails if two charts cover one texel."""
    page = np.zeros((atlas.n_pages, atlas.resolution, atlas.resolution), np.int64)
    for layout in atlas.layouts:
        for corner, chart in zip(layout.uv[layout.triangle], layout.chart, strict=True):
            for r, c in covered_texels(corner, atlas.resolution):
                assert page[layout.page, r, c] in (0, chart + 1), "two charts share a texel"
                page[layout.page, r, c] = chart + 1
    return page


def least_gap(owner: np.ndarray, most: int) -> int:
    """Return the smallest number of empty texels between two charts (Chebyshev distance), up to `most`."""
    none = 1 << 40
    big = np.where(owner == 0, none, owner)
    for gap in range(most + 1):
        size = 2 * gap + 3
        high = maximum_filter(owner, size, mode="constant", cval=0)
        low = minimum_filter(big, size, mode="constant", cval=none)
        if ((owner > 0) & (high != low)).any():
            return gap
    return most


def stretch(layout: InstanceLayout, mesh: Mesh, scene: Scene) -> np.ndarray:
    """Return the singular values (T, 2) of the map from metres to uv, for the T triangles with area.

    The values are divided by their area-weighted root mean square.
    """
    matrix = scene.instances[layout.instance].world_from_object[:3, :3]
    p = (mesh.position.astype(float) @ matrix.T)[mesh.triangle]
    q = layout.uv[layout.triangle].astype(float)
    local = np.linalg.qr(np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2)).R
    weight = 0.5 * np.abs(np.linalg.det(local))
    good = weight > 1e-10
    edge = np.stack([q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]], axis=2)
    values = np.linalg.svd(edge[good] @ np.linalg.inv(local[good]), compute_uv=False)
    share = weight[good] / weight[good].sum()
    return values / np.sqrt((share[:, None] * values**2).sum() / 2)


def check_contract(atlas: Atlas, scene: Scene) -> None:
    """Assert the guarantees of `Atlas` and `InstanceLayout`."""
    assert [layout.instance for layout in atlas.layouts] == list(range(len(scene.instances)))
    seen: set[int] = set()
    for layout in atlas.layouts:
        mesh = scene.meshes[scene.instances[layout.instance].mesh]
        assert layout.vertex.dtype == layout.triangle.dtype == layout.chart.dtype == np.int32
        assert layout.uv.dtype == np.float32
        # Row t of `layout.triangle` is triangle t of the mesh, with the same order of corners.
        np.testing.assert_array_equal(layout.vertex[layout.triangle], mesh.triangle)
        assert layout.chart.shape == (len(mesh.triangle),)
        assert np.isfinite(layout.uv).all()
        assert layout.uv.min(initial=0) >= 0
        assert layout.uv.max(initial=1) <= 1
        assert 0 <= layout.page < atlas.n_pages
        own = set(layout.chart.tolist())
        assert not own & seen, "charts are numbered over the whole atlas"
        seen |= own
    assert seen == set(range(atlas.n_charts))
