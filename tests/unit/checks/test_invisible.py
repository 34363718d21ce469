"""The code `invisible`: reported for objects with alpha 0 everywhere, not for partly visible objects."""

from __future__ import annotations

import io

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write
from PIL import Image

from baker.checks.in_bake import bake_warnings
from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.settings import BakeSettings
from baker.io.load import load_scene

UV = QUAD[:, :2].copy()


def png(alpha):
    pixels = np.full((*np.shape(alpha), 4), 255, np.uint8)
    pixels[..., 3] = alpha
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def cells(*alpha):
    """Return a PNG of blocks of 8 x 8 texels, side by side, with one value of `alpha` for each block."""
    return png(np.repeat(np.uint8([alpha] * 8), 8, axis=1))


def quad(builder, material, *, uv=UV, height=0.0, **attributes):
    return builder.primitive(
        QUAD + np.float32([0, 0, height]),
        QUAD_TRIANGLE,
        NORMAL=QUAD_NORMAL,
        TEXCOORD_0=np.float32(uv),
        material=material,
        **attributes,
    )


def found(tmp_path, builder):
    """Return the objects reported as `invisible`, after asserting that bake and check report the same."""
    path = write(tmp_path / "a.glb", builder)
    baked = [w for w in bake_warnings(load_scene(path), BakeSettings()) if w.code == "invisible"]
    checked = [
        f for f in check_scene(path, CheckSettings(), BakeSettings()).findings if f.code == "invisible"
    ]
    assert [w.object for w in baked] == [f.object for f in checked]
    assert all("'pane'" in w.message and "alpha" in w.message for w in baked)
    assert all(f.severity == "warning" and f.fix for f in checked)
    return [w.object for w in baked]


def one(mode, factor=1.0, image=None, *, uv=UV, wrap=10497, cutoff=None, **attributes):
    builder = GltfBuilder()
    surface = {"baseColorFactor": [1, 1, 1, factor]}
    if image is not None:
        builder.json["samplers"] = [{"wrapS": wrap, "wrapT": wrap}]
        surface["baseColorTexture"] = {"index": builder.image(image, sampler=0)}
    material = {"name": "pane", "alphaMode": mode, "pbrMetallicRoughness": surface}
    if cutoff is not None:
        material["alphaCutoff"] = cutoff
    number = builder.add("materials", material)
    builder.node(mesh=builder.mesh(quad(builder, number, uv=uv, **attributes)), name="window")
    return builder


def vertex(*alpha):
    return {"COLOR_0": np.float32([[1, 1, 1, a] for a in alpha])}


CELL = UV * np.float32([0.1, 1]) + np.float32([0.3, 0])  # within the second of the four blocks of `cells`
GONE = {
    "BLEND, factor 0": one("BLEND", 0.0),
    "MASK, factor below the cutoff": one("MASK", 0.49),
    "MASK, factor below a cutoff that the file sets": one("MASK", 0.7, cutoff=0.8),
    "MASK, cutoff above 1": one("MASK", cutoff=1.5),
    "BLEND, texture of alpha 0": one("BLEND", image=png(np.zeros((4, 4)))),
    "MASK, texture below the cutoff": one("MASK", image=png(np.full((4, 4), 127))),
    "MASK, factor times texture below the cutoff": one("MASK", 0.7, image=png(np.full((4, 4), 180))),
    "MASK, factor times texture times vertex alpha below the cutoff": one(
        "MASK", 0.9, image=png(np.full((4, 4), 180)), **vertex(0.7, 0.7, 0.6, 0.7)
    ),
    "BLEND, vertex alpha 0": one("BLEND", **vertex(0, 0, 0, 0)),
    "BLEND, uv in a transparent block": one("BLEND", image=cells(255, 0, 255, 255), uv=CELL),
    "MASK, uv in a transparent block, repeated": one(
        "MASK", image=cells(255, 9, 255, 255), uv=CELL + np.float32([3, 0])
    ),
    "MASK, uv in a transparent block, mirrored": one(
        "MASK", image=cells(255, 255, 0, 255), uv=CELL + np.float32([1, 0]), wrap=33648
    ),
    "BLEND, uv clamped to a transparent border": one(
        "BLEND", image=cells(255, 255, 255, 0), uv=UV + np.float32([2, 0]), wrap=33071
    ),
}
SEEN = {
    "OPAQUE, alpha is ignored": one("OPAQUE", 0.0),
    "BLEND, factor 0.01": one("BLEND", 0.01),
    "MASK, factor at the cutoff": one("MASK", 0.5),
    "MASK, cutoff 0": one("MASK", 0.0, cutoff=0.0),
    "MASK, texture at the cutoff": one("MASK", image=png(np.full((4, 4), 128))),
    "BLEND, texture with one opaque texel": one(
        "BLEND", image=png(np.eye(1, 64 * 64, 2019).reshape(64, 64) * 255)
    ),
    "MASK, one opaque vertex": one("MASK", **vertex(0, 0, 0, 1)),
    "BLEND, uv in an opaque block": one("BLEND", image=cells(0, 255, 0, 0), uv=CELL),
    "BLEND, uv in an opaque block, mirrored": one(
        "BLEND", image=cells(0, 0, 255, 0), uv=CELL + np.float32([1, 0]), wrap=33648
    ),
    "BLEND, uv clamped to an opaque border": one(
        "BLEND", image=cells(0, 0, 0, 255), uv=UV + np.float32([2, 0]), wrap=33071
    ),
}


@pytest.mark.parametrize("name", sorted(GONE))
def test_an_object_of_which_nothing_is_there_is_named(tmp_path, name):
    assert found(tmp_path, GONE[name]) == ["window"]


@pytest.mark.parametrize("name", sorted(SEEN))
def test_an_object_that_can_be_seen_is_left_alone(tmp_path, name):
    assert found(tmp_path, SEEN[name]) == []


def test_one_visible_primitive_is_enough(tmp_path):
    builder = one("BLEND", 0.0)
    solid = builder.add("materials", {"name": "frame"})
    builder.json["meshes"][0]["primitives"].append(quad(builder, solid, height=1.0))
    assert found(tmp_path, builder) == []
    builder.json["materials"][solid] = {"name": "frame", "alphaMode": "MASK", "alphaCutoff": 2}
    assert found(tmp_path, builder) == ["window"]


def test_the_dialects_of_mtl(tmp_path):
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\no box\nusemtl m\nf 1 2 3\n")
    for line, alpha in {
        "Tr 1": 0.0,
        "d 0": 0.0,
        "d 1\nTr 1": 1.0,
        "Tr 1\nd 1": 1.0,
        "d 1\nTr 0": 1.0,
        "Tr 0": 1.0,
        "d -halo 0": 0.0,
        "": 1.0,
    }.items():
        (tmp_path / "a.mtl").write_text(f"newmtl m\nKd 1 1 1\n{line}\n")
        scene = load_scene(tmp_path / "a.obj")
        named = [w.object for w in bake_warnings(scene, BakeSettings()) if w.code == "invisible"]
        assert scene.materials[0].base_colour[3] == alpha, line
        assert named == (["box"] if alpha == 0.0 else []), line
