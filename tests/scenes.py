"""Builds scenes that have closed forms: quads and triangles whose lightmap uv follow texel borders."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import baker
from baker.core.lightmap import BakeResult
from baker.core.progress import silent
from baker.core.scene import Instance, Material, Mesh, PunctualLight, Scene, Texture
from baker.core.settings import make_settings
from baker.pipeline.prepare import PreparedScene, prepare_scene
from baker.pipeline.record import Record
from baker.radiosity.form_factors import FormFactorMatrix, build_form_factors
from baker.radiosity.patches import PatchSet, build_patches
from baker.uv.unwrap import unwrap_scene

GAP = 2


@dataclass(frozen=True)
class Quad:
    """A parallelogram covered by whole texels: columns run along `u`, rows along `v`.

    `texels` is the number of columns and of rows. The first texel is at (`row`, `column`) of the page.
    """

    origin: np.ndarray
    u: np.ndarray
    v: np.ndarray
    column: int
    row: int
    texels: tuple[int, int]

    @property
    def normal(self) -> np.ndarray:
        n = np.cross(self.u, self.v)
        return n / np.linalg.norm(n)

    @property
    def area(self) -> float:
        return float(np.linalg.norm(np.cross(self.u, self.v)))

    def at(self, s: Any, t: Any) -> np.ndarray:
        """Return the world points origin + s u + t v."""
        return self.origin + np.asarray(s)[..., None] * self.u + np.asarray(t)[..., None] * self.v

    def points(self, n: int = 4) -> np.ndarray:
        """Return (rows, columns, n * n, 3): n x n Gauss-Legendre points of each texel, world space."""
        wide, high = self.texels
        spot = 0.5 + 0.5 * np.polynomial.legendre.leggauss(n)[0]
        s = ((np.arange(wide)[:, None] + spot) / wide)[None, :, None, :]
        t = ((np.arange(high)[:, None] + spot) / high)[:, None, :, None]
        return self.at(*np.broadcast_arrays(s, t)).reshape(high, wide, n * n, 3)

    def texel_mean(self, function: Any, n: int = 4) -> np.ndarray:
        """Return (rows, columns): `function` of (..., 3) points, integrated over texels by Gauss-Legendre."""
        weight = 0.5 * np.polynomial.legendre.leggauss(n)[1]
        return function(self.points(n)) @ (weight[:, None] * weight[None, :]).reshape(-1)

    def values(self, result: BakeResult, channel: str = "irradiance") -> np.ndarray:
        """Return the values of the quad's texels in a bake, (rows, columns, C) float64."""
        wide, high = self.texels
        page = result.lightmaps[channel].value[0]
        return page[self.row : self.row + high, self.column : self.column + wide].astype(np.float64)

    def value_at(self, result: BakeResult, point: Any, channel: str = "irradiance") -> np.ndarray:
        """Return the value (C,) of the texel that contains a world point of the quad."""
        offset = np.asarray(point, float) - self.origin
        s, t = (float(offset @ edge / (edge @ edge)) for edge in (self.u, self.v))
        assert 0.0 <= s <= 1.0
        assert 0.0 <= t <= 1.0
        wide, high = self.texels
        return self.values(result, channel)[min(int(t * high), high - 1), min(int(s * wide), wide - 1)]


