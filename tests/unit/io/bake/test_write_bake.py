"""`write_bake`: the written files equal the bake, and after any failure the folder has its old content."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from glb_reader import Glb
from io_scenes import quad_result
from PIL import Image

from baker.channels.channel import CHANNELS
from baker.core.encoding import ENCODINGS
from baker.core.errors import Cancelled, ResourceError, SettingsError
from baker.core.lightmap import TexelStatus
from baker.encodings.exr import decode_exr
from baker.io.bake import output_folder
from baker.io.bake import write_bake as output
from baker.io.bake.manifest import manifest_schema
from baker.io.bake.output_folder import check_out
from baker.io.bake.write_bake import check_encodings, write_bake

NOON = datetime(2024, 1, 2, 12, 0, tzinfo=UTC)
NAMES = ["ao_0.exr", "bake.json", "irradiance_0.exr", "scene.glb", "status_0.png"]


def tree(folder: Path) -> dict[str, bytes]:
    """Return {relative path: content} of every file below a folder."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_the_folder_holds_what_was_baked(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    manifest = write_bake(result, tmp_path / "new" / "parent" / "out")
    out = tmp_path / "new" / "parent" / "out"
    assert names(out) == NAMES
    assert names(out.parent) == ["out"], "no temporary folder is left"
    for channel, lightmap in result.lightmaps.items():
        image = decode_exr(out / f"{channel}_0.exr")
        assert np.array_equal(image.pixels, lightmap.value[0].astype(np.float16).astype(np.float32))
        assert image.header["unit"] == lightmap.unit
        assert channel.replace("ao", "ambient occlusion") in image.header["quantity"]
        assert image.header["software"].startswith("baker ")
    assert decode_exr(out / "irradiance_0.exr").header["colourSpace"] == "linear Rec.709, D65"
    status = Image.open(out / "status_0.png")
    assert status.mode == "P"
    assert np.array_equal(np.asarray(status), result.status[0])
    assert status.text["Legend"] == "0 empty, 1 covered, 2 dilated, 3 invalid, 4 unconverged"
    assert status.getpalette()[3 * 3 : 3 * 4] == [230, 159, 0]
    for entry in [*manifest["files"], *manifest["pages"]]:
        assert hashlib.sha256((out / entry["file"]).read_bytes()).hexdigest() == entry["sha256"]
    glb = Glb(out / "scene.glb")
    image = np.asarray(Image.open(out / "status_0.png"))
    assert image.shape == (16, 16)
    occlusion = glb.json["images"][glb.json["textures"][0]["source"]]
    (tmp_path / "ao.png").write_bytes(glb.view(occlusion["bufferView"]))
    grey = np.asarray(Image.open(tmp_path / "ao.png"))
    assert np.abs(grey / 255.0 - result.lightmaps["ao"].value[0, :, :, 0]).max() <= 0.5 / 255 + 1e-6


