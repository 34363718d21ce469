"""Files that a scene refers to are not read outside the scene's folder, unless `allow_outside` is set."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from gltf_builder import GltfBuilder, quad_builder, write
from PIL import Image

from baker.cli.app import run
from baker.core.errors import InputError
from baker.io.load import load_scene
from baker.io.scene_hash import scene_sha256
from baker.repairs.fix_file import fix_file
from baker.repairs.settings import RepairSettings

MARK = b"the secret of another folder"


def picture() -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (1, 1), (10, 200, 30)).save(stream, "PNG")
    return stream.getvalue()


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Return the folder `pack/level` for scenes.

    `pack` contains the files `secret` and `wood.png`. The folder has links to `secret` and to `pack`.
    """
    folder = tmp_path / "pack" / "level"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "pack" / "secret").write_bytes(MARK * 4)
    (tmp_path / "pack" / "wood.png").write_bytes(picture())
    (folder / "link").symlink_to("../secret")
    (folder / "link2").symlink_to("link")
    (folder / "out").symlink_to("..")
    return folder


def with_buffer(uri: str, **material: object) -> GltfBuilder:
    """Return a quad with a second buffer, the file `uri`, that nothing uses."""
    builder = quad_builder(**material)
    document = builder.document

    def more(**keywords: bool) -> dict:
        found = document(**keywords)
        found.setdefault("buffers", []).append({"uri": uri, "byteLength": 8})
        return found

    builder.document = more  # type: ignore[method-assign]
    return builder


def with_image(uri: str, *, used: bool) -> GltfBuilder:
    texture = {"baseColorTexture": {"index": 0}}
    builder = quad_builder(name="wall", pbrMetallicRoughness=texture if used else {})
    builder.add("images", {"uri": uri})
    builder.add("textures", {"source": 0})
    return builder


OUTSIDE = [
    "../secret",
    "sub/../../secret",
    "%2e%2e/secret",
    "%2E%2E%2Fsecret",
    "..\\secret",
    "link",
    "link2",
    "./out/secret",
    "sub/../link",
    "/proc/self/environ",
]


@pytest.mark.parametrize("uri", OUTSIDE)
@pytest.mark.parametrize("kind", ["unused buffer", "used image", "unused image"])
@pytest.mark.parametrize("lenient", [False, True])
def test_files_outside_are_refused(place: Path, uri: str, kind: str, lenient: bool) -> None:
    builder = with_buffer(uri) if "buffer" in kind else with_image(uri, used=kind == "used image")
    path = write(place / "a.gltf", builder)
    with pytest.raises(InputError) as caught:
        load_scene(path, lenient=lenient)
    error = caught.value
    assert error.file == str(path)
    assert error.object == ("buffers[1].uri" if "buffer" in kind else "images[0].uri")
    assert "outside of the scene's folder" in error.message
    assert "`allow_outside=True`" in error.message
    with pytest.raises(InputError, match="outside"):
        scene_sha256(path)


def test_an_absolute_path_is_refused_and_says_nothing_about_the_file(place: Path) -> None:
    messages = []
    secret = place.parent / "secret"
    path = write(place / "a.glb", with_buffer(str(secret)))
    for exists in (True, False):
        assert secret.exists() == exists
        with pytest.raises(InputError) as caught:
            load_scene(path)
        messages.append(caught.value.message)
        secret.unlink(missing_ok=True)
    assert messages[0] == messages[1]


@pytest.mark.parametrize(
    "uri", ["file:///etc/passwd", "FILE:///etc/passwd", "http://a.b/c", "file://../secret"]
)
def test_other_schemes_are_not_read(place: Path, uri: str) -> None:
    with pytest.raises(InputError, match="not a file beside the scene"):
        load_scene(write(place / "a.gltf", with_image(uri, used=True)))


def test_files_below_the_folder_are_read(place: Path) -> None:
    (place / "sub" / "wood.png").write_bytes(picture())
    (place / "inner").symlink_to("sub/wood.png")
    for uri in (
        "sub/wood.png",
        "sub/../sub/wood.png",
        "inner",
        str(place / "sub" / "wood.png"),
        "sub%2Fwood.png",
    ):
        scene = load_scene(write(place / "a.gltf", with_image(uri, used=True)))
        assert scene.materials[0].base_colour_texture is not None
    # The path to the scene's folder may contain a link.
    (place.parent / "door").symlink_to("level")
    load_scene(place.parent / "door" / "a.gltf")


