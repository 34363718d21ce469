"""Output paths to which nothing can be written are refused with a one-sentence error."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from io_scenes import quad_result

import baker
from baker.core.errors import InputError, SettingsError
from baker.io.bake.lock import held
from baker.io.bake.output_folder import check_out
from baker.io.bake.write_bake import write_bake
from baker.io.inspect import inspect_path
from baker.rendering.write import check_image
from baker.repairs.write import check_fixed

CHECKS = [check_out, lambda out: check_image(out), lambda out: check_fixed(out, Path("scene.glb"))]


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("below", [False, True])
def test_a_loop_of_links(tmp_path: Path, check, below: bool) -> None:
    suffix = {0: "", 1: ".png", 2: ".glb"}[CHECKS.index(check)]
    one, two = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    one.symlink_to(two)
    two.symlink_to(one)
    with pytest.raises(SettingsError, match="links in this path form a loop"):
        check(one / one.name if below else one)
    with held(one), pytest.raises(InputError, match="no such"):
        inspect_path(one)


def test_a_link_that_leads_to_nothing_is_no_loop(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "out")
    check_out(tmp_path / "link")
    write_bake(quad_result(tmp_path / "in"), tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "out" / "bake.json").is_file()


@pytest.mark.skipif(os.name != "posix", reason="names are bytes")
def test_names_that_are_not_text(tmp_path: Path) -> None:
    name = os.fsdecode(b"out\xff")
    for check, suffix in zip(CHECKS, ("", ".png", ".glb"), strict=True):
        with pytest.raises(SettingsError, match="not text in the encoding"):
            check(tmp_path / (name + suffix))
    out = tmp_path / "out"
    manifest = write_bake(quad_result(tmp_path / name), out)
    assert manifest["input"]["path"].startswith("../out\\udcff/")
    assert inspect_path(out)["input"] == manifest["input"]
    out.rename(tmp_path / "renamed").rename(tmp_path / (name + "2"))
    for path in (tmp_path / (name + "2"), tmp_path / (name + "2") / "irradiance_0.exr"):
        with pytest.raises(InputError, match="not text in the encoding"):
            inspect_path(path)


def test_an_empty_name_from_python() -> None:
    with pytest.raises(SettingsError, match="is empty"):
        baker.bake("scene.glb", out="")