def test_float_files_hold_all_bits(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", dtype="float")
    write_bake(result, tmp_path / "out")
    image = decode_exr(tmp_path / "out" / "irradiance_0.exr")
    assert image.dtype == "float"
    assert np.array_equal(image.pixels, result.lightmaps["irradiance"].value[0])


def test_the_same_bytes_twice_for_any_threads(tmp_path: Path) -> None:
    for name, threads in (("a", 1), ("b", 7)):
        write_bake(quad_result(tmp_path / "in", threads=threads), tmp_path / name, created=NOON)
    assert tree(tmp_path / "a") == tree(tmp_path / "b")


def test_a_new_bake_takes_the_place_of_the_old_one_and_leaves_what_is_not_bakers(tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = quad_result(tmp_path / "in")
    write_bake(result, out)
    (out / "notes.txt").write_text("mine")
    (out / "deep" / "er").mkdir(parents=True)
    (out / "deep" / "er" / "x.bin").write_bytes(b"x")
    (out / "empty").mkdir()
    (out / "link").symlink_to("notes.txt")
    only_ao = {"ao": result.lightmaps["ao"]}
    write_bake(replace(result, lightmaps=only_ao), out)
    assert names(out) == sorted({*NAMES, "notes.txt", "deep", "empty", "link"} - {"irradiance_0.exr"})
    assert (out / "notes.txt").read_text() == "mine"
    assert (out / "deep" / "er" / "x.bin").read_bytes() == b"x"
    assert (out / "link").is_symlink()
    assert names(tmp_path) == ["in", "out"]


def test_a_foreign_folder_is_refused_and_with_force_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    (out / "bake.json").write_text('{"settings": "of another program"}')
    result = quad_result(tmp_path / "in")
    before = tree(out)
    for attempt in (lambda: check_out(out), lambda: write_bake(result, out)):
        with pytest.raises(SettingsError, match="baker did not write") as caught:
            attempt()
        assert caught.value.exit_code == 2
    assert tree(out) == before
    write_bake(result, out, force=True)
    assert names(out) == sorted([*NAMES, "thesis.txt"])
    assert (out / "thesis.txt").read_text() == "mine"


def test_places_that_cannot_be_a_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(SettingsError, match="is a file"):
            check_out(place, force=True)
    with pytest.raises(SettingsError, match="the root of the file system; name a folder in it"):
        check_out(Path(tmp_path.anchor), force=True)
    (tmp_path / "empty").mkdir()
    check_out(tmp_path / "empty")
    check_out(tmp_path / "no" / "such" / "parent")
    assert names(tmp_path) == ["empty", "file"], "`check_out` creates no folder"


def test_a_bake_never_replaces_its_own_input(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_bake(quad_result(tmp_path / "in"), out)
    with pytest.raises(SettingsError, match=r"its own input 'scene\.glb'"):
        check_out(out, force=True, scene_path=out / "scene.glb")
    check_out(out, scene_path=out / "level.glb")


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), KeyboardInterrupt(), Cancelled("stop")]
)
@pytest.mark.parametrize("old", [True, False])
@pytest.mark.parametrize("place", ["glb", "commit"])
def test_whatever_fails_leaves_the_old_bake_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, old: bool, place: str
) -> None:
    out = tmp_path / "parent" / "out"
    result = quad_result(tmp_path / "in")
    if old:
        write_bake(result, out)
        (out / "notes.txt").write_text("mine")
    before = tree(tmp_path)

    def fail(*_: object) -> None:
        raise error

    if place == "glb":
        monkeypatch.setattr(output, "make_glb", fail)
    else:
        monkeypatch.setattr(*((output_folder, "exchange_paths") if old else (Path, "rename")), fail)
    with pytest.raises(ResourceError if isinstance(error, OSError) else type(error)) as caught:
        write_bake(result, out)
    if isinstance(error, OSError):
        assert "No space left" in str(caught.value)
        assert str(out) in str(caught.value)
    assert tree(tmp_path) == before
    assert names(tmp_path) == (["in", "parent"] if old else ["in"])
    assert not old or names(out.parent) == ["out"]


def test_progress_can_cancel(tmp_path: Path) -> None:
    seen = []

    def stop_at_half(stage: str, fraction: float, detail: str = "", /) -> bool:
        seen.append((stage, fraction, detail))
        return fraction >= 0.5

    with pytest.raises(Cancelled):
        write_bake(quad_result(tmp_path / "in"), tmp_path / "out", progress=stop_at_half)
    assert [detail for _, _, detail in seen] == ["irradiance_0.exr", "ao_0.exr"]
    assert names(tmp_path) == ["in"]


