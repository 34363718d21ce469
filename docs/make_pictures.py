"""Makes the pictures of the docs: bakes the project's scenes and renders them through their cameras.

    python docs/make_pictures.py            needs only the dependencies of baker

A pixel shows albedo * E / pi (what an engine draws for a diffuse surface), exposed so that the median of
the lit pixels is 0.25, then sRGB-encoded.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from PIL import Image

import baker
from baker.core.geometry import world_geometry
from baker.core.lightmap import BakeResult
from baker.core.progress import silent
from baker.radiosity.texels import build_texels
from baker.shading.materials import resolve_materials

HERE = Path(__file__).resolve().parent
SCENES = HERE.parent / "assets"
# {name: (file, settings)}; the camera is the first camera of the file.
VIEWS = {
    "cornell": ("cornell.glb", {"quality": "high", "resolution": 1024}),
    "interior": ("interior.glb", {"quality": "high", "resolution": 1024}),
    "hall": ("hall.glb", {"quality": "high", "resolution": 2048, "sky": "0.6,0.8,1.2"}),
}
WIDTH, HEIGHT, SAMPLES = 960, 720, 4


def camera_rays(camera, shift):
    """Return (HEIGHT * WIDTH, 3) directions of a pinhole camera through points `shift` (0..1) of pixels."""
    tall = np.tan(camera.fov / 2)
    x = ((np.arange(WIDTH) + shift[0]) / WIDTH * 2 - 1) * tall * WIDTH / HEIGHT
    y = (1 - (np.arange(HEIGHT) + shift[1]) / HEIGHT * 2) * tall
    right, up = np.array(camera.right), np.array(camera.up)
    direction = np.array(camera.forward) + x[None, :, None] * right + y[:, None, None] * up
    return (direction / np.linalg.norm(direction, axis=-1, keepdims=True)).reshape(-1, 3)


def bilinear(image, uv):
    """Return the (n, C) bilinear lookups of an (H, W, C) page at uv (n, 2), as an engine computes them."""
    size = image.shape[0]
    x = np.clip(uv * size - 0.5, 0, size - 1.001)
    low = x.astype(int)
    part = x - low
    total = 0.0
    for down in (0, 1):
        for right in (0, 1):
            weight = np.where(right, part[:, 0], 1 - part[:, 0]) * np.where(down, part[:, 1], 1 - part[:, 1])
            total = total + weight[:, None] * image[low[:, 1] + down, low[:, 0] + right]
    return total


def draw(result: BakeResult, channel="irradiance") -> np.ndarray:
    """Return a linear (HEIGHT, WIDTH, 3) picture of a bake through the file's first camera."""
    camera = result.scene.cameras[0]
    geometry = world_geometry(result.scene, result.atlas)
    shading = resolve_materials(result.scene, geometry)
    texels, _ = build_texels(geometry, shading, result.atlas, seed=0, threads=1, progress=silent)
    albedo = texels.hit_image(texels.albedo).reshape(-1, 3)
    size = result.atlas.resolution
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, geometry.position, geometry.triangle)
    total = np.zeros((WIDTH * HEIGHT, 3))
    for shift in np.random.default_rng(0).random((SAMPLES, 2)):
        direction = camera_rays(camera, shift).astype(np.float32)
        origin = np.tile(np.array(camera.position, np.float32), (len(direction), 1))
        hit = scene.run(origin, direction, output=True)
        on = hit["primID"] >= 0
        prim, u, v = hit["primID"][on], hit["u"][on], hit["v"][on]
        corner = geometry.uv[geometry.triangle[prim]].astype(float)
        uv = corner[:, 0] * (1 - u - v)[:, None] + corner[:, 1] * u[:, None] + corner[:, 2] * v[:, None]
        page = geometry.page[prim]
        light = np.zeros((len(prim), 3))
        for number in np.unique(page):
            here = page == number
            light[here] = bilinear(result.lightmaps[channel].value[number], uv[here])
        if channel == "irradiance":
            texel = np.minimum((uv * size).astype(int), size - 1)
            pixel = (page * size + texel[:, 1]) * size + texel[:, 0]
            light = light * albedo[pixel] / np.pi + shading.emission[geometry.material[prim]]
            away = (geometry.face_normal[prim] * direction[on]).sum(axis=1) > 0
            light[away & ~geometry.double_sided[prim]] = 0
        total[on] += light / SAMPLES
    return total.reshape(HEIGHT, WIDTH, 3)


def encode(linear: np.ndarray, exposure: float) -> Image.Image:
    """Expose, clip and sRGB-encode a linear picture."""
    value = np.clip(linear * exposure, 0, 1)
    srgb = np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055)
    return Image.fromarray((srgb * 255 + 0.5).astype(np.uint8))


def main(names: list[str]) -> None:
    """Draw the named views; all views if no name is given."""
    folder = HERE / "pictures"
    folder.mkdir(exist_ok=True)
    for name in names or list(VIEWS):
        file, settings = VIEWS[name]
        result = baker.bake(SCENES / file, **settings)
        picture = draw(result)
        lit = picture.mean(axis=2)
        encode(picture, 0.25 / np.median(lit[lit > 0])).save(folder / f"{name}.png", optimize=True)
        encode(draw(result, "ao"), 1.0).save(folder / f"{name}_ao.png", optimize=True)
        page = result.lightmaps["irradiance"].value[0]
        bright = page.mean(axis=2)
        atlas = encode(page, 0.25 / np.median(bright[bright > 0]))
        atlas.resize((512, 512), Image.Resampling.BOX).save(folder / f"{name}_atlas.png", optimize=True)
        sys.stdout.write(f"{name}: {sum(result.timings.values()):.1f} s\n")


if __name__ == "__main__":
    main(sys.argv[1:])
