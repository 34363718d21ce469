"""Godot 3 imports and draws the export `godot` correctly, and changed exports incorrectly.

The test runs by hand because Godot is large:

    apt-get install godot3 godot3-server xvfb xauth
    pytest -m engines_by_hand tests/engines/test_godot.py
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from browser import need_program
from engine_scenes import QUADRANT, probe_expected, srgb_page, write_probe
from proof import (
    changed,
    edited,
    light_in_codes,
    lower_left_quarter,
    middles,
    shows_something_else,
    shows_the_probe,
    shows_the_room,
    with_material,
)

pytestmark = pytest.mark.engines_by_hand
PROJECT = Path(__file__).parent / "godot3"
# Factors by which the light is multiplied, one for each picture. A picture has 8 bits, so the value of a
# pixel is averaged over the pictures in which its code is between 120 and 250.
EXPOSURES = [2.0 ** (k / 4) for k in range(-8, 17)]


def imported(project, environment):
    """Run the editor until all files are imported. With --quit, it could exit before it begins to import."""
    editor = [need_program("godot3-server", "godot3-server"), "--editor", "--path", str(project)]
    wanted = len(list(project.glob("godot/*.exr"))) + 1
    log = project.with_suffix(".log")
    with log.open("w") as stream:
        process = subprocess.Popen(editor, env=environment, stdout=stream, stderr=subprocess.STDOUT)
        try:
            for _ in range(600):
                # Godot writes the .md5 file of an asset after the imported asset.
                if len(list(project.glob(".import/*.md5"))) == wanted or process.poll() is not None:
                    break
                time.sleep(0.2)
        finally:
            process.terminate()
            process.wait(20)
    told = log.read_text("utf-8", "replace")
    assert len(list(project.glob(".import/*.md5"))) == wanted, told[-3000:]
    assert "SCRIPT ERROR" not in told, told[-3000:]


def draw(folder, tmp_path, camera="front", exposures=EXPOSURES):
    """Import an export with the editor, draw it, and return the (64, 64, 3) picture, row 0 on top."""
    project = tmp_path / "project"
    tmp_path.mkdir(exist_ok=True)
    shutil.copytree(PROJECT, project)
    # Follow the steps of the docs for Godot 3.
    shutil.copytree(folder / "godot3", project / "godot", ignore=shutil.ignore_patterns(".gdignore"))
    for path in [folder / "scene.glb", folder / "lightmap.json", *folder.glob("lightmap_*.exr")]:
        shutil.copy(path, project / "godot")
    (project / "task.json").write_text(json.dumps({"camera": camera, "exposures": exposures}), "utf-8")
    # Godot stores its settings in the home folder.
    environment = {**os.environ, "HOME": str(tmp_path)}
    imported(project, environment)
    game = [need_program("xvfb-run", "xvfb"), "-a", need_program("godot3", "godot3")]
    game += ["--video-driver", "GLES3", "--audio-driver", "Dummy", "--path", str(project)]
    done = subprocess.run(game, env=environment, capture_output=True, text=True, timeout=120, check=False)
    told = done.stdout + done.stderr
    result = project / "result.json"
    assert result.exists(), told[-3000:]
    assert "SCRIPT ERROR" not in told, told[-3000:]
    code = np.array(json.loads(result.read_text("utf-8")), float).reshape(-1, 64, 64, 3)
    exposure = json.loads((folder / "lightmap.json").read_text("utf-8"))["exposure"]
    # Godot 3 truncates colours to 8 bits, so the offset is 0.5.
    return light_in_codes(code, exposures, 120, 0.5) / exposure


def test_the_probe_is_shown(probe, tmp_path):
    picture = draw(probe / "godot", tmp_path)
    assert shows_the_probe(picture), middles(picture)


def test_a_room_of_known_radiosity(room, tmp_path):
    assert shows_the_room(draw(room / "godot", tmp_path, "inside"))


def test_offset_and_scale_of_an_object_are_used(probe, tmp_path):
    picture = draw(lower_left_quarter(probe / "godot", tmp_path / "part"), tmp_path)
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(picture, expected), middles(picture)


def test_alpha_and_cull_mode_of_materials_are_used(probe, tmp_path):
    mask = edited(probe / "godot", tmp_path / "mask", with_material(0.25, alphaMode="MASK", alphaCutoff=0.5))
    assert draw(mask, tmp_path / "a").max() == 0.0
    assert draw(probe / "godot", tmp_path / "b", "back").max() == 0.0
    double = edited(probe / "godot", tmp_path / "double", with_material(doubleSided=True))
    picture = draw(double, tmp_path / "c", "back")
    assert shows_the_probe(picture, probe_expected()[[1, 0, 3, 2]]), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("UV2 * uv_scale + uv_offset", "vec2(0.0, 1.0) + vec2(1.0, -1.0) * UV2"),
        ("UV2 * uv_scale", "UV * uv_scale"),
        ("+ slice) / slices", "+ slice)"),
        ("base.rgb * light", "3.14159265359 * base.rgb * light"),
    ],
    ids=["v turned over", "first uv set", "no layers", "no pi"],
)
def test_a_wrong_export_fails(probe, tmp_path, right, wrong):
    copy = changed(probe / "godot", tmp_path / "wrong", "godot3/lightmap.shader", right, wrong)
    picture = draw(copy, tmp_path)
    assert shows_something_else(picture), middles(picture)


def test_srgb_numbers_in_the_pages_fail(tmp_path):
    out = write_probe(tmp_path / "srgb", "godot", page=srgb_page())
    assert shows_something_else(draw(out / "godot", tmp_path))