def test_a_real_full_disk_is_one_sentence(tmp_path: Path) -> None:
    """Simulate a full disk by limiting the size of files to 1000 bytes in a separate process."""
    code = (
        "import resource, sys; from pathlib import Path; from io_scenes import quad_result\n"
        "from baker.io.bake.write_bake import write_bake\n"
        f"result = quad_result(Path({str(tmp_path / 'in')!r}), dtype='float')\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        f"out = Path({str(tmp_path / 'out')!r})\n"
        "try: write_bake(result, out)\n"
        "except Exception as error: print(type(error).__name__, error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert run.stdout.startswith(f"ResourceError {tmp_path / 'out'}: ")
    assert "File too large" in run.stdout
    assert names(tmp_path) == ["in"]


def test_not_a_number_in_a_map_is_never_written(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    result.lightmaps["irradiance"].value[0, 3, 3, 1] = np.nan
    with pytest.raises(ValueError, match="not a number"):
        write_bake(result, tmp_path / "out")
    assert names(tmp_path) == ["in"]


def test_the_current_folder_is_written_file_by_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    result = quad_result(tmp_path / "in")
    write_bake(result, out, created=NOON)
    (out / "notes.txt").write_text("mine")
    before = tree(out)
    inode = out.stat().st_ino
    monkeypatch.chdir(out)
    write_bake(replace(result, lightmaps={"ao": result.lightmaps["ao"]}), Path())
    assert out.stat().st_ino == inode, "the working directory of a shell is not replaced"
    assert names(out) == sorted({*NAMES, "notes.txt"} - {"irradiance_0.exr"})
    write_bake(result, Path(), created=NOON)
    assert tree(out) == before
    replace_file, calls = Path.replace, []

    def seventh_fails(self: Path, target: Path) -> Path:
        calls.append(self)
        if len(calls) == 7:
            raise OSError(5, "Input/output error")
        return replace_file(self, target)

    monkeypatch.setattr(Path, "replace", seventh_fails)
    with pytest.raises(ResourceError, match="Input/output error"):
        write_bake(result, Path())
    assert len(calls) > 7
    assert tree(out) == before
    assert names(out) == sorted([*NAMES, "notes.txt"])


def test_a_place_that_cannot_be_written_is_found_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked = tmp_path / "locked"
    out = locked / "out"
    out.mkdir(parents=True)
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != locked and access(path, mode))
    with pytest.raises(ResourceError, match="nothing can be written to") as caught:
        check_out(locked / "new" / "out")
    assert caught.value.exit_code == 4
    # The parent is read-only, so the output folder cannot be renamed, but files in it can be written.
    write_bake(quad_result(tmp_path / "in"), out)
    assert names(out) == NAMES


def test_further_encodings_lie_beside_the_exr(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", encode="hdr,rgbm,png8,png16", rgbm_range=40)
    result.lightmaps["irradiance"].value[0, 3, 4:9, 1] = 41.0
    status = result.status
    status[:] = TexelStatus.COVERED
    out = tmp_path / "out"
    manifest = write_bake(result, out)
    listed = {entry["file"]: entry["sha256"] for entry in manifest["files"]}
    assert set(listed) | {"bake.json"} == set(names(out))
    jsonschema.validate(manifest, manifest_schema())
    pages = {page["channel"]: page for page in manifest["pages"]}
    assert [e["encoding"] for e in pages["irradiance"]["encodings"]] == ["hdr", "rgbm"]
    assert [e["encoding"] for e in pages["ao"]["encodings"]] == ["png8", "png16"]
    for page in pages.values():
        for entry in page["encodings"]:
            encoding = ENCODINGS.get(entry["encoding"])
            assert encoding is not None
            assert listed[entry["file"]] == entry["sha256"]
            value = result.lightmaps[page["channel"]].value[0]
            options = encoding.fitted(encoding.options_of(result.settings), float(value.max()))
            assert encoding.limits(options)[1] == entry["max"]
            assert np.array_equal(
                encoding.decode(out / entry["file"]).pixels, encoding.stored(value, options)
            )
    rgbm = pages["irradiance"]["encodings"][1]
    assert (rgbm["min"], rgbm["max"]) == (0.0, 40.0)
    value = result.lightmaps["irradiance"].value[0]
    assert rgbm["clipped"] == int((value > 40).any(axis=2).sum()) > 5
    assert [w["message"] for w in manifest["warnings"] if w["code"] == "clipped"] == [
        f"irradiance_0.rgbm.png: {rgbm['clipped']} texels are outside the range of the format "
        "and were clipped; raise `rgbm_range` or set it to auto"
    ]


def test_steps_that_show_are_warned_of(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", encode="png8,png16")
    result.status[:] = TexelStatus.COVERED
    result.lightmaps["ao"].value[0, :8] = np.linspace(0.0105, 0.0131, 128, dtype=np.float32).reshape(8, 16, 1)
    manifest = write_bake(result, tmp_path / "out")
    found = [w for w in manifest["warnings"] if w["code"] == "banding"]
    assert len(found) == 1
    assert found[0]["object"] == "ao"
    assert found[0]["message"].startswith("ao_0.8bit.png: steps of the format show in ")
    assert found[0]["message"].endswith("use png16 or the EXR")


def test_auto_range_is_the_brightest_texel_of_all_pages(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", encode=["rgbm"])
    entry = write_bake(result, tmp_path / "out")["pages"][0]["encodings"][0]
    assert entry["max"] == float(result.lightmaps["irradiance"].value.max())
    assert entry["clipped"] == 0


def test_an_encoding_that_no_channel_fits_is_refused() -> None:
    light, ao = ({name: CHANNELS.get(name)} for name in ("irradiance", "ao"))
    check_encodings(("hdr", "png8"), light | ao)
    for names_, components, words in [
        (("hdr",), ao, "three"),
        (("png16",), light, "one component"),
        (("exr",), ao, "in any case"),
        (("jpeg",), ao, "known are hdr, ktx2, png16, png8, rgbm, webp"),
    ]:
        with pytest.raises(SettingsError, match=words):
            check_encodings(names_, components)
    check_encodings(("ktx2", "webp"), light, 16383)
    check_encodings(("ktx2", "rgbm"), light, 16384)
    with pytest.raises(SettingsError, match="'webp' holds at most 16383 x 16383 texels"):
        check_encodings(("webp",), light, 16384)
