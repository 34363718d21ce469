"""Reads JSON and accessors, also sparse accessors, of GLB files for tests, without code of `baker`."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

_DTYPE = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """A parsed GLB file: JSON document and binary chunk."""

    def __init__(self, data: bytes | Path) -> None:
        data = data.read_bytes() if isinstance(data, Path) else data
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        self.binary = b""
        if len(data) > 20 + size:
            length, kind = struct.unpack_from("<I4s", data, 20 + size)
            assert kind == b"BIN\0"
            self.binary = data[28 + size : 28 + size + length]
            assert len(self.binary) == length == self.json["buffers"][0]["byteLength"]
            # Chunks of unknown types may follow.
            self.further = data[28 + size + length :]

    def view(self, index: int) -> bytes:
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        assert start + view["byteLength"] <= len(self.binary)
        return self.binary[start : start + view["byteLength"]]

    def accessor(self, index: int) -> np.ndarray:
        """Return (count, width) numbers of an accessor, in the stored component type."""
        item = self.json["accessors"][index]
        dtype, width = np.dtype(_DTYPE[item["componentType"]]), _WIDTH[item["type"]]
        out = np.zeros((item["count"], width), dtype)
        if "bufferView" in item:
            view = self.json["bufferViews"][item["bufferView"]]
            raw, stride = self.view(item["bufferView"]), view.get("byteStride", dtype.itemsize * width)
            for row in range(item["count"]):
                out[row] = np.frombuffer(raw, dtype, width, item.get("byteOffset", 0) + row * stride)
        if "sparse" in item:
            sparse = item["sparse"]
            kind = np.dtype(_DTYPE[sparse["indices"]["componentType"]])
            rows = np.frombuffer(self.view(sparse["indices"]["bufferView"]), kind, sparse["count"])
            values = np.frombuffer(self.view(sparse["values"]["bufferView"]), dtype, sparse["count"] * width)
            out[rows] = values.reshape(-1, width)
        return out

    def corners(self, primitive: dict[str, Any], name: str, *, target: int | None = None) -> np.ndarray:
        """Return (T, 3, width): an attribute of a primitive or of a morph target, at triangle corners."""
        holder = primitive["attributes"] if target is None else primitive["targets"][target]
        values = self.accessor(holder[name])
        if "indices" not in primitive:
            return values.reshape(-1, 3, values.shape[1])
        return values[self.accessor(primitive["indices"]).astype(np.int64).reshape(-1, 3)]
