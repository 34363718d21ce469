"""Writes meshes, materials, nodes and lights to a GLB file. The same scene always gives the same bytes.

This module is independent of the importer, because its files are used to test the importer.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapes import Surface

ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963
UNSIGNED_SHORT = 5123
FLOAT = 5126


class GlbBuilder:
    """Collects a scene and writes it."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._meshes: dict[str, int] = {}
        self._materials: dict[str, int] = {}
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "baker assets/make_scenes.py"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def material(
        self,
        name: str,
        colour: tuple[float, float, float],
        *,
        emission: tuple[float, float, float] | None = None,
        texture: NDArray[np.uint8] | None = None,
        roughness: float = 0.9,
        alpha: float = 1.0,
        mode: str = "OPAQUE",
        double_sided: bool = False,
        emission_texture: NDArray[np.uint8] | None = None,
    ) -> str:
        """Add a material and return its name.

        Parameters
        ----------
        name : str
        colour : 3 floats
            Linear base colour.
        emission : 3 floats or None
            Radiance, cd/m2.
        texture : (H, W, 3 or 4) uint8 or None
            Colours, sRGB, and alpha, multiplied with `colour` and `alpha`.
        roughness : float
        alpha : float
        mode : "OPAQUE", "MASK" (opaque where alpha is at least 0.5) or "BLEND"
        double_sided : bool
        emission_texture : (H, W, 3) uint8 or None
            Colours, sRGB, multiplied with `emission`.
        """
        surface: dict[str, Any] = {
            "baseColorFactor": [*colour, alpha],
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
        if texture is not None:
            surface["baseColorTexture"] = {"index": self._texture(name, texture)}
        entry: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface}
        if emission is not None:
            strength = max(emission)
            entry["emissiveFactor"] = [part / strength for part in emission]
            entry["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            self._use("KHR_materials_emissive_strength")
        if emission_texture is not None:
            entry["emissiveTexture"] = {"index": self._texture(f"{name} glow", emission_texture)}
        if mode != "OPAQUE":
            entry["alphaMode"] = mode
        if double_sided:
            entry["doubleSided"] = True
        self._materials[name] = len(self._json["materials"])
        self._json["materials"].append(entry)
        return name

    def mesh(self, name: str, parts: list[tuple[Surface, str]]) -> str:
        """Add a mesh and return its name. It has one primitive for each pair (surface, material name)."""
        primitives = []
        for surface, material in parts:
            if len(surface.position) > 65535:
                raise ValueError(f"{name} needs more than 16 bits of vertex index")
            attributes = {
                "POSITION": self._accessor(surface.position.astype("<f4"), "VEC3", bounds=True),
                "NORMAL": self._accessor(surface.normal.astype("<f4"), "VEC3"),
            }
            if surface.uv is not None:
                attributes["TEXCOORD_0"] = self._accessor(surface.uv.astype("<f4"), "VEC2")
            index = self._accessor(surface.triangle.astype("<u2").reshape(-1), "SCALAR")
            primitives.append(
                {"attributes": attributes, "indices": index, "material": self._materials[material]}
            )
        self._meshes[name] = len(self._json["meshes"])
        self._json["meshes"].append({"name": name, "primitives": primitives})
        return name

    def place(
        self,
        name: str,
        mesh: str,
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        turn: float = 0.0,
        scale: float = 1.0,
    ) -> None:
        """Add a node with a mesh: `at` is its position in metres, `turn` its rotation about +Y in degrees."""
        node: dict[str, Any] = {"name": name, "mesh": self._meshes[mesh]}
        if any(at):
            node["translation"] = list(at)
        if turn:
            half = math.radians(turn) / 2
            node["rotation"] = [0.0, _rounded(math.sin(half)), 0.0, _rounded(math.cos(half))]
        if scale != 1.0:
            node["scale"] = [scale] * 3
        self._node(node)

    def light(
        self,
        name: str,
        kind: str,
        intensity: float,
        *,
        colour: tuple[float, float, float] = (1.0, 1.0, 1.0),
        at: tuple[float, float, float] = (0.0, 0.0, 0.0),
        towards: tuple[float, float, float] | None = None,
    ) -> None:
        """Add a light of KHR_lights_punctual.

        `intensity` is in cd for point and spot lights, and in lx for directional lights. `towards` is the
        direction in which the light of a spot or directional light travels.
        """
        extension = self._json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        self._use("KHR_lights_punctual")
        node: dict[str, Any] = {"name": name}
        node["extensions"] = {"KHR_lights_punctual": {"light": len(extension["lights"])}}
        extension["lights"].append(
            {"name": name, "type": kind, "color": list(colour), "intensity": intensity}
        )
        if any(at):
            node["translation"] = list(at)
        if towards is not None:
            node["rotation"] = _looking(towards)
        self._node(node)

    def camera(
        self, at: tuple[float, float, float], target: tuple[float, float, float], field_of_view: float
    ) -> None:
        """Add a pinhole camera at `at` that looks to `target`; vertical field of view in degrees."""
        perspective = {"yfov": _rounded(math.radians(field_of_view)), "znear": 0.01}
        self._json["cameras"] = [{"type": "perspective", "perspective": perspective}]
        towards = (target[0] - at[0], target[1] - at[1], target[2] - at[2])
        self._node({"name": "camera", "camera": 0, "translation": list(at), "rotation": _looking(towards)})

    def write(self, path: Path) -> None:
        """Write the GLB file."""
        self._json["buffers"] = [{"byteLength": len(self._bytes)}]
        text = json.dumps(self._json, separators=(",", ":"), sort_keys=True).encode()
        text += b" " * (-len(text) % 4)
        body = bytes(self._bytes) + b"\0" * (-len(self._bytes) % 4)
        total = 12 + 8 + len(text) + 8 + len(body)
        path.write_bytes(
            struct.pack("<4sII", b"glTF", 2, total)
            + struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(body), b"BIN\0")
            + body
        )

    def _node(self, node: dict[str, Any]) -> None:
        self._json["scenes"][0]["nodes"].append(len(self._json["nodes"]))
        self._json["nodes"].append(node)

    def _use(self, extension: str) -> None:
        used = self._json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._bytes += b"\0" * (-len(self._bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._bytes += data
        self._json["bufferViews"].append(view)
        return len(self._json["bufferViews"]) - 1

    def _accessor(self, values: NDArray[Any], kind: str, *, bounds: bool = False) -> int:
        scalar = kind == "SCALAR"
        entry: dict[str, Any] = {
            "bufferView": self._view(values.tobytes(), ELEMENT_ARRAY_BUFFER if scalar else ARRAY_BUFFER),
            "componentType": UNSIGNED_SHORT if scalar else FLOAT,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            entry["min"] = [float(low) for low in values.min(axis=0)]
            entry["max"] = [float(high) for high in values.max(axis=0)]
        self._json["accessors"].append(entry)
        return len(self._json["accessors"]) - 1

    def _texture(self, name: str, pixel: NDArray[np.uint8]) -> int:
        images = self._json.setdefault("images", [])
        view = self._view(png(pixel))
        images.append({"name": name, "mimeType": "image/png", "bufferView": view})
        self._json.setdefault("samplers", [{"wrapS": 10497, "wrapT": 10497}])
        textures = self._json.setdefault("textures", [])
        textures.append({"source": len(images) - 1, "sampler": 0})
        return len(textures) - 1


def png(pixel: NDArray[np.uint8]) -> bytes:
    """Encode a PNG without compression, so that its bytes do not depend on the version of zlib.

    Parameters
    ----------
    pixel : (H, W, 3 or 4) uint8
    """
    height, width, channels = pixel.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixel.reshape(height, -1)], axis=1).tobytes()
    stored = bytearray(b"\x78\x01")
    for start in range(0, len(rows), 65535):
        block = rows[start : start + 65535]
        last = start + len(block) == len(rows)
        stored += struct.pack("<BHH", last, len(block), len(block) ^ 0xFFFF) + block
    stored += struct.pack(">I", zlib.adler32(rows))
    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", bytes(stored)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def _rounded(value: float) -> float:
    # Round to seven digits, the precision of float32, because the last bits of sin and cos differ between C
    # libraries.
    return round(value, 7)


def _looking(towards: tuple[float, float, float]) -> list[float]:
    """Return the quaternion (x, y, z, w) that turns -Z to the direction `towards` without roll."""
    x, y, z = towards
    half_yaw = math.atan2(-x, -z) / 2
    half_pitch = math.atan2(y, math.hypot(x, z)) / 2
    sy, cy, sp, cp = math.sin(half_yaw), math.cos(half_yaw), math.sin(half_pitch), math.cos(half_pitch)
    return [_rounded(part) for part in (cy * sp, sy * cp, -sy * sp, cy * cp)]