class SceneBuilder:
    """Builds a scene with an object for each surface; charts are packed on a page of `size` texels."""

    def __init__(self, size: int = 64) -> None:
        self.size = size
        self.materials: list[Material] = []
        self.meshes: list[Mesh] = []
        self.instances: list[Instance] = []
        self.lights: list[PunctualLight] = []
        self._x, self._y, self._shelf = GAP, GAP, 0

    def material(
        self, albedo: Any = 0.5, emission: Any = 0.0, *, double_sided: bool = False, texture: Any = None
    ) -> int:
        """Add a material; `texture` is a linear (H, W, 3) emission image read with texcoord 0."""
        rgba = (*np.broadcast_to(albedo, 3).tolist(), 1.0)
        radiance = tuple(np.broadcast_to(emission, 3).tolist())
        image = None
        if texture is not None:
            ones = np.ones((*texture.shape[:2], 1))
            image = Texture(
                np.concatenate([texture, ones], axis=2).astype(np.float32), wrap=("clamp", "clamp")
            )
        self.materials.append(
            Material("", rgba, emission=radiance, emission_texture=image, double_sided=double_sided)
        )
        return len(self.materials) - 1

    def quad(self, origin: Any, u: Any, v: Any, material: int, texels: tuple[int, int] = (16, 16)) -> Quad:
        """Add a parallelogram, whose front is towards u x v, and return it."""
        o, u, v = (np.asarray(a, float) for a in (origin, u, v))
        x, y = self._cell(*texels)
        made = Quad(o, u, v, x, y, texels)
        corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
        uv = (np.array([x, y]) + corner * texels) / self.size
        self._add(made.at(corner[:, 0], corner[:, 1]), np.tile(made.normal, (4, 1)), [[0, 1, 2], [0, 2, 3]],
                  material, uv, corner)  # fmt: skip
        return made

    def box(
        self, low: Any, high: Any, material: int, texels: int = 12, *, inward: bool = False
    ) -> dict[str, Quad]:
        """Add the six quads of a box, fronts inwards if `inward`; return them by side ("-x", "+x", ...)."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        found = {}
        for axis, letter in enumerate("xyz"):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            edges = []
            for k in (a, b):
                edge = np.zeros(3)
                edge[k] = high[k] - low[k]
                edges.append(edge)
            for side in (0, 1):
                origin = low.copy()
                origin[axis] = (low, high)[side][axis]
                # u x v points along the positive axis. The sides whose front points the other way use v x u.
                forth = (side == 1) != inward
                u, v = edges if forth else edges[::-1]
                found["-+"[side] + letter] = self.quad(origin, u, v, material, (texels, texels))
        return found

    def triangles(self, corner: np.ndarray, material: int, texels: int = 4, normal: Any = None) -> None:
        """Add triangles (T, 3, 3) as an object, one chart each. The default normals are face normals."""
        n = len(corner)
        uv = np.zeros((n, 3, 2))
        for t in range(n):
            x, y = self._cell(texels, texels)
            uv[t] = (np.array([x, y]) + np.array([[0, 0], [texels, 0], [0, texels]])) / self.size
        if normal is None:
            face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            face /= np.linalg.norm(face, axis=1, keepdims=True)
            normal = np.repeat(face[:, None], 3, axis=1)
        self._add(
            corner.reshape(-1, 3), np.reshape(normal, (-1, 3)), np.arange(3 * n).reshape(-1, 3), material,
            uv.reshape(-1, 2), np.zeros((3 * n, 2)),
        )  # fmt: skip

    def sheet(self, point: np.ndarray, material: int, texels: tuple[float, float]) -> None:
        """Add a flat-shaded grid of points (rows, columns, 3) as one chart.

        The fronts face the cross product of the directions along rows and along columns.
        """
        rows, columns = point.shape[:2]
        x, y = self._cell(*(int(np.ceil(t)) for t in texels))
        r, c = (a.reshape(-1) for a in np.indices((rows - 1, columns - 1)))
        square = np.stack([(r, c), (r, c + 1), (r + 1, c + 1), (r + 1, c)], axis=-1)
        own = square[:, :, [0, 1, 2, 0, 2, 3]].reshape(2, -1)
        corner = point[own[0], own[1]].reshape(-1, 3, 3)
        face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal = np.repeat(unit(face)[:, None], 3, axis=1).reshape(-1, 3)
        share = own[::-1].T / np.array([columns - 1, rows - 1])
        uv = (np.array([x, y]) + share * texels) / self.size
        triangle = np.arange(len(share)).reshape(-1, 3)
        self._add(corner.reshape(-1, 3), normal, triangle, material, uv, share)

    def light(self, kind: str, intensity: Any, **where: Any) -> None:
        """Add a light without area."""
        colour = tuple(np.broadcast_to(np.asarray(intensity, float), 3).tolist())
        self.lights.append(PunctualLight(kind, "", len(self.lights), colour, **where))

    def build(self) -> Scene:
        """Return the scene."""
        return Scene(
            "test", None, tuple(self.meshes), tuple(self.materials), tuple(self.instances), tuple(self.lights)
        )

    def bake(self, **settings: Any) -> BakeResult:
        """Bake irradiance without denoising, with the uv of this builder. `settings` override defaults."""
        given = {"resolution": self.size, "uv": "keep", "padding": GAP, "samples": 64, **settings}
        given = {"channels": ["irradiance"], "denoise": False, "threads": 2, **given}
        return baker.bake(self.build(), **given)

    def _cell(self, wide: int, high: int) -> tuple[int, int]:
        if self._x + wide + GAP > self.size:
            self._x, self._y, self._shelf = GAP, self._y + self._shelf + GAP, 0
        at = self._x, self._y
        self._x += wide + GAP
        self._shelf = max(self._shelf, high)
        assert self._y + high + GAP <= self.size, "the page is full: build with a larger size"
        return at

    def _add(self, position: Any, normal: Any, triangle: Any, material: int, uv: Any, texcoord: Any) -> None:
        n, k = len(position), len(triangle)
        self.meshes.append(
            Mesh(
                f"mesh{len(self.meshes)}",
                np.asarray(position, np.float32),
                np.asarray(normal, np.float32),
                np.asarray(triangle, np.int32),
                np.full(k, material, np.int32),
                np.zeros(k, np.int32),
                np.zeros(n, np.int32),
                np.arange(n, dtype=np.int32),
                (np.asarray(texcoord, np.float32), np.asarray(uv, np.float32)),
            )
        )
        number = len(self.instances)
        self.instances.append(Instance(number, f"object{number}", len(self.meshes) - 1, np.eye(4)))


def icosphere(level: int, *, inward: bool = False) -> np.ndarray:
    """Return (20 * 4**level, 3, 3) triangles whose corners lie on the unit sphere."""
    g = (1 + 5**0.5) / 2
    point = np.array(
        [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
         [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]]
    )  # fmt: skip
    face = [
        (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
        (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
        (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1),
    ]  # fmt: skip
    corner = point[np.array(face)] / np.linalg.norm(point[0])
    for _ in range(level):
        a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
        ab, bc, ca = (unit(p + q) for p, q in ((a, b), (b, c), (c, a)))
        corner = np.concatenate(
            [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return corner[:, ::-1].copy() if inward else corner


def unit(vector: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) scaled to length 1."""
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def moved(scene: Scene, matrices: list[np.ndarray]) -> Scene:
    """Return a scene with one instance of its first mesh for each 4 x 4 matrix."""
    return replace(scene, instances=tuple(Instance(k, f"copy{k}", 0, m) for k, m in enumerate(matrices)))


def prepared(builder: SceneBuilder, **settings: Any) -> tuple[PreparedScene, Record]:
    """Return the prepared scene of a bake (texels, ray tree, tables), without light, and its record."""
    given = {"resolution": builder.size, "uv": "keep", "padding": GAP, "threads": 2, **settings}
    scene, chosen = builder.build(), make_settings(given)
    record = Record(silent)
    return prepare_scene(scene, unwrap_scene(scene, chosen), chosen, record), record


def form_factors(
    builder: SceneBuilder, *, n_rays: int = 256, seed: int = 0
) -> tuple[PreparedScene, PatchSet, FormFactorMatrix]:
    """Return the patches and the balanced form factors of a scene."""
    world, _ = prepared(builder, seed=seed)
    patches = build_patches(world.texels)
    matrix = build_form_factors(
        patches,
        world.sides.seen_patches(patches.patch),
        world.job,
        n_rays=n_rays,
    )
    return world, patches, matrix
