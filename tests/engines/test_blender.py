"""Blender draws the export `blender` correctly, and changed exports incorrectly.

The test runs by hand because Blender is large. It needs Python 3.11:

    python3.11 -m venv tests/engines/blender-env && tests/engines/blender-env/bin/pip install 'bpy==4.5.*'
    pytest -m engines_by_hand tests/engines/test_blender.py
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from engine_scenes import QUADRANT, probe_expected, srgb_page, write_probe
from proof import changed, lower_left_quarter, middles, shows_something_else, shows_the_probe, shows_the_room
from shared_probe import shows_the_squares, write_shared_probe

from baker.encodings.exr import decode_exr

pytestmark = pytest.mark.engines_by_hand
HERE = Path(__file__).parent
PYTHON = HERE / "blender-env" / "bin" / "python"


def draw(folder, tmp_path, camera="front"):
    if not PYTHON.exists():
        pytest.fail(f"Blender is not installed in {PYTHON.parents[1].name}; this file says how")
    image = tmp_path / "blender.exr"
    script = HERE / "render_in_blender.py"
    done = subprocess.run(
        [PYTHON, script, folder, camera, image], capture_output=True, text=True, check=False
    )
    assert image.exists(), done.stdout[-2000:] + done.stderr[-2000:]
    return decode_exr(image).pixels[:, :, :3].astype(float)


def test_the_probe_is_shown_exactly(probe, tmp_path):
    picture = draw(probe / "blender", tmp_path)
    assert shows_the_probe(picture, rel=0.001), middles(picture)


def test_a_room_of_known_radiosity(room, tmp_path):
    assert shows_the_room(draw(room / "blender", tmp_path, "inside"))


def test_offset_and_scale_of_an_object_are_used(probe, tmp_path):
    picture = draw(lower_left_quarter(probe / "blender", tmp_path / "part"), tmp_path)
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(picture, expected, rel=0.001), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("(scale[0], scale[1], 1.0)", "(scale[0], -scale[1], 1.0)"),
        ("item.data.uv_layers[1].name", "item.data.uv_layers[0].name"),
        ("exposure / math.pi", "exposure"),
        ('colorspace_settings.name = "Non-Color"', 'colorspace_settings.name = "sRGB"'),
    ],
    ids=["v turned over", "first uv map", "no pi", "srgb"],
)
def test_a_wrong_export_fails(probe, tmp_path, right, wrong):
    copy = changed(probe / "blender", tmp_path / "wrong", "import_lightmaps.py", right, wrong)
    assert shows_something_else(draw(copy, tmp_path))


def test_srgb_numbers_in_the_pages_fail(tmp_path):
    out = write_probe(tmp_path / "srgb", "blender", page=srgb_page())
    assert shows_something_else(draw(out / "blender", tmp_path))


def test_instances_of_a_mesh_have_their_own_places(tmp_path):
    out = write_shared_probe(tmp_path, "blender")
    assert shows_the_squares(draw(out / "blender", tmp_path))
    right, wrong = 'slot.link = "OBJECT"', 'slot.link = "DATA"'
    copy = changed(out / "blender", tmp_path / "wrong", "import_lightmaps.py", right, wrong)
    assert not shows_the_squares(draw(copy, tmp_path))