def test_a_pack_with_shared_textures_is_read_with_the_setting(place: Path) -> None:
    path = write(place / "a.gltf", with_image("../wood.png", used=True))
    assert load_scene(path, allow_outside=True).materials[0].base_colour_texture is not None
    assert scene_sha256(path, allow_outside=True) == load_scene(path, allow_outside=True).sha256
    with pytest.raises(InputError, match="outside"):
        fix_file(path)
    assert picture() in fix_file(path, RepairSettings(allow_outside=True)).data


@pytest.mark.parametrize("what", ["mtllib", "map_Kd", "map_Ke", "unused material"])
def test_obj_files_name_no_file_outside(place: Path, what: str) -> None:
    (place.parent / "far.mtl").write_text("newmtl m\nKd 1 0 0\n")
    statement = {"map_Kd": "map_Kd ../wood.png", "map_Ke": "map_Ke out/wood.png"}.get(
        what, "map_Kd ../wood.png"
    )
    (place / "near.mtl").write_text(f"newmtl m\n{statement}\n")
    library = "../far.mtl" if what == "mtllib" else "near.mtl"
    used = "other" if what == "unused material" else "m"
    path = place / "a.obj"
    path.write_text(f"mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl {used}\nf 1/1 2/1 3/1\n")
    with pytest.raises(InputError, match="outside of the scene's folder") as caught:
        load_scene(path)
    assert caught.value.file == str(path if what == "mtllib" else place / "near.mtl")
    assert caught.value.object == ("mtllib" if what == "mtllib" else "m")
    load_scene(path, allow_outside=True)


def test_a_library_in_a_sub_folder_may_name_what_is_in_the_folder(place: Path) -> None:
    (place / "wood.png").write_bytes(picture())
    (place / "sub" / "a.mtl").write_text("newmtl m\nmap_Kd ../wood.png\n")
    path = place / "a.obj"
    path.write_text("mtllib sub/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    assert load_scene(path).materials[0].base_colour_texture is not None


def test_every_command_that_reads_a_scene_has_the_flag(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(place / "a.gltf", with_image("../wood.png", used=True))
    jobs = place / "jobs.toml"
    jobs.write_text('[[job]]\nscene = "a.gltf"\nout = "baked"\n')
    out = place / "fixed.glb"
    camera = ("--camera", "0,0,3,0,0,0,40", "--spp", "2", "--width", "2", "--height", "2")
    for words in (
        ("bake", path, "-o", place / "o", "--resolution", "16"),
        ("ao", path, "-o", place / "o", "--resolution", "16"),
        ("check", path),
        ("check", path, "--fix", "-o", out),
        ("inspect", path),
        ("render", path, "-o", place / "v.exr", *camera),
        ("batch", jobs, "--dry-run"),
    ):
        text = io.StringIO()
        assert run([*map(str, words)], out=text) == 3, words
        told = text.getvalue() + capsys.readouterr().err
        assert "--allow-outside" in told, words
        assert "images[0].uri" in told
        assert not out.exists()
        assert not (place / "o").exists()
    for words in (("inspect", path), ("check", path), ("check", path, "--fix", "-o", out)):
        assert run([*map(str, words), "--allow-outside"], out=io.StringIO()) == 0, words
    assert picture() in out.read_bytes()
    jobs.write_text('[defaults]\nallow-outside = true\n[[job]]\nscene = "a.gltf"\nout = "baked"\n')
    assert run(["batch", str(jobs), "--dry-run"], out=io.StringIO()) == 0


def test_the_scene_of_a_bake_names_no_file(place: Path) -> None:
    """`scene.glb` of a bake contains all its data. Other files that it refers to are not read."""
    path = write(place / "a.gltf", with_image("../wood.png", used=True))
    with pytest.raises(InputError, match="holds all its data"):
        load_scene(path, self_contained=True)
    scene = load_scene(write(place / "b.gltf", with_buffer("../secret")), self_contained=True)
    assert [warning.code for warning in scene.warnings] == ["missing-file"]
    document = json.loads(json.dumps(scene.source.json if scene.source else {}))
    assert document["buffers"][1]["uri"] == "../secret"
