"""`baker.export` writes its folder completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write

import baker
from baker.core.export import EXPORTS


@pytest.fixture(scope="module")
def bake(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    scene = write(folder / "quad.glb", quad_builder())
    return baker.ao(scene, resolution=16, samples=1, denoise=False, out=folder / "bake").out


def everything(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def interrupt(bake: Path, target: Path) -> None:
    (target / "half.bin").write_bytes(b"1")
    raise KeyboardInterrupt


def fill_disk(bake: Path, target: Path) -> None:
    (target / "half.bin").write_bytes(b"1")
    raise OSError(28, os.strerror(28))


@pytest.mark.parametrize("place", ["new", "deep/new", "empty", "."])
@pytest.mark.parametrize(("stop", "kind"), [(interrupt, KeyboardInterrupt), (fill_disk, baker.ResourceError)])
def test_an_export_that_is_stopped_leaves_nothing(bake, tmp_path, monkeypatch, place, stop, kind):
    if place == "empty":
        (tmp_path / place).mkdir()
    before = everything(tmp_path)
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(type(EXPORTS.require("gltf", "export")), "write", staticmethod(stop), raising=False)
        with pytest.raises(kind):
            baker.export(bake, "gltf", place)
    assert everything(tmp_path) == before
    assert baker.export(bake, "gltf", place) == Path(place)
    assert everything(tmp_path / place), "the folder is free for the next try"
    assert not [name for name in everything(tmp_path) if name.startswith(".") or "/." in name]


def test_the_export_appears_when_it_is_complete(bake, tmp_path, monkeypatch):
    export = EXPORTS.require("gltf", "export")
    write = export.write

    def look(source: Path, target: Path) -> None:
        write(source, target)
        assert not (tmp_path / "out").exists()

    monkeypatch.setattr(type(export), "write", staticmethod(look))
    baker.export(bake, "gltf", tmp_path / "out")
    assert (tmp_path / "out").is_dir()


def test_what_a_killed_export_left_is_removed(bake, tmp_path):
    left = tmp_path / ".out.baker-999999999-0123abcd"
    (left / "new").mkdir(parents=True)
    baker.export(bake, "gltf", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
