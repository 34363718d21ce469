"""Builds the table of the viewer page's addresses and contents, for the server and for exported pages.

The table is complete before the first request, so requests cannot read other files.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import CHANNELS
from baker.core.errors import InputError
from baker.core.names import unknown_name
from baker.io.bake.output_folder import MANIFEST_NAME, own_files
from baker.io.bake.read_bake import StoredBake
from baker.viewer.page_data import page_numbers
from baker.viewer.scene_data import scene_data
from baker.viewer.script import ThreeScript

STATIC = Path(__file__).resolve().parent / "static"
_MIME = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".glb": "model/gltf-binary",
}
_BYTES = "application/octet-stream"
# Content-Security-Policy: forbid scripts, styles and requests from other origins.
POLICY = "default-src 'self'; img-src 'self' data:; base-uri 'none'"

# Response to a request: media type, and a function that returns the bytes.
Answer = tuple[str, Callable[[], bytes]]


def page_answers(bake: StoredBake, three: ThreeScript) -> dict[str, Answer]:
    """Return the answer for each address. Addresses are relative to that of the page, which is "".

    Parameters
    ----------
    bake : StoredBake
        The bake that the page shows.
    three : ThreeScript
        The files of three.js that the page loads.

    Returns
    -------
    dict of str to Answer
        For each address, the media type and a function that returns the bytes.

    Raises
    ------
    InputError
        If the manifest names an unknown channel.
    """
    for name in bake.maps:
        if CHANNELS.get(name) is None:
            file = str(bake.folder / MANIFEST_NAME)
            raise unknown_name("channel", name, CHANNELS.names(), file=file, error=InputError)
    data = scene_data(bake)
    header = {**data.header, "three": {"file": f"three/{three.path.name}", "module": three.module}}
    text = json.dumps(header, allow_nan=False).encode()
    answers: dict[str, Answer] = {
        "": _file(STATIC / "index.html"),
        "scene.json": (_MIME[".json"], lambda: text),
        "geometry.bin": (_BYTES, lambda: data.geometry),
    }
    for path in STATIC.iterdir():
        answers[f"static/{path.name}"] = _file(path)
    for name, path in three.files.items():
        answers[f"three/{name}"] = _file(path)
    for number, image in enumerate(data.images):
        answers[f"image/{number}.bin"] = (_BYTES, partial(_bytes, image))
    for page in range(bake.atlas.n_pages):
        answers[f"status/{page}.bin"] = (_BYTES, partial(_bytes, bake.status[page]))
        for name, value in bake.maps.items():
            if page < len(value):
                answers[f"page/{name}/{page}.bin"] = (_BYTES, partial(_page_bytes, value[page]))
    folder = bake.folder.resolve()
    for name in own_files(folder) or ():
        # Leave out files outside the folder, which a manifest may name through links.
        path = (folder / name).resolve()
        if path.is_relative_to(folder) and path.is_file():
            answers[f"out/{name}"] = _file(path)
    return answers


def _bytes(array: NDArray[Any]) -> bytes:
    return np.ascontiguousarray(array).tobytes()


def _page_bytes(page: NDArray[np.float32]) -> bytes:
    return page_numbers(page).tobytes()


def _file(path: Path) -> Answer:
    return _MIME.get(path.suffix.lower(), _BYTES), path.read_bytes
