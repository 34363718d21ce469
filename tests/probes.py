"""Samples a bake at world points as an engine does: nearest triangle, lightmap uv, bilinear lookup."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.core.lightmap import BakeResult


class Probe:
    """Returns lightmap values of a bake in memory at the surface points nearest to world points."""

    def __init__(self, result: BakeResult) -> None:
        self.result = result
        corner, uv, page, name = [], [], [], []
        for instance, layout in zip(result.scene.instances, result.atlas.layouts, strict=True):
            mesh, matrix = result.scene.meshes[instance.mesh], instance.world_from_object
            world = mesh.position[layout.vertex].astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
            triangle = layout.triangle[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else layout.triangle
            corner.append(world[triangle])
            uv.append(layout.uv[triangle].astype(float))
            page += [layout.page] * len(triangle)
            name += [instance.name] * len(triangle)
        self.corner, self.uv = np.concatenate(corner), np.concatenate(uv)
        self.page, self.name = np.array(page), np.array(name)
        cross = np.cross(self.corner[:, 1] - self.corner[:, 0], self.corner[:, 2] - self.corner[:, 0])
        self.area = np.linalg.norm(cross, axis=1) / 2
        self.normal = cross / np.maximum(2 * self.area, 1e-300)[:, None]

    def at(self, point: Any, normal: Any, channel: str = "irradiance", *, within: float = 5e-3) -> np.ndarray:
        """Return the value (C,) at a point at most `within` metres from a surface that faces `normal`."""
        point, normal = np.asarray(point, float), np.asarray(normal, float)
        a, b, c = (self.corner[:, k] for k in range(3))
        u, v, w = b - a, c - a, point - a
        uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
        wu, wv = (w * u).sum(1), (w * v).sum(1)
        det = np.maximum(uu * vv - uv * uv, 1e-300)
        s, t = (vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det
        outside = np.maximum.reduce([-s, -t, s + t - 1, np.zeros_like(s)])
        height = np.abs((w * self.normal).sum(1))
        good = (self.area > 0) & (self.normal @ normal > 0.5) & (outside < 1e-4) & (height < within)
        assert good.any(), f"no surface at {point} that faces {normal}"
        k = int(np.where(good, height, np.inf).argmin())
        uv_point = self.uv[k].T @ [1 - s[k] - t[k], s[k], t[k]]
        return self._bilinear(self.result.lightmaps[channel].value[self.page[k]], uv_point)

    def surface_points(self, name: str, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return n random points (n, 3) of an object's surface and their face normals (n, 3)."""
        own = np.flatnonzero(self.name == name)
        pick = rng.choice(own, n, p=self.area[own] / self.area[own].sum())
        root, share = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
        a, b, c = (self.corner[pick, k] for k in range(3))
        return (1 - root) * a + root * (1 - share) * b + root * share * c, self.normal[pick]

    @staticmethod
    def _bilinear(page: np.ndarray, uv: np.ndarray) -> np.ndarray:
        high, wide = page.shape[:2]
        x, y = uv[0] * wide - 0.5, uv[1] * high - 0.5
        column, row = int(np.floor(x)), int(np.floor(y))
        value = np.zeros(page.shape[2])
        for r, c, weight in (
            (row, column, (1 - y + row) * (1 - x + column)),
            (row, column + 1, (1 - y + row) * (x - column)),
            (row + 1, column, (y - row) * (1 - x + column)),
            (row + 1, column + 1, (y - row) * (x - column)),
        ):
            value += weight * page[min(max(r, 0), high - 1), min(max(c, 0), wide - 1)]
        return value
