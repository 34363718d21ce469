"""For each code of `baker check`: a minimal scene with the flaw, and a similar scene without the flaw."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder
from PIL import Image

# Unit cube. Bits 0, 1 and 2 of a vertex index are its x, y and z. The triangles face outwards.
CUBE = np.float32([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
CUBE_TRIANGLE = np.int64(
    [
        [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6],
    ]
)  # fmt: skip
# A floor of 4 x 4 m in the plane y = 0. Its front faces up.
FLOOR = np.float32([[-2, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]])
GREY = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]}}
SQUARE = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])


@dataclass(frozen=True)
class Case:
    """A GLB with a flaw, a GLB without the flaw, and the bake settings for the check of both."""

    bad: bytes
    good: bytes
    settings: dict[str, Any] = field(default_factory=dict)


def scene(*parts: Any, lights: tuple = (), materials: tuple = (GREY,), extra: Any = None) -> bytes:
    """Return a GLB with one mesh and node for each part.

    A part is (position, triangle, attributes, node members, material index), of which the last three are
    optional. `lights` has (light, node members). `extra(builder)` edits the document before it is written.
    """
    builder = GltfBuilder()
    for material in materials:
        builder.add("materials", material)
    for k, part in enumerate(parts):
        position, triangle, attributes, node, material = (*part, *({}, {}, 0)[len(part) - 2 :])
        primitive = builder.primitive(
            np.float32(position), np.uint32(triangle), material=material, **attributes
        )
        builder.node(mesh=builder.mesh(primitive, name=f"mesh {k}"), name=f"part {k}", **node)
    if lights:
        table = [light for light, _ in lights]
        builder.json["extensions"] = {"KHR_lights_punctual": {"lights": table}}
        builder.json["extensionsUsed"] = ["KHR_lights_punctual"]
        for k, (_, node) in enumerate(lights):
            builder.node(name=f"light {k}", extensions={"KHR_lights_punctual": {"light": k}}, **node)
    if extra is not None:
        extra(builder)
    return builder.glb()


def quad(**attributes: Any) -> tuple:
    return QUAD, QUAD_TRIANGLE, {"NORMAL": QUAD_NORMAL, **attributes}


def stacked(height: float) -> bytes:
    """Return a GLB of a floor, a unit cube on it, and a cube of side 0.5 whose bottom is at y = `height`."""
    small = 0.5 * CUBE + np.float32([0.25, height, 0.25])
    return scene((CUBE, CUBE_TRIANGLE), (FLOOR, [[0, 1, 2], [0, 2, 3]]), (small, CUBE_TRIANGLE))


def with_uv(uv: Any, position: Any = QUAD, triangle: Any = QUAD_TRIANGLE) -> bytes:
    """Return a GLB of one mesh with `uv` as TEXCOORD_1."""
    normal = np.float32(np.tile([0, 0, 1], (len(position), 1)))
    return scene((position, triangle, {"NORMAL": normal, "TEXCOORD_1": np.float32(uv)}))


def two_quads(uv: Any) -> bytes:
    """Return a GLB of one mesh: two unit squares that share no vertex, with `uv` (8, 2) as TEXCOORD_1."""
    position = np.concatenate([QUAD, QUAD + np.float32([3, 0, 0])])
    return with_uv(uv, position, np.concatenate([QUAD_TRIANGLE, QUAD_TRIANGLE + 4]))


def boxes(first: Any, second: Any) -> np.ndarray:
    """Return uv (8, 2): the corners of two boxes, each given as (u0, v0, u1, v1)."""
    return np.concatenate([np.array(b[:2]) + SQUARE * (np.array(b[2:]) - b[:2]) for b in (first, second)])


def point(intensity: float, at: Any = (0, 2, 0), **more: Any) -> tuple:
    return {"type": "point", "intensity": intensity, **more}, {"translation": list(at)}


def sun(turn: Any, intensity: float = 1000.0) -> tuple:
    """Return a directional light and its node with the rotation `turn`, a quaternion that rotates -Z."""
    return {"type": "directional", "intensity": intensity}, {"rotation": list(turn)}


def flattened(depth: float) -> tuple:
    """Return a directional light and its node. The node's scale is `depth` along the light's axis."""
    return {"type": "directional", "intensity": 1.0}, {"scale": [1, 1, depth], "rotation": list(DOWN)}


DOWN, UP = (-0.70710678, 0, 0, 0.70710678), (0.70710678, 0, 0, 0.70710678)


def floor(material: int = 0) -> tuple:
    return FLOOR, QUAD_TRIANGLE, {}, {}, material


def png(colour: int) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (2, 2), (colour,) * 3).save(out, "PNG")
    return out.getvalue()


def named(name: str) -> bytes:
    """Return a GLB of a square whose node has the given name."""

    def rename(builder: GltfBuilder) -> None:
        builder.json["nodes"][0]["name"] = name

    return scene(quad(), extra=rename)


def painted(grey: float) -> bytes:
    """Return a GLB of a square with vertex colours: one vertex has the level `grey`, the others are black."""
    colour = np.zeros((4, 3), np.float32)
    colour[2] = grey
    return scene(quad(COLOR_0=colour))


def dimmed(level: float) -> bytes:
    """Return a GLB of a square with a grey material. Its vertex colours have the given level."""
    return scene(quad(COLOR_0=np.full((4, 3), level, np.float32)))


def rounded_uv(levels: int) -> bytes:
    """Return a GLB of a grid whose TEXCOORD_1 is rounded to multiples of 1 / `levels`."""
    wavy = 0.05 + 0.9 * (GRID[:, :2] + 0.02 * np.sin(7 * GRID[:, 1::-1]))
    return with_uv(np.round(wavy * levels) / levels, GRID, GRID_TRIANGLE)


def facing(triangle: Any) -> bytes:
    """Return a GLB of a floor with the given triangles, and a light above it."""
    return scene((FLOOR, triangle), lights=(point(1),))


def two_meshes(first: Any, second: Any) -> bytes:
    """Return a GLB of two meshes, squares whose TEXCOORD_1 fill the boxes (u0, v0, u1, v1)."""
    uv = boxes(first, second)
    return scene(*(quad(TEXCOORD_1=np.float32(part)) for part in (uv[:4], uv[4:])))


def emissive(colour: int) -> bytes:
    """Return a GLB of a floor whose emissive texture has the 8-bit level `colour` everywhere."""

    def add(builder: GltfBuilder) -> None:
        texture = builder.image(png(colour))
        builder.json["materials"][0]["emissiveTexture"] = {"index": texture}

    uv = {"TEXCOORD_0": SQUARE}
    return scene((FLOOR, QUAD_TRIANGLE, uv), materials=({**GREY, "emissiveFactor": [1, 1, 1]},), extra=add)


def _nan(position: np.ndarray) -> np.ndarray:
    out = position.copy()
    out[0, 0] = np.nan
    return out


def _normal(factor: float) -> tuple:
    return QUAD, QUAD_TRIANGLE, {"NORMAL": np.float32(QUAD_NORMAL * factor)}


def _grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of an n x n grid over the unit square of the xy plane."""
    x, y = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    one = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    two = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    place = np.stack([x.reshape(-1) / n, y.reshape(-1) / n, np.zeros((n + 1) ** 2)], axis=1)
    return np.float32(place), np.concatenate([one, two])


