"""Makes the gallery of estimators and the table of their variance at equal rays, for docs/THEORY.md.

    python docs/make_estimators.py             makes pictures and table; --table makes only the table

All pictures of one image file have the same tone mapping: L / (L + M), followed by the sRGB curve. M is the
luminance that a fifth of the pixels of the last picture exceed.

"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from baker.core.scene import Camera, Instance, Material, Mesh, Scene
from baker.io.png import srgb_levels
from baker.pathtracer.camera import look_at
from baker.pathtracer.estimators import ESTIMATORS, PassOptions
from baker.pathtracer.point_estimate import PointEstimate, new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 240, 180
TABLE_WIDTH, TABLE_HEIGHT, TABLE_PASSES, SAMPLES = 64, 48, 32, 4
Point = tuple[float, float, float]


@dataclass(frozen=True)
class View:
    """A scene with a camera and a sky."""

    title: str
    scene: Scene
    camera: Camera
    sky: Point = (0.0, 0.0, 0.0)


def surface(base: float | Point, metallic: float = 0.0, roughness: float = 1.0, **more: Any) -> Material:
    """Return a material with base colour `base`; one number gives grey."""
    colour = (base, base, base) if isinstance(base, float) else base
    return Material(base_colour=(*colour, 1.0), metallic=metallic, roughness=roughness, **more)


def emitter(radiance: float) -> Material:
    """Return a black material that emits."""
    return surface(0.0, emission=(radiance,) * 3)


def quad(corner: Point, u: Point, v: Point) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return corners (6, 3) and normals of a rectangle whose front is towards u x v."""
    c, a, b = np.array(corner, float), np.array(u, float), np.array(v, float)
    normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
    return np.array([c, c + a, c + a + b, c, c + a + b, c + b]), np.tile(normal, (6, 1))


def turned(radius: float, low: float, high: float, n: int, *, inward: bool) -> tuple[Any, Any]:
    """Return corners (6 n, 3) and smooth normals of a tube about the z axis; fronts inside or outside."""
    angle = 2 * np.pi * np.arange(n + 1) / n
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corner, normal = [], []
    for a, b in pairwise(ring):
        order = [(a, low), (b, low), (b, high), (a, low), (b, high), (a, high)]
        for way, z in order if not inward else order[::-1]:
            corner.append(way * radius + (0, 0, z))
            normal.append(-way if inward else way)
    return np.array(corner), np.array(normal)


def ball(centre: Point, radius: float, n: int = 16) -> tuple[Any, Any]:
    """Return corners and smooth normals of a sphere of 2 n x n faces."""
    polar = np.linspace(0, np.pi, n + 1)
    around = 2 * np.pi * np.arange(2 * n + 1) / (2 * n)
    grid = np.stack(
        [np.outer(np.sin(polar), np.cos(around)), np.outer(np.sin(polar), np.sin(around)),
         np.outer(np.cos(polar), np.ones(2 * n + 1))], axis=-1,
    )  # fmt: skip
    normal = []
    for i in range(n):
        for j in range(2 * n):
            a, b, c, d = grid[i, j], grid[i + 1, j], grid[i + 1, j + 1], grid[i, j + 1]
            normal += [a, b, c] if i == 0 else [a, b, d] if i == n - 1 else [a, b, c, a, c, d]
    unit = np.array(normal)
    return np.array(centre) + radius * unit, unit


