"""Compresses the views of a `GltfBuilder` with the simplest codes of meshopt, without code of `baker`."""

from __future__ import annotations

from typing import Any

import numpy as np
from gltf_builder import GltfBuilder


def compress(builder: GltfBuilder, name: str = "EXT_meshopt_compression", **placeholder: Any) -> GltfBuilder:
    """Return a builder in which the views of all accessors are compressed; buffer 1 is a placeholder.

    `placeholder` : further members of the placeholder buffer
    """
    packed = GltfBuilder()
    packed.json = builder.json
    views = builder.json.pop("bufferViews")
    uncompressed = 0
    indices = {p.get("indices") for mesh in builder.json["meshes"] for p in mesh["primitives"]}
    kinds = {a["bufferView"]: (k in indices, a) for k, a in enumerate(builder.json["accessors"])}
    for number, view in enumerate(views):
        data = builder.blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        if number not in kinds:
            packed.view(data)
            continue
        is_index, accessor = kinds[number]
        stride = len(data) // accessor["count"]
        stream = pack_indices(data, stride) if is_index else pack_attributes(data, stride)
        compressed = packed.view(stream)
        extension = {
            **packed.json["bufferViews"][compressed],
            "byteStride": stride,
            "count": accessor["count"],
            "mode": "INDICES" if is_index else "ATTRIBUTES",
        }
        packed.json["bufferViews"][compressed] = {
            "buffer": 1,
            "byteOffset": uncompressed,
            "byteLength": len(data),
            "extensions": {name: extension},
        }
        uncompressed += len(data) + -len(data) % 4
    packed.json["buffers"] = [
        {"byteLength": len(packed.blob)},
        {"byteLength": uncompressed, "extensions": {name: {"fallback": True}}, **placeholder},
    ]
    for key in ("extensionsUsed", "extensionsRequired"):
        packed.json[key] = [*packed.json.get(key, []), name]
    return packed


def pack_attributes(data: bytes, stride: int) -> bytes:
    """Return a stream of version 0 with one block, at most 256 elements; differences are stored as bytes."""
    element = np.frombuffer(data, np.uint8).reshape(-1, stride).astype(np.int16)
    assert len(element) <= min(256, 8192 // stride // 16 * 16)
    groups = -(-len(element) // 16)
    delta = np.diff(element, axis=0, prepend=element[:1]).astype(np.int8).astype(np.int16)
    coded = np.zeros((16 * groups, stride), np.uint8)
    coded[: len(delta)] = np.where(delta < 0, -2 * delta - 1, 2 * delta)
    planes = b"".join(b"\xff" * (-(-groups // 4)) + coded[:, k].tobytes() for k in range(stride))
    return b"\xa0" + planes + bytes(max(32 - stride, 0)) + element[0].astype(np.uint8).tobytes()


def pack_indices(data: bytes, stride: int) -> bytes:
    """Return a stream of the mode INDICES. It stores each index as the difference from the previous one."""
    out, last = bytearray(b"\xd1"), 0
    for index in np.frombuffer(data, f"<u{stride}").tolist():
        delta, last = index - last, index
        code = 2 * (-2 * delta - 1 if delta < 0 else 2 * delta)
        while code > 127:
            out.append(code & 127 | 128)
            code >>= 7
        out.append(code)
    return bytes(out) + bytes(4)
