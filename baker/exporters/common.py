"""Writes what exports share: `lightmap.json`, copies of a bake's files, unique node names, README.md."""

from __future__ import annotations

import copy
import json
import os
import re
import shutil
import struct
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from baker.core.encoding import DecodedImage, encoding_of
from baker.core.printable import json_text
from baker.io.gltf.packer import objects

MANIFEST_NAME = "bake.json"
SCENE_NAME = "scene.glb"
DESCRIPTION_NAME = "lightmap.json"
# Types of lights that every reader of KHR_lights_punctual knows.
STANDARD_LIGHTS = ("directional", "point", "spot")
# Key of the manifest and of `lightmap.json`.
EXPOSURE_KEY = "suggested_exposure"
# Header attributes of a page that `write_page` copies, because they stay valid after a division.
_KEPT = ("colourSpace", "software")


def read_manifest(bake: Path) -> dict[str, Any]:
    """Return the manifest of a bake.

    The manifest is not validated, because either the running bake has written it, or `baker.export` has
    called `read_bake`, which validates it.
    """
    manifest: dict[str, Any] = json.loads((bake / MANIFEST_NAME).read_text("utf-8"))
    return manifest


def irradiance_pages(manifest: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the manifest entries of the irradiance pages, sorted by page number."""
    pages = [page for page in manifest["pages"] if page["channel"] == "irradiance"]
    return sorted(pages, key=lambda page: int(page["page"]))


def describe(manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `lightmap.json`: pages, suggested exposure, page and uv transform of each object.

    The uv in a page is `TEXCOORD_1 * uv_scale + uv_offset`; v = 0 is the first image row.
    """
    return {
        "version": 1,
        "scene": SCENE_NAME,
        "quantity": "irradiance",
        "unit": "lx",
        EXPOSURE_KEY: manifest.get(EXPOSURE_KEY),
        "pages": [
            {"file": page["file"], "width": page["width"], "height": page["height"]}
            for page in irradiance_pages(manifest)
        ],
        "objects": [
            {key: entry[key] for key in ("node", "name", "page", "uv_scale", "uv_offset")}
            for entry in manifest["instances"]
        ],
    }


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8, with line feeds as line ends on every system."""
    path.write_text(text, "utf-8", newline="\n")


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Write indented JSON."""
    write_text(path, json_text(value, indent=2) + "\n")


def link_file(source: Path, target: Path) -> None:
    """Create `target` as a hard link to the file `source`, or as a copy if that is not possible."""
    try:
        os.link(source, target)
    except OSError:
        # Not every file system has hard links.
        shutil.copy2(source, target)


def place_scene(bake: Path, target: Path, edit: Callable[[dict[str, Any]], bool] | None = None) -> None:
    """Put `scene.glb` of a bake into `target`, with lights that every loader knows.

    Parameters
    ----------
    bake : Path
        Folder of the bake.
    target : Path
    edit : callable or None
        Called with the document, which it may change; returns whether it has.
    """
    with (bake / SCENE_NAME).open("rb") as file:
        document = _read_document(file)
        edited = edit is not None and edit(document)
        changed = _glb(document, file.read()) if _replace_lights(document) or edited else None
    if changed is None:
        link_file(bake / SCENE_NAME, target / SCENE_NAME)
    else:
        (target / SCENE_NAME).write_bytes(changed)


def place_bake(bake: Path, target: Path, *, encodings: tuple[str, ...] = ()) -> dict[str, Any]:
    """Put scene, irradiance pages and `lightmap.json` into `target`; return the JSON content.

    Parameters
    ----------
    bake : Path
        Folder of the bake.
    target : Path
    encodings : tuple of str
        Encodings whose files are also placed, if the bake has them. The page's entry in `lightmap.json` lists
        them with file and largest value.
    """
    manifest = read_manifest(bake)
    description = describe(manifest)
    place_scene(bake, target)
    for page, source in zip(description["pages"], irradiance_pages(manifest), strict=True):
        page["encodings"] = {
            entry["encoding"]: {"file": entry["file"], "max": entry["max"]}
            for entry in source.get("encodings", [])
            if entry["encoding"] in encodings
        }
        for placed in (page, *page["encodings"].values()):
            link_file(bake / placed["file"], target / placed["file"])
    write_json(target / DESCRIPTION_NAME, description)
    return description


def place_web_bake(bake: Path, target: Path) -> None:
    """Place a bake as `place_bake` does, with the encodings for web pages and the module that reads RGBM."""
    description = place_bake(bake, target, encodings=("ktx2", "webp"))
    if any("webp" in page["encodings"] for page in description["pages"]):
        write_text(target / "rgbm.js", template("web", "rgbm.js"))


def decode_page(bake: Path, file: str) -> DecodedImage:
    """Return the pixels and the header of a page of a bake."""
    encoding = encoding_of(file)
    assert encoding is not None, "the bake wrote this file itself"
    return encoding.decode(bake / file)


def write_page(bake: Path, file: str, target: Path, *, divisor: float, quantity: str, unit: str) -> None:
    """Write a page of the bake, divided by a number, to the file `target`.

    Parameters
    ----------
    bake : Path
        Folder of the bake.
    file : str
        Name of the page in the bake.
    target : Path
        Its suffix selects the file format. If `file` has the same suffix, the number format is that of
        `file`.
    divisor : float
    quantity, unit : str
        Meaning of the written numbers, for the header of the file.
    """
    image, encoding = decode_page(bake, file), encoding_of(target.name)
    assert encoding is not None, "exports choose suffixes of encodings"
    header = {key: image.header[key] for key in _KEPT if key in image.header}
    header |= {"quantity": quantity, "unit": unit}
    pixels = (image.pixels.astype(np.float64) / divisor).astype(np.float32)
    encoding.encode(target, pixels, options=encoding.options_of_image(image), header=header)


def template(export: str, name: str) -> str:
    """Return the text of the file `name` in the templates of an export."""
    return resources.files("baker.exporters").joinpath("templates", export, name).read_text("utf-8")


def write_readme(
    bake: Path, target: Path, title: str, *, scale: str, uv: str, rows: str, steps: tuple[str, ...]
) -> None:
    """Write README.md of an export: steps for the user, and conventions in which engines differ.

    If the bake has irradiance, a last line gives the suggested exposure of its manifest.

    Parameters
    ----------
    bake : Path
        Folder of the bake.
    target : Path
    title : str
    scale, uv, rows : str
        Quantity and unit of the pages, uv set of the lookups, and order of the image rows.
    steps : tuple of str
        Instructions for the user, line by line.
    """
    lines = [f"# {title}", "", *steps, ""]
    lines += [f"- Scale: {scale}", f"- UV set: {uv}", f"- Row order: {rows}"]
    exposure = read_manifest(bake).get(EXPOSURE_KEY)
    if exposure is not None:
        lines.append(
            f"- Exposure: for a display, multiply albedo x E / pi by {exposure:g} (`{EXPOSURE_KEY}`)."
        )
    write_text(target / "README.md", "\n".join(lines) + "\n")


def named_scene(bake: Path) -> tuple[dict[str, Any], dict[str, Any], bytes]:
    """Read scene.glb with a unique name for each node, for engines that identify nodes by name.

    The name of node i is its old name, with characters that engines interpret replaced by `_`, followed by
    `_n<i>`. The mesh of a baked node gets the name of its first node, and `extras.baker_node` is i.

    Parameters
    ----------
    bake : Path
        Folder of the bake.

    Returns
    -------
    document : dict
        The glTF document with the new names.
    description : dict
        The content of `lightmap.json` with the new names.
    binary : bytes
        The binary chunk with its 8-byte header.
    """
    description = describe(read_manifest(bake))
    with (bake / SCENE_NAME).open("rb") as file:
        document, binary = _read_document(file), file.read()
    _replace_lights(document)
    nodes = document.get("nodes", [])
    for index, node in objects(document, "nodes"):
        node["name"] = unique_name(str(node.get("name", "node")), index)
        extras = node.setdefault("extras", {})
        if isinstance(extras, dict):
            # The plugin for Bevy finds the last member in the text of the extras, without a JSON parser.
            extras.pop("baker_node", None)
            extras["baker_node"] = index
    first: dict[int, str] = {}
    for entry in description["objects"]:
        node = nodes[entry["node"]]
        entry["name"] = node["name"]
        if "mesh" in node:
            name = first.setdefault(node["mesh"], node["name"])
            document["meshes"][node["mesh"]]["name"] = name
    return document, description, binary


def separate_meshes(document: dict[str, Any], manifest: dict[str, Any]) -> dict[int, int]:
    """Give each baked node a mesh of its own, which refers to the same accessors as the shared one.

    Parameters
    ----------
    document : dict
        Document of scene.glb; `meshes` and `nodes` are changed in place.
    manifest : dict
        Content of bake.json.

    Returns
    -------
    dict of int to int
        Index of the mesh of each baked node.
    """
    result: dict[int, int] = {}
    taken: set[int] = set()
    for entry in manifest["instances"]:
        node, mesh = entry["node"], entry["mesh"]
        if mesh in taken:
            document["meshes"].append(copy.deepcopy(document["meshes"][mesh]))
            mesh = document["nodes"][node]["mesh"] = len(document["meshes"]) - 1
        taken.add(mesh)
        result[node] = mesh
    return result


def write_scene(target: Path, document: dict[str, Any], binary: bytes) -> None:
    """Write scene.glb into `target`; `binary` is the binary chunk with its 8-byte header."""
    (target / SCENE_NAME).write_bytes(_glb(document, binary))


def place_named_scene(bake: Path, target: Path) -> dict[str, Any]:
    """Write the scene with unique names into `target`; return the content of `lightmap.json`."""
    document, description, binary = named_scene(bake)
    write_scene(target, document, binary)
    return description


def place_named_bake(bake: Path, target: Path) -> dict[str, Any]:
    """Write pages, `lightmap.json` and the scene with unique names into `target`; return the JSON content."""
    description = place_named_scene(bake, target)
    place_description(bake, target, description)
    return description


def place_description(bake: Path, target: Path, description: dict[str, Any]) -> None:
    """Put the pages of `lightmap.json` and the file itself into `target`."""
    for page in description["pages"]:
        link_file(bake / page["file"], target / page["file"])
    write_json(target / DESCRIPTION_NAME, description)


def unique_name(name: str, number: int, kind: str = "n") -> str:
    """Return a name that engines do not change and that no other node has; `kind` is "n" for nodes."""
    safe = re.sub(r"[^0-9A-Za-z_]+", "_", name).strip("_") or "node"
    # Keep names short, because Blender truncates them to 63 bytes.
    return f"{safe[:48]}_{kind}{number}"


def _replace_lights(document: dict[str, Any]) -> bool:
    """Replace lights whose type is not in KHR_lights_punctual by black point lights; return whether any was.

    Loaders refuse a file with an unknown type. The pages contain the light of all lights.
    """
    holder = document.get("extensions", {}).get("KHR_lights_punctual", {})
    foreign = [n for n, light in objects(holder, "lights") if light.get("type") not in STANDARD_LIGHTS]
    table = holder.get("lights", [])
    for number in foreign:
        name = {"name": table[number]["name"]} if "name" in table[number] else {}
        table[number] = {**name, "type": "point", "intensity": 0.0}
    return bool(foreign)


def black_lights(document: dict[str, Any]) -> None:
    """Set the intensity of all lights to 0, for loaders that cannot hide them; types become standard ones."""
    _replace_lights(document)
    for _, light in objects(document.get("extensions", {}).get("KHR_lights_punctual", {}), "lights"):
        light["intensity"] = 0.0


def _read_document(file: BinaryIO) -> dict[str, Any]:
    """Read the glTF document of a GLB; the file is then at the binary chunk."""
    (length,) = struct.unpack_from("<I", file.read(20), 12)
    document: dict[str, Any] = json.loads(file.read(length))
    return document


def _glb(document: dict[str, Any], binary: bytes) -> bytes:
    """Return a GLB of a document; `binary` is the binary chunk with its 8-byte header."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<IIIII", 0x46546C67, 2, 20 + len(text) + len(binary), len(text), 0x4E4F534A)
    return head + text + binary
