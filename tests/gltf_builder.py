"""Builds small glTF files for tests from arrays and dictionaries, without code of `baker`."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

_CODE = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
_TYPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}

# The unit square in the xy plane, front towards +z, as four vertices and two triangles.
QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_NORMAL = np.array([[0, 0, 1]] * 4, np.float32)
QUAD_TRIANGLE = np.array([[0, 1, 2], [0, 2, 3]], np.uint16)


class GltfBuilder:
    """Collects buffer views, accessors and JSON members; tests may edit `json` before writing."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}}
        self.blob = b""

    def add(self, key: str, value: dict[str, Any]) -> int:
        """Append to the list `key` of the document and return the index."""
        items = self.json.setdefault(key, [])
        items.append(value)
        return len(items) - 1

    def view(self, data: bytes, **extra: Any) -> int:
        """Append bytes to the buffer, aligned to four bytes, and return the index of their view."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **extra}
        self.blob += data
        return self.add("bufferViews", view)

    def accessor(self, array: np.ndarray, **extra: Any) -> int:
        """Append an accessor of an (N,) or (N, width) array, with its dtype as component type."""
        array = np.ascontiguousarray(array)
        width = 1 if array.ndim == 1 else array.shape[1]
        value = {
            "bufferView": self.view(array.tobytes()),
            "componentType": _CODE[array.dtype.name],
            "count": len(array),
            "type": _TYPE[width],
            **extra,
        }
        return self.add("accessors", value)

    def primitive(
        self, position: np.ndarray, triangle: np.ndarray | None = None, **extra: Any
    ) -> dict[str, Any]:
        """Return a primitive; arrays in `extra` become attributes of that name, other values members."""
        attributes = {"POSITION": self.accessor(position)}
        members = {}
        for key, value in extra.items():
            if isinstance(value, np.ndarray):
                attributes[key] = self.accessor(value)
            else:
                members[key] = value
        primitive = {"attributes": attributes, **members}
        if triangle is not None:
            primitive["indices"] = self.accessor(np.asarray(triangle).reshape(-1))
        return primitive

    def mesh(self, *primitives: dict[str, Any], **extra: Any) -> int:
        """Append a mesh and return its index."""
        return self.add("meshes", {"primitives": list(primitives), **extra})

    def node(self, **members: Any) -> int:
        """Append a node and return its index."""
        return self.add("nodes", members)

    def image(self, data: bytes, **texture: Any) -> int:
        """Append a texture with an embedded PNG and return the texture's index."""
        source = self.add("images", {"bufferView": self.view(data), "mimeType": "image/png"})
        return self.add("textures", {"source": source, **texture})

    def document(self, *, embed: bool = False) -> dict[str, Any]:
        """Return the JSON document; if it has no scenes, add one of all root nodes."""
        out = dict(self.json)
        if "scenes" not in out:
            children = {c for n in out.get("nodes", []) for c in n.get("children", [])}
            roots = [k for k in range(len(out.get("nodes", []))) if k not in children]
            out["scenes"] = [{"nodes": roots}] if roots else [{}]
        if self.blob and "buffers" not in out:
            out["buffers"] = [{"byteLength": len(self.blob)}]
            if embed:
                body = base64.b64encode(self.blob).decode()
                out["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{body}"
        return out

    def glb(self) -> bytes:
        """Return the file as GLB bytes."""
        return pack_glb(self.document(), self.blob)

    def gltf(self) -> bytes:
        """Return the file as JSON bytes with its buffer as a data URI."""
        return json.dumps(self.document(embed=True)).encode()


def pack_glb(document: dict[str, Any], blob: bytes = b"") -> bytes:
    """Return GLB bytes of a JSON document and a BIN chunk."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    if blob:
        blob = blob + b"\0" * (-len(blob) % 4)
        body += struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def mesh_glb(position: np.ndarray, triangle: np.ndarray, **attributes: Any) -> bytes:
    """Return the GLB bytes of one node with a mesh of (V, 3) positions, (T, 3) triangles and attributes."""
    builder = GltfBuilder()
    triangle = np.asarray(triangle).astype(np.uint32)
    builder.node(mesh=builder.mesh(builder.primitive(position.astype(np.float32), triangle, **attributes)))
    return builder.glb()


def quad_builder(**material: Any) -> GltfBuilder:
    """Return a builder with the unit square on node 0. `material` has the members of its material, if any."""
    builder = GltfBuilder()
    extra = {"material": builder.add("materials", dict(material))} if material else {}
    uv = QUAD[:, :2].copy()
    primitive = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, TEXCOORD_0=uv, **extra)
    builder.node(mesh=builder.mesh(primitive, name="square"), name="place")
    return builder


def write(path: Path, data: bytes | GltfBuilder) -> Path:
    """Write bytes, or a builder as GLB or glTF by the suffix of `path`, and return `path`."""
    if isinstance(data, GltfBuilder):
        data = data.gltf() if path.suffix == ".gltf" else data.glb()
    path.write_bytes(data)
    return path