def _box_of(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of a closed unit cube with n x n quads per side."""
    place, triangle = _grid(n)
    sides, faces = [], []
    for k, (axis, at) in enumerate((a, b) for a in range(3) for b in (0, 1)):
        turned = np.stack([np.full(len(place), float(at)), place[:, 0], place[:, 1]], axis=1)
        sides.append(np.roll(turned, axis, axis=1))
        faces.append((triangle if at else triangle[:, ::-1]) + k * len(place))
    return np.concatenate(sides), np.concatenate(faces)


def _fold() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, triangles and uv of a 2 x 2 grid. In uv, the middle vertex lies outside the grid."""
    place, triangle = _grid(2)
    uv = np.float32(place[:, :2] * 0.8 + 0.1)
    uv[4] = (0.95, 0.95)
    return place, triangle, uv


BOX, BOX_TRIANGLE = _box_of(4)
FOLD = _fold()
GRID, GRID_TRIANGLE = _grid(4)
FIN = np.concatenate([CUBE, np.float32([[-1, -1, 0]])])
FAR_CUBE = np.concatenate([CUBE, CUBE + np.float32([1, 1, 1])])
TWO_CUBES = np.concatenate([CUBE_TRIANGLE, CUBE_TRIANGLE + 8])
FLIPPED = GRID_TRIANGLE.copy()
FLIPPED[0] = FLIPPED[0, ::-1]
ROD, ROD_TRIANGLE = np.float32([[0, 0, 0], [1, 0, 0], [1, 0.019, 0]]), np.int64([[0, 1, 2]])
WIDE = np.float32([[0, 0, 0], [8, 0, 0], [8, 1, 0], [0, 1, 0]])
SMALL = np.float32(FLOOR * 0.5 + [0, 0.5, 0])
EMITTER = {**GREY, "emissiveFactor": [1, 1, 1]}
CEILING = np.float32(FLOOR[::-1] * 0.25 + [0, 2, 0])

CASES: dict[str, Case] = {
    "index-range": Case(scene((QUAD, [[0, 1, 2], [0, 2, 9]])), scene((QUAD, QUAD_TRIANGLE))),
    "bad-vertices": Case(scene((_nan(QUAD), [[0, 1, 2], [1, 2, 3]])), scene((QUAD, [[0, 1, 2], [1, 2, 3]]))),
    "zero-area": Case(scene((QUAD, [[0, 1, 2], [0, 2, 2]])), scene((QUAD, QUAD_TRIANGLE))),
    "sliver-faces": Case(scene((ROD, ROD_TRIANGLE)), scene((ROD * np.float32([1, 1.1, 1]), ROD_TRIANGLE))),
    "duplicate-faces": Case(scene((QUAD, [[0, 1, 2], [1, 2, 0]])), scene((QUAD, [[0, 1, 2], [1, 0, 2]]))),
    "no-triangles": Case(
        scene((QUAD, [[0, 0, 0]]), (QUAD, QUAD_TRIANGLE)), scene((QUAD, [[0, 1, 2]]), (QUAD, QUAD_TRIANGLE))
    ),
    "non-manifold-edges": Case(
        scene((FIN, np.concatenate([CUBE_TRIANGLE, [[0, 4, 8]]]))), scene((CUBE, CUBE_TRIANGLE))
    ),
    "non-manifold-vertices": Case(
        scene((FAR_CUBE, TWO_CUBES)),
        scene((np.concatenate([CUBE, CUBE + np.float32([1, 1, 1.5])]), TWO_CUBES)),
    ),
    "open-edges": Case(scene((BOX, BOX_TRIANGLE[:-1])), scene((BOX, BOX_TRIANGLE))),
    "flipped-neighbours": Case(scene((GRID, FLIPPED)), scene((GRID, GRID_TRIANGLE))),
    "inside-out": Case(scene((CUBE, CUBE_TRIANGLE[:, ::-1])), scene((CUBE, CUBE_TRIANGLE))),
    "flat-instance": Case(
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [1, 0, 1]}), floor()),
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [1, 0.5, 1]}), floor()),
    ),
    "negative-scale": Case(
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [-1, 1, 1]})),
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [1, 1, 1]})),
    ),
    "non-uniform-scale": Case(
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [1, 1.1, 1]})),
        scene((QUAD, QUAD_TRIANGLE, {}, {"scale": [1.1, 1.1, 1.1]})),
    ),
    "coarse-positions": Case(
        scene((FLOOR + np.float32([1e6, 0, 0]), QUAD_TRIANGLE)),
        scene((FLOOR, QUAD_TRIANGLE, {}, {"translation": [1e6, 0, 0]})),
    ),
    "scene-size": Case(scene((QUAD * 1e4, QUAD_TRIANGLE)), scene((QUAD * 1e3, QUAD_TRIANGLE))),
    "missing-normals": Case(scene((QUAD, QUAD_TRIANGLE)), scene(quad())),
    "bad-normals": Case(scene(_normal(0.0)), scene(_normal(1.0))),
    "normal-length": Case(scene(_normal(0.9)), scene(_normal(0.99))),
    "normals-against-faces": Case(scene(_normal(-1.0)), scene(_normal(1.0))),
    "duplicate-vertices": Case(
        scene((QUAD[[0, 1, 2, 0, 2, 3]], [[0, 1, 2], [3, 4, 5]])), scene((QUAD, QUAD_TRIANGLE))
    ),
    "enclosed-faces": Case(bad=stacked(1.0), good=stacked(1.01)),
    "self-intersection": Case(
        scene((np.concatenate([CUBE, CUBE * 0.5 + 0.75]), TWO_CUBES)),
        scene((np.concatenate([CUBE, CUBE * 0.5 + 1.0]), TWO_CUBES)),
    ),
    "coplanar-overlap": Case(
        scene(floor(), (FLOOR * 0.5, QUAD_TRIANGLE)), scene(floor(), (FLOOR[::-1] * 0.5, QUAD_TRIANGLE))
    ),
    "uv.missing": Case(scene(quad()), with_uv(SQUARE)),
    "uv.not_finite": Case(with_uv(np.where(SQUARE > 0, np.nan, 0)), with_uv(SQUARE)),
    "uv.out_of_range": Case(with_uv(SQUARE * 1.01), with_uv(SQUARE * 1.00001)),
    "uv.overlap": Case(
        two_quads(boxes((0, 0, 0.5, 0.5), (0.4, 0, 0.9, 0.5))),
        two_quads(boxes((0, 0, 0.4, 0.5), (0.5, 0, 0.9, 0.5))),
    ),
    "uv.degenerate": Case(
        two_quads(boxes((0, 0, 0.4, 0.4), (0.5, 0, 0.9, 0))),
        two_quads(boxes((0, 0, 0.4, 0.4), (0.5, 0, 0.9, 0.1))),
    ),
    "uv.flipped": Case(with_uv(FOLD[2], FOLD[0], FOLD[1]), with_uv(FOLD[0][:, :2] * 0.8, FOLD[0], FOLD[1])),
    "uv.mirrored": Case(
        two_quads(boxes((0, 0, 0.5, 0.5), (0.9, 0, 0.6, 0.3))),
        two_quads(boxes((0, 0, 0.5, 0.5), (0.6, 0, 0.9, 0.3))),
    ),
    "uv.tiny_chart": Case(
        two_quads(boxes((0, 0, 0.5, 0.5), (0.6, 0, 0.6019, 0.0019))),
        two_quads(boxes((0, 0, 0.5, 0.5), (0.6, 0, 0.6021, 0.0021))),
        {"resolution": 1024},
    ),
    "uv.padding": Case(
        two_quads(boxes((0, 0, 0.5, 0.5), (0.5, 0, 1, 0.5))),
        two_quads(boxes((0, 0, 0.46875, 0.5), (0.5, 0, 1, 0.5))),
        {"resolution": 64},
    ),
    "uv.padding_mip": Case(
        two_quads(boxes((0, 0, 0.46875, 0.5), (0.5, 0, 1, 0.5))),
        two_quads(boxes((0, 0, 0.4, 0.5), (0.5, 0, 1, 0.5))),
        {"resolution": 64},
    ),
    "uv.density": Case(
        two_quads(boxes((0, 0, 0.5, 0.5), (0.6, 0, 0.7, 0.1))),
        two_quads(boxes((0, 0, 0.5, 0.5), (0.6, 0, 0.8, 0.2))),
    ),
    "uv.stretch": Case(with_uv(SQUARE, WIDE), with_uv(SQUARE * np.float32([1, 0.3]), WIDE)),
    "uv.utilisation": Case(
        two_quads(boxes((0, 0, 0.1, 0.1), (0.9, 0.9, 1, 1))), two_quads(boxes((0, 0, 0.5, 1), (0.6, 0, 1, 1)))
    ),
    "uv.palette": Case(
        scene((GRID, GRID_TRIANGLE, {"TEXCOORD_0": np.full((len(GRID), 2), 0.3, np.float32)})),
        scene((GRID, GRID_TRIANGLE, {"TEXCOORD_0": GRID[:, :2].copy()})),
    ),
    "no-light": Case(scene(floor()), scene(floor(), lights=(point(1),))),
    "flat-light": Case(
        scene(floor(), lights=(sun(DOWN), flattened(0.0))),
        scene(floor(), lights=(sun(DOWN), flattened(1e-3))),
    ),
    "light-range": Case(
        scene(floor(), lights=(point(1, range=3.0),)), scene(floor(), lights=(point(1, range=4.0),))
    ),
    "light-inside": Case(
        scene((CUBE, CUBE_TRIANGLE), lights=(point(1, (0.5, 0.5, 0.5)),)),
        scene((CUBE, CUBE_TRIANGLE), lights=(point(1, (0.5, 1.5, 0.5)),)),
    ),
    "light-intensity": Case(scene(floor(), lights=(point(2e6),)), scene(floor(), lights=(point(1e5),))),
    "albedo": Case(
        scene(floor(), materials=({"pbrMetallicRoughness": {"baseColorFactor": [0.96, 0.5, 0.5, 1]}},)),
        scene(floor(), materials=({"pbrMetallicRoughness": {"baseColorFactor": [0.94, 0.5, 0.5, 1]}},)),
    ),
    "collision-hull": Case(named("UCX_Wall_01"), named("Wall_01")),
    "black-colours": Case(painted(0.0), painted(1.0)),
    "invisible": Case(
        scene(floor(), materials=({**GREY, "alphaMode": "MASK", "alphaCutoff": 1.5},)),
        scene(floor(), materials=({**GREY, "alphaMode": "MASK", "alphaCutoff": 0.5},)),
    ),
    "emissive-black": Case(emissive(0), emissive(1)),
    "sun-below": Case(scene(floor(), lights=(sun(UP),)), scene(floor(), lights=(sun(DOWN),))),
    "all-black": Case(
        scene(floor(), lights=(point(1, (0, -2, 0)),)), scene(floor(), lights=(point(1, (0, 2, 0)),))
    ),
    "clips-half": Case(
        scene(floor(), lights=(point(9e5),)), scene(floor(), lights=(point(2e5),)), {"seed": 1}
    ),
    "dark-colours": Case(dimmed(0.2), dimmed(0.4)),
    "daylight-levels": Case(scene(floor(), lights=(point(3e5),)), scene(floor(), lights=(point(3e4),))),
    "lit-from-behind": Case(facing(QUAD_TRIANGLE[:, ::-1]), facing(QUAD_TRIANGLE)),
    "uv.precision": Case(rounded_uv(255), rounded_uv(4095), {"resolution": 1024}),
    "uv.shared": Case(
        two_meshes((0, 0, 0.5, 0.5), (0.4, 0, 0.9, 0.5)), two_meshes((0, 0, 0.4, 0.5), (0.5, 0, 0.9, 0.5))
    ),
    "light-levels": Case(scene(floor(), lights=(point(1),)), scene(floor())),
    "emitter-unseen": Case(
        scene(floor(), (CEILING[::-1], QUAD_TRIANGLE, {}, {}, 1), materials=(GREY, EMITTER)),
        scene(floor(), (CEILING, QUAD_TRIANGLE, {}, {}, 1), materials=(GREY, EMITTER)),
    ),
    "cost": Case(scene(floor()), scene((FLOOR, [[0, 0, 0]]))),
    "file-note": Case(
        scene(floor(), extra=lambda builder: builder.json.update(extensionsUsed=["ACME_x"])), scene(floor())
    ),
}
