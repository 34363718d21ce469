"""Draws the pictures of CHECKS.md from scenes of the tests.

The left half of a picture shows a scene with the flaw that the check finds, the right half a similar scene
without it.

python docs/make_check_pictures.py

Lightmap uv is drawn in page coordinates. Geometry is drawn in parallel projection, seen obliquely from above,
from the side of positive x and z. Fronts are grey and backs are red.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent / "tests" / "unit" / "checks")]

from flawed_scenes import CASES  # noqa: E402

from baker.checks.context import CheckContext  # noqa: E402
from baker.core.settings import BakeSettings  # noqa: E402
from baker.io.importers.gltf import import_gltf  # noqa: E402
from baker.io.load import SceneFile  # noqa: E402

SIZE, BORDER, SHARP = 180, 12, 3
UV_CODES = (
    "uv.overlap", "uv.out_of_range", "uv.flipped", "uv.mirrored", "uv.padding", "uv.density",
    "uv.utilisation", "uv.degenerate",
)  # fmt: skip
GEOMETRY_CODES = ("open-edges", "flipped-neighbours", "inside-out", "non-manifold-edges")
FRONT, BACK, LINE, PAPER = (205, 208, 214), (222, 96, 86), (60, 64, 72), (255, 255, 255)


def subject_of(data: bytes) -> CheckContext:
    """Return the check context of a scene, from the bytes of its GLB."""
    return CheckContext(
        import_gltf(SceneFile(Path("case.glb"), data, lenient=True)), BakeSettings(resolution=256)
    )


def uv_panel(context: CheckContext) -> Image.Image:
    """Draw the lightmap uv of the first mesh; overlaps are red."""
    side = SIZE * SHARP
    image = Image.new("RGB", (side, side), PAPER)
    uv = context.uv(0)
    scale = (side - 2 * BORDER * SHARP) / 1.05
    corner = uv.uv * scale + BORDER * SHARP
    count = np.zeros((side, side), np.uint8)
    for triangle in corner:
        mask = Image.new("L", (side, side))
        ImageDraw.Draw(mask).polygon([tuple(p) for p in triangle], fill=1)
        count += np.asarray(mask)
    twice = np.asarray(
        Image.fromarray(np.uint8(count > 1) * 255).resize((side // 4, side // 4)).resize((side, side))
    )
    pixels = np.asarray(image).copy()
    pixels[count > 0] = FRONT
    # Shared edges of triangles are also covered twice, but are removed by the reduced resolution of `twice`.
    pixels[(count > 1) & (twice > 200)] = BACK
    image = Image.fromarray(pixels)
    draw = ImageDraw.Draw(image)
    low, high = BORDER * SHARP, BORDER * SHARP + scale
    draw.rectangle([low, low, high, high], outline=LINE, width=2)
    for triangle in corner:
        draw.line([tuple(p) for p in (*triangle, triangle[0])], fill=LINE, width=3)
    return image.resize((SIZE, SIZE), Image.Resampling.LANCZOS)


def geometry_panel(context: CheckContext, low: np.ndarray, high: np.ndarray) -> Image.Image:
    """Draw all triangles, farthest first, in the parallel projection of `view_axes`."""
    side = SIZE * SHARP
    image = Image.new("RGB", (side, side), PAPER)
    draw = ImageDraw.Draw(image)
    world = context.world
    corner = world.position[world.triangle].astype(np.float64)
    view, right, up = view_axes()
    order = np.argsort(corner.mean(axis=1) @ view)
    flat = np.stack([corner @ right, -(corner @ up)], axis=-1)
    scale = (side - 2 * BORDER * SHARP) / float((high - low).max())
    flat = (flat - 0.5 * (low + high)) * scale + side / 2
    for k in order:
        facing = float(world.normal[k] @ view)
        base = np.array(FRONT if facing > 0 else BACK)
        shade = 0.72 + 0.28 * abs(world.normal[k] @ np.array([0.3, 0.9, 0.3]))
        colour = tuple(int(v) for v in np.clip(base * shade, 0, 255))
        draw.polygon([tuple(p) for p in flat[k]], fill=colour)
        draw.line([tuple(p) for p in (*flat[k], flat[k][0])], fill=LINE, width=2)
    return image.resize((SIZE, SIZE), Image.Resampling.LANCZOS)


def view_axes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three unit vectors in world space: to the viewer, to the right and upwards in the picture."""
    view = np.array([0.75, 0.6, 0.9])
    view /= np.linalg.norm(view)
    right = np.cross([0.0, 1.0, 0.0], view)
    right /= np.linalg.norm(right)
    return view, right, np.cross(view, right)


def main() -> None:
    """Write a picture for each code of `UV_CODES` and `GEOMETRY_CODES`."""
    folder = HERE / "pictures" / "checks"
    folder.mkdir(parents=True, exist_ok=True)
    for code in (*UV_CODES, *GEOMETRY_CODES):
        bad, good = (subject_of(data) for data in (CASES[code].bad, CASES[code].good))
        if code in UV_CODES:
            panels = [uv_panel(bad), uv_panel(good)]
        else:
            _, right, up = view_axes()
            all_points = np.concatenate([s.world.position for s in (bad, good)]).astype(np.float64)
            flat = np.stack([all_points @ right, -(all_points @ up)], axis=1)
            panels = [geometry_panel(s, flat.min(axis=0), flat.max(axis=0)) for s in (bad, good)]
        sheet = Image.new("RGB", (2 * SIZE, SIZE), PAPER)
        for k, panel in enumerate(panels):
            sheet.paste(panel, (k * SIZE, 0))
        sheet.quantize(32).save(folder / f"{code}.png", optimize=True)


if __name__ == "__main__":
    main()