def scene_of(*parts: tuple[tuple[Any, Any], Material]) -> Scene:
    """Return a scene of unindexed triangles, one mesh for each part."""
    meshes, instances = [], []
    for k, ((corner, normal), _) in enumerate(parts):
        n = len(corner)
        zero = np.zeros(n // 3, np.int32)
        meshes.append(
            Mesh(
                f"part {k}", np.float32(corner), np.float32(normal),
                np.arange(n, dtype=np.int32).reshape(-1, 3), zero + np.int32(k), zero,
                np.zeros(n, np.int32), np.arange(n, dtype=np.int32),
            )
        )  # fmt: skip
        instances.append(Instance(k, f"part {k}", k, np.eye(4)))
    return Scene("gallery", None, tuple(meshes), tuple(m for _, m in parts), tuple(instances))


def plates() -> View:
    """Return four lights of equal power over four plates, after Veach and Guibas 1995."""
    eye, middle = np.array([0.0, -8.0, 2.2]), np.array([0.0, 1.6, 3.0])
    parts = [
        (quad((-8, -5, -1.2), (16, 0, 0), (0, 9, 0)), surface(0.3)),
        (quad((-8, 3.5, -1.2), (16, 0, 0), (0, 0, 9)), surface(0.3)),
    ]
    for x, radius in zip((-3.2, -1.3, 0.6, 2.9), (0.04, 0.13, 0.35, 0.9), strict=True):
        parts.append((ball((x, 1.6, 3.0), radius), emitter(6.0 / radius**2)))
    for k, roughness in enumerate((0.08, 0.16, 0.26, 0.4)):
        centre = np.array([0.0, 0.9 - 1.1 * k, 0.75 - 0.42 * k])
        to_eye, to_light = eye - centre, middle - centre
        normal = to_eye / np.linalg.norm(to_eye) + to_light / np.linalg.norm(to_light)
        across = np.cross(normal / np.linalg.norm(normal), (1.0, 0.0, 0.0)) * 0.9
        corner = centre - (3.6, 0, 0) - 0.5 * across
        parts.append((quad(tuple(corner), (7.2, 0, 0), tuple(across)), surface(0.9, 1.0, roughness)))
    camera = look_at(tuple(eye), (0.0, 0.0, 0.7), 33.0)
    return View("plates", scene_of(*parts), upright(camera, eye, (0.0, 0.0, 0.9)))


def gap() -> View:
    """Return two rooms joined by a gap: one with an emitter that shines at the ceiling, one without light."""
    wall, both = surface(0.7), surface(0.7, double_sided=True)
    parts = [
        (quad((0, 0, 0), (4, 0, 0), (0, 2, 0)), surface((0.7, 0.5, 0.3))),
        (quad((0, 0, 2), (0, 2, 0), (4, 0, 0)), wall),
        (quad((0, 0, 0), (0, 2, 0), (0, 0, 2)), wall),
        (quad((4, 0, 0), (0, 0, 2), (0, 2, 0)), wall),
        (quad((0, 0, 0), (0, 0, 2), (4, 0, 0)), surface((0.3, 0.5, 0.7))),
        (quad((0, 2, 0), (4, 0, 0), (0, 0, 2)), wall),
        (quad((2, 0, 0), (0, 0.9, 0), (0, 0, 2)), both),
        (quad((2, 1.1, 0), (0, 0.9, 0), (0, 0, 2)), both),
        (quad((1.3, 0.8, 1.9), (0.3, 0, 0), (0, 0.3, 0)), emitter(60.0)),
        (ball((2.9, 1.3, 0.3), 0.3), surface(0.8, 1.0, 0.25)),
    ]
    eye = np.array([3.9, 0.25, 1.2])
    return View(
        "gap", scene_of(*parts), upright(look_at(tuple(eye), (2.4, 1.1, 0.7), 65.0), eye, (2.4, 1.1, 0.7))
    )


def caustic() -> View:
    """Return a metal ring on a table under a small light."""
    parts = [
        (quad((-3, -3, 0), (6, 0, 0), (0, 6, 0)), surface(0.7)),
        (turned(1.0, 0.0, 0.7, 96, inward=True), surface((0.95, 0.85, 0.6), 1.0, 0.0)),
        (turned(1.03, 0.0, 0.7, 96, inward=False), surface((0.95, 0.85, 0.6), 1.0, 0.3)),
        (quad((1.5, -0.06, 1.6), (0, 0.12, 0), (0.07, 0, -0.1)), emitter(300.0)),
    ]
    eye = np.array([-0.4, -2.6, 3.0])
    return View(
        "caustic", scene_of(*parts), upright(look_at(tuple(eye), (0, 0, 0.1), 42.0), eye, (0, 0, 0.1))
    )


def yard() -> View:
    """Return a wall and two balls on a floor under an open sky."""
    parts = [
        (quad((-4, -4, 0), (8, 0, 0), (0, 8, 0)), surface(0.5)),
        (quad((-1.4, 1, 0), (2.8, 0, 0), (0, 0, 1.6)), surface((0.7, 0.4, 0.3), double_sided=True)),
        (ball((-0.7, 0.1, 0.5), 0.5), surface(0.8)),
        (ball((0.6, -0.2, 0.4), 0.4), surface((0.9, 0.8, 0.5), 1.0, 0.5)),
    ]
    eye = np.array([0.3, -3.4, 1.7])
    camera = upright(look_at(tuple(eye), (0, 0.2, 0.5), 45.0), eye, (0, 0.2, 0.5))
    return View("sky", scene_of(*parts), camera, (0.9, 1.0, 1.2))


def upright(camera: Camera, eye: Any, target: Any) -> Camera:
    """Rotate a camera about its axis so that +Z is up, as in these scenes; `look_at` uses +Y."""
    forward = np.array(target) - eye
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    return replace(camera, right=tuple(right), up=tuple(up), forward=tuple(forward))


def render(view: View, name: str, *, width: int, height: int, passes: int, rays: int = 0) -> PointEstimate:
    """Render passes of `SAMPLES` paths a pixel: `passes` of them, or about `rays` rays if that is not 0."""
    with build_reference(view.scene, sky=view.sky) as reference:
        estimate = new_estimate(width * height, 3, SAMPLES)
        while estimate.rounds < 2 or (
            estimate.rays * (1 + 0.5 / estimate.rounds) < rays if rays else estimate.rounds < passes
        ):
            radiance_pass(reference, estimate, view.camera, width, height, options=PassOptions(name))
    return estimate


def save(name: str, rows: list[list[PointEstimate]]) -> None:
    """Write one image of a grid of pictures, given as rows, all with the same tone mapping."""
    luminance = np.array((0.2126, 0.7152, 0.0722))
    middle = float(np.quantile(rows[-1][-1].mean @ luminance, 0.8))
    shape = (HEIGHT, WIDTH, 3)
    lines = []
    for row in rows:
        shown = []
        for estimate in row:
            value = estimate.mean.reshape(shape)
            bright = value @ luminance
            shown.append(np.minimum(value / (bright + middle)[..., None], 1.0))
        lines.append(np.concatenate(shown, axis=1))
    levels = srgb_levels(np.concatenate(lines).astype(np.float32))
    # Noise compresses badly, so 64 colours keep the file small.
    image = Image.fromarray(levels).quantize(64, dither=Image.Dither.NONE)
    image.save(HERE / "pictures" / f"{name}.png", optimize=True)


def pictures() -> None:
    """Render and write the pictures of docs/THEORY.md."""
    size: dict[str, Any] = {"width": WIDTH, "height": HEIGHT}
    parts = [render(plates(), name, passes=4, **size) for name in ("light", "bsdf", "mis", "mis-power")]
    save("estimators_plates", [parts[:2], parts[2:]])
    for view, passes in ((gap(), 12), (caustic(), 12)):
        both = render(view, "bdpt", passes=passes, **size)
        save(f"estimators_{view.title}", [[render(view, "mis", passes=0, rays=both.rays, **size), both]])
    flat = yard()
    save("estimators_sky", [[render(flat, n, passes=2, **size) for n in ("uniform", "cosine", "stratified")]])


def table() -> str:
    """Return the Markdown table of variance at equal numbers of rays, as multiples of that of `mis`.

    If the variances of even and odd passes differ by more than a factor of two, the cell is "too rare": most
    of the variance comes from events that are too rare to measure.
    """
    views = [plates(), gap(), caustic(), yard()]
    cost: dict[str, list[float]] = {name: [] for name in ESTIMATORS}
    for view in views:
        size: dict[str, Any] = {"width": TABLE_WIDTH, "height": TABLE_HEIGHT, "passes": TABLE_PASSES}
        found = {name: render(view, name, **size) for name in ESTIMATORS}
        mean = found["bdpt"].mean
        scale = mean**2 + (0.01 * mean.mean()) ** 2
        for name, estimate in found.items():
            own = float((estimate.standard_error**2 / scale).mean()) * estimate.rays
            count = estimate.count[:, :, None]
            spread = estimate.squares / count - (estimate.total / count) ** 2
            even, odd = (spread / scale).mean(axis=(1, 2))
            cost[name].append(own if 0.5 < even / odd < 2.0 else np.nan)
    # If `mis` is too rare in a scene, the unit of its column is `bdpt`.
    best = [a if np.isfinite(a) else b for a, b in zip(cost["mis"], cost["bdpt"], strict=True)]
    lines = [
        "| estimator | " + " | ".join(view.title for view in views) + " |",
        "|---|" + "---:|" * len(views),
    ]
    for name, costs in cost.items():
        cells = [
            "too rare" if np.isnan(own) else f"{own / base:.2g}"
            for own, base in zip(costs, best, strict=True)
        ]
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Write the table into docs/THEORY.md and, without --table, the pictures."""
    page = HERE / "THEORY.md"
    begin, end = "<!-- table by make_estimators.py -->", "<!-- end of table -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise SystemExit(f"{page} has no lines '{begin}' and '{end}' to put the table between")
    page.write_text(f"{before}{begin}\n\n{table()}\n\n{end}{after}", encoding="utf-8")
    if "--table" not in sys.argv:
        pictures()


if __name__ == "__main__":
    main()
