"""Runs the script for Unreal Engine in a stand-in for the editor (`fake_unreal_editor.py`)."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from engine_scenes import ALBEDO, MIDDLE, SIZE, probe_expected, write_made_up, write_probe
from fake_unreal import DialogError, StaticMesh, shown
from fake_unreal_editor import Editor
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder
from shared_probe import FIELD, SQUARES, write_shared_probe

from baker.exporters.unreal_scene import actor_transform
from baker.io.load import load_scene
from baker.io.png import encode_png

NAME = "wall_north_side_n1"


@pytest.fixture(scope="module")
def probe(tmp_path_factory):
    return write_probe(tmp_path_factory.mktemp("unreal"), "unreal") / "unreal"


def slots(editor, name=NAME):
    """Return the material instances of an object in the open level."""
    (actor,) = (a for a in editor.here() if a.label == name)
    component = actor.values["static_mesh_component"]
    mesh = component.values["static_mesh"]
    assert mesh.uv_1_of_file
    assert mesh.precise
    own = [slot.values["material_interface"] for slot in mesh.values["static_materials"]]
    return [component.materials.get(number, material) for number, material in enumerate(own)]


def picture(editor):
    """Return the (4, 3) colours of the probe at the points `MIDDLE`. TEXCOORD_0 is the same at all points."""
    (instance,) = slots(editor)
    return np.array([shown(instance, [(0.3, 0.3), (u, v)])[0] for v, u in MIDDLE])


def changed(folder, target, old, new, file="import_lightmaps.py"):
    """Return the script of a copy of an export in which a text of a file is replaced."""
    shutil.copytree(folder, target)
    text = (target / file).read_text("utf-8")
    assert old in text
    (target / file).write_text(text.replace(old, new), "utf-8")
    return target / "import_lightmaps.py"


@pytest.mark.parametrize("old", [False, True])
def test_probe(probe, old):
    editor = Editor(old=old)
    editor.run(probe / "import_lightmaps.py")
    assert picture(editor) == pytest.approx(probe_expected(), rel=1e-3)
    assert editor.lines == [
        "Baker: 2 of 2 objects are in the level; 0 old objects were removed. "
        "The assets are in /Game/Baker/Maps/Castle."
    ]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"Page", page, 1)', '"Page", page, 0)'),
        ("const_b=1.0 / math.pi", "const_b=1.0"),
        ('entry["uv_scale"] + entry["uv_offset"]', "[1.0, -1.0, 0.0, 1.0]"),
        ('"A": (rectangle, "B"), "B": (rectangle, "A")', '"A": (rectangle, "R"), "B": (rectangle, "A")'),
        ('"A": light, "B": colour', '"A": light'),
        ('"srgb": False', '"srgb": True'),
    ],
)
def test_wrong_exports_are_seen(probe, tmp_path, old, new):
    """UV channel 0, no 1 / pi, v upwards, a wrong offset, no albedo, pages decoded as sRGB."""
    editor = Editor()
    editor.run(changed(probe, tmp_path / "wrong", old, new))
    assert picture(editor) != pytest.approx(probe_expected(), rel=0.01)


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ('"UVs": placed', '"Coordinates": placed', RuntimeError),
        ('(rectangle, "B"), "B"', '(rectangle, "Blue"), "B"', RuntimeError),
        ("automated=True", "automated=False", DialogError),
        ("bake_meshes=False", "bake_meshes=True", AssertionError),
        ("types.SAMPLERTYPE_COLOR if srgb", "types.SAMPLERTYPE_COLOR if not srgb", AssertionError),
    ],
)
def test_the_stand_in_refuses_what_the_engine_refuses(probe, tmp_path, old, new, error):
    with pytest.raises(error):
        Editor().run(changed(probe, tmp_path / "wrong", old, new))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("replace_existing=True", "replace_existing=False"),
        ("    if ASSETS.does_asset_exist(path):\n        return", "    if False:\n        return"),
    ],
)
def test_a_second_run_could_open_dialogs(probe, tmp_path, old, new):
    editor = Editor()
    script = changed(probe, tmp_path / "wrong", old, new)

    def run_twice():
        editor.run(script)
        editor.run(script)

    with pytest.raises(DialogError):
        run_twice()


def test_the_second_run_updates_and_asks_nothing(probe, tmp_path):
    editor = Editor()
    editor.run(probe / "import_lightmaps.py")
    assets, created, actors = dict(editor.assets), list(editor.created), list(editor.here())
    (instance,) = slots(editor)
    instance.parameters["Exposure"] = 0.5
    brighter = write_probe(tmp_path / "again", "unreal", page=np.full((64, 64, 3), np.pi, np.float32))
    editor.run(brighter / "unreal" / "import_lightmaps.py")
    assert editor.created == created
    assert editor.here() == actors
    assert editor.assets == assets
    # The pages are new, and the user's exposure stays.
    assert slots(editor) == [instance]
    assert picture(editor) == pytest.approx(np.tile(np.array(ALBEDO) * 0.5, (4, 1)), rel=1e-3)


def test_two_levels_have_their_own_assets(probe, tmp_path):
    editor = Editor("/Game/Maps/Castle")
    editor.run(probe / "import_lightmaps.py")
    first = set(editor.assets)
    editor.level = "/Game/Old/Castle"
    dark = write_probe(tmp_path / "dark", "unreal", page=np.zeros((64, 64, 3), np.float32))
    editor.run(dark / "unreal" / "import_lightmaps.py")
    assert picture(editor) == pytest.approx(np.zeros((4, 3)))
    new = set(editor.assets) - first
    assert new
    assert all(path.startswith("/Game/Baker/Old/Castle/") for path in new)
    editor.level = "/Game/Maps/Castle"
    assert picture(editor) == pytest.approx(probe_expected(), rel=1e-3)


def test_objects_that_are_gone_are_removed_and_others_stay(probe, tmp_path):
    editor = Editor()
    editor.run(probe / "import_lightmaps.py")
    other = type(editor.here()[0])()
    editor.here().append(other)
    script = changed(probe, tmp_path / "less", '"wall_north_side_n2"', '"not_imported_n2"', "lightmap.json")
    editor.run(script)
    assert [actor.label for actor in editor.here()] == [NAME, None]
    assert editor.lines[1] == "Baker: no static mesh is named not_imported_n2."
    assert editor.lines[2].startswith("Baker: 1 of 2 objects are in the level; 1 old objects were removed.")


def test_an_unsaved_level_is_refused(probe):
    with pytest.raises(RuntimeError, match="save the level first"):
        Editor("/Temp/Untitled_1").run(probe / "import_lightmaps.py")


def test_an_asset_of_another_class_is_not_replaced(probe):
    editor = Editor()
    editor.assets["/Game/Baker/M_Baker2_Opaque"] = StaticMesh()
    with pytest.raises(RuntimeError, match=r"M_Baker2_Opaque is not an asset of the class Material\."):
        editor.run(probe / "import_lightmaps.py")


def test_a_material_that_was_not_finished_is_made_again(probe, tmp_path):
    editor = Editor()
    with pytest.raises(RuntimeError, match="cannot connect 'Nothing' to 'BaseColor' of MaterialFunctionCall"):
        editor.run(
            changed(probe, tmp_path / "bad", '"BaseColor": colour', '"BaseColor": (colour, "Nothing")')
        )
    editor.run(probe / "import_lightmaps.py")
    assert picture(editor) == pytest.approx(probe_expected(), rel=1e-3)


CHECKS = np.uint8([[[255, 0, 0, 255], [0, 255, 0, 64]], [[0, 0, 255, 255], [188, 188, 188, 255]]])


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    """Return the export of a mesh with four materials below two transformed nodes, evenly lit."""
    builder = GltfBuilder()
    image = builder.add(
        "images",
        {"bufferView": builder.view(encode_png(CHECKS)), "mimeType": "image/png", "name": "che/cks"},
    )
    sampler = builder.add("samplers", {"wrapS": 33071, "wrapT": 33648})
    texture = builder.add("textures", {"source": image, "sampler": sampler})
    moved = {"KHR_texture_transform": {"scale": [2.0, 1.0], "offset": [0.0, 0.5]}}
    kinds = [
        {"name": "plain", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1.0]}},
        {
            "name": "leaves",
            "alphaMode": "MASK",
            "alphaCutoff": 0.75,
            "doubleSided": True,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": texture, "extensions": moved}},
        },
        {
            "name": "glass",
            "alphaMode": "BLEND",
            "pbrMetallicRoughness": {
                "baseColorFactor": [1.0, 1.0, 1.0, 0.5],
                "baseColorTexture": {"index": texture},
            },
        },
        {
            "name": "screen",
            "doubleSided": True,
            "emissiveFactor": [1.0, 0.5, 0.0],
            "emissiveTexture": {"index": texture},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 100.0}},
        },
    ]
    primitives = [
        builder.primitive(
            QUAD + np.float32([2 * number, 0, 0]),
            QUAD_TRIANGLE,
            NORMAL=QUAD_NORMAL,
            TEXCOORD_0=np.float32(QUAD[:, :2]),
            TEXCOORD_1=np.float32(QUAD[:, :2] * 0.5 + [0.5 * (number % 2), 0.5 * (number // 2)]),
            material=builder.add("materials", kind),
        )
        for number, kind in enumerate(kinds)
    ]
    child = builder.node(
        name="quads", mesh=builder.mesh(*primitives), rotation=[0.5, 0.5, 0.5, 0.5], scale=[1.0, -2.0, 3.0]
    )
    builder.node(name="top", translation=[1.0, 2.0, 3.0], rotation=[0.0, 0.6, 0.0, 0.8], children=[child])
    builder.json["scenes"] = [{"nodes": [1]}]
    builder.json["extensionsUsed"] = ["KHR_texture_transform", "KHR_materials_emissive_strength"]
    builder.json["extensionsRequired"] = ["KHR_texture_transform"]
    light = np.full((1, SIZE, SIZE, 3), np.pi, np.float32)
    return write_made_up(tmp_path_factory.mktemp("level"), builder, light, "unreal") / "unreal"


def test_parents_follow_blend_mode_and_sides(level):
    editor = Editor()
    editor.run(level / "import_lightmaps.py")
    parents = [instance.parent for instance in slots(editor, "quads_n0")]
    names = {id(asset): path.rsplit("/", 1)[-1] for path, asset in editor.assets.items()}
    assert [names[id(parent)] for parent in parents] == [
        "M_Baker2_Opaque",
        "M_Baker2_Masked_TwoSided",
        "M_Baker2_Translucent",
        "M_Baker2_Opaque_TwoSided",
    ]
    for parent, blend, sides in zip(
        parents, ("OPAQUE", "MASKED", "TRANSLUCENT", "OPAQUE"), (False, True, False, True), strict=True
    ):
        assert parent.values["blend_mode"] == "BLEND_" + blend
        assert parent.values["two_sided"] is sides
        assert parent.values["shading_model"] == "MSM_UNLIT"
        assert id(parent) in editor.saved


def test_colours_alpha_and_emission(level):
    """The page holds pi everywhere, so the colours are the base colours plus the emission."""
    editor = Editor()
    editor.run(level / "import_lightmaps.py")
    plain, leaves, glass, screen = slots(editor, "quads_n0")
    at = [(0.25, 0.25), (0.5, 0.5)]
    assert shown(plain, at)[0] == pytest.approx([0.5] * 3, rel=1e-3)
    # The texture is read at (0.5, 0.75), the opaque grey texel. Its code 188 is 0.5029 in linear numbers.
    colour, alpha = shown(leaves, at)
    assert colour == pytest.approx([0.5029] * 3, rel=1e-3)
    assert alpha["MP_OPACITY_MASK"] == pytest.approx([1.0 - 0.75 + 0.5])
    # At (0.5, 1.75), v is mirrored. The lookup returns the green texel, whose alpha is below the cutoff.
    colour, alpha = shown(leaves, [(0.25, 1.25), (0.5, 0.5)])
    assert colour == pytest.approx([0.0, 1.0, 0.0], rel=1e-3, abs=1e-9)
    assert alpha["MP_OPACITY_MASK"] == pytest.approx([64 / 255 - 0.75 + 0.5])
    colour, alpha = shown(glass, [(0.75, 0.25), (0.5, 0.5)])
    assert colour == pytest.approx([0.0, 1.0, 0.0], rel=1e-3, abs=1e-9)
    assert alpha["MP_OPACITY"] == pytest.approx([0.5 * 64 / 255])
    # The emission is 100 times the red texel; the base colour of 1 is added.
    assert shown(screen, at)[0] == pytest.approx([1.0 + 100.0, 1.0, 1.0], rel=1e-3)


def test_textures_are_files_with_their_wrap_modes(level):
    editor = Editor()
    editor.run(level / "import_lightmaps.py")
    made = editor.assets["/Game/Baker/Maps/Castle/Textures/che_cks_t0"]
    assert (made.values["address_x"], made.values["address_y"]) == ("TA_CLAMP", "TA_MIRROR")
    assert made.values["srgb"] is True
    page = editor.assets["/Game/Baker/Maps/Castle/Pages/irradiance_0"].values
    assert (page["srgb"], page["compression_settings"]) == (False, "TC_HDR")
    assert (page["mip_gen_settings"], page["address_x"]) == ("TMGS_NO_MIPMAPS", "TA_CLAMP")
    scene = load_scene(level / "scene.glb")
    assert [material.base_colour_texture for material in scene.materials] == [None] * 4


def test_actors_are_where_the_objects_are(level):
    """The vertices in the level are those of the scene: x, z, y in cm."""
    editor = Editor()
    editor.run(level / "import_lightmaps.py")
    (actor,) = editor.here()
    scene = load_scene(level / "scene.glb")
    mesh = scene.meshes[scene.instances[0].mesh]
    matrix = scene.instances[0].world_from_object
    world = mesh.position @ np.asarray(matrix)[:3, :3].T + np.asarray(matrix)[:3, 3]
    expected = 100.0 * world[:, [0, 2, 1]]
    found = actor.world()
    distance = np.linalg.norm(found[:, None] - expected[None], axis=2).min(axis=1)
    assert distance.max() < 0.01
    assert actor.folder == "Baker"


def test_places_of_random_matrices():
    rng = np.random.default_rng(5)
    for mirrored in (False, True) * 10:
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        scale = rng.uniform(0.1, 5.0, 3) * ([-1.0, 1.0, 1.0] if mirrored else 1.0)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn * scale, rng.normal(size=3)
        found = actor_transform(matrix)
        assert not found["sheared"]
        point = rng.normal(size=3)
        x, y, z, w = found["rotation"]
        at = 100.0 * point[[0, 2, 1]] * found["scale"]
        axis = np.array([x, y, z])
        at = at + 2.0 * np.cross(axis, np.cross(axis, at) + w * at) + found["location"]
        assert at == pytest.approx(100.0 * (matrix[:3, :3] @ point + matrix[:3, 3])[[0, 2, 1]])
    matrix[0, 1] += 1.0
    assert actor_transform(matrix)["sheared"]


def test_a_sheared_object_is_reported(probe, tmp_path):
    editor = Editor()
    editor.run(changed(probe, tmp_path / "sheared", '"sheared": false', '"sheared": true', "lightmap.json"))
    assert editor.lines[0] == f"Baker: {NAME} is sheared, which actors cannot be."


def test_a_uv_set_that_the_materials_do_not_have_is_reported(level, tmp_path):
    editor = Editor()
    editor.run(changed(level, tmp_path / "set", '"uv_set": 0', '"uv_set": 2', "lightmap.json"))
    assert "drawn with UV channel 0" in editor.lines[0]
    description = json.loads((level / "lightmap.json").read_text("utf-8"))
    assert [o["materials"] for o in description["objects"]] == [
        ["plain_m0", "leaves_m1", "glass_m2", "screen_m3"]
    ]


def test_objects_with_one_mesh_have_their_own_materials(tmp_path):
    out = write_shared_probe(tmp_path, "unreal") / "unreal"
    editor = Editor()
    editor.run(out / "import_lightmaps.py")
    names = [f"square_n{number}" for number in range(4)]
    components = [a.values["static_mesh_component"] for a in editor.here()]
    assert len({id(c.values["static_mesh"]) for c in components}) == 1
    for name, (_, _, (u, v)) in zip(names, SQUARES, strict=True):
        (instance,) = slots(editor, name)
        points = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
        found = np.array([shown(instance, [(0.3, 0.3), point])[0] for point in points])
        fields = [FIELD[int(4 * (0.5 * y + v)), int(4 * (0.5 * x + u))] for x, y in points]
        assert found == pytest.approx(np.array(fields)[:, None] * np.array(ALBEDO), rel=1e-3)
