"""Random changes of scene files, manifests, images and TOML files, each determined by a seed.

Most mutations change one to three places, and those of float data up to eight. Numbers become extreme or get
another type. Texts become hostile names. Keys are removed, duplicated or exchanged. Bytes are replaced,
repeated, removed or cut off.
"""

from __future__ import annotations

import copy
import json
import struct
from typing import Any

import numpy as np
from numpy.random import Generator

NUMBERS = (
    *(0, 1, -1, 2, 3, 255, 256, 65535, 65536, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, -(2**63), 10**30),
    *(0.5, -0.5, 1e-30, 1e-12, 1e8, 1e20, 1e30, 3.4e38, 1e300, -1e30, float("inf"), float("nan")),
)
TEXTS = (
    *(
        "",
        "a",
        "..",
        "../../etc/passwd",
        "/etc/passwd",
        "a/b",
        "a\\b",
        "\x1b[31mred",
        "line\nbreak",
        "nul\0byte",
    ),
    *(
        "\ud800",
        "é" * 300,
        "VEC3",
        "VEC2",
        "SCALAR",
        "MASK",
        "BLEND",
        "OPAQUE",
        "ao",
        "irradiance",
        "data:,x",
    ),
)
OTHERS: tuple[Any, ...] = (None, True, False, [], {}, [[]], [None], {"a": {}})
FLOATS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-38,
    1e-12,
    1e8,
    1e20,
    -1e20,
    1e30,
    3.4e38,
    np.inf,
    -np.inf,
    np.nan,
    0.5,
    2.0,
)
GLB_HEADER, CHUNK_HEADER = 12, 8


def mutate_json(value: Any, rng: Generator) -> Any:
    """Return a copy of a JSON value with one to three changed places.

    Parameters
    ----------
    value : JSON value
        A tree of dict, list and scalars.
    rng : Generator
        Chooses places and changes.

    Returns
    -------
    JSON value
    """
    changed = copy.deepcopy(value)
    for _ in range(int(rng.integers(1, 4))):
        places = list(_places(changed))
        if not places:
            break
        holder, key = places[int(rng.integers(len(places)))]
        kind = rng.random()
        if kind < 0.12:
            del holder[key]
        elif kind < 0.2:
            other, at = places[int(rng.integers(len(places)))]
            holder[key] = copy.deepcopy(other[at]) if at in range(len(other)) or at in other else None
        elif kind < 0.25 and isinstance(holder, list):
            holder.append(copy.deepcopy(holder[key]))
        else:
            holder[key] = _scalar(holder[key], rng)
    return changed


def _places(value: Any) -> Any:
    """Yield (container, key) of all values below a JSON value; at most 16 items of each list."""
    if isinstance(value, dict):
        items = list(value.items())
    else:
        items = list(enumerate(value))[:16] if isinstance(value, list) else []
    for key, item in items:
        yield value, key
        yield from _places(item)


def _scalar(old: Any, rng: Generator) -> Any:
    """Return a value that replaces `old`; if `old` is a number or text, it mostly has the type of `old`."""
    kind = rng.random()
    if kind < 0.6 and isinstance(old, int | float):
        return NUMBERS[int(rng.integers(len(NUMBERS)))]
    if kind < 0.6 and isinstance(old, str):
        return TEXTS[int(rng.integers(len(TEXTS)))]
    pool = (*NUMBERS, *TEXTS, *OTHERS)
    return copy.deepcopy(pool[int(rng.integers(len(pool)))])


def mutate_bytes(data: bytes, rng: Generator) -> bytes:
    """Return data with replaced, removed or repeated bytes.

    Parameters
    ----------
    data : bytes
        Any content, not empty.
    rng : Generator
        Chooses places and changes.

    Returns
    -------
    bytes
    """
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        kind, at = rng.random(), int(rng.integers(max(len(changed), 1)))
        if kind < 0.15:
            del changed[at:]
        elif kind < 0.3:
            del changed[at : at + int(rng.integers(1, 64))]
        elif kind < 0.4:
            changed[at:at] = changed[at : at + int(rng.integers(1, 64))]
        else:
            width = int(rng.choice([1, 2, 4, 8]))
            changed[at : at + width] = rng.bytes(width) if kind < 0.8 else b"\xff" * width
    return bytes(changed)


def mutate_floats(data: bytes, rng: Generator) -> bytes:
    """Return data in which one to eight aligned words of four bytes are extreme floats or integers.

    Parameters
    ----------
    data : bytes
        Content of a buffer.
    rng : Generator
        Chooses places and values.

    Returns
    -------
    bytes
        As long as `data`.
    """
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        if len(changed) < 4:
            break
        at = 4 * int(rng.integers(len(changed) // 4))
        if rng.random() < 0.8:
            changed[at : at + 4] = struct.pack("<f", FLOATS[int(rng.integers(len(FLOATS)))])
        else:
            changed[at : at + 4] = rng.bytes(4)
    return bytes(changed)


def mutate_glb(data: bytes, rng: Generator) -> bytes:
    """Return a GLB file with a changed document, a changed buffer or changed bytes.

    Parameters
    ----------
    data : bytes
        A valid GLB file.
    rng : Generator
        Chooses places and changes.

    Returns
    -------
    bytes
    """
    length = struct.unpack_from("<I", data, GLB_HEADER)[0]
    start = GLB_HEADER + CHUNK_HEADER
    document, rest = json.loads(data[start : start + length]), data[start + length + CHUNK_HEADER :]
    kind = rng.random()
    if kind < 0.1:
        return mutate_bytes(data, rng)
    if kind < 0.65:
        document = mutate_json(document, rng)
    if kind > 0.55:
        rest = mutate_floats(rest, rng)
    return pack(document, rest)


def pack(document: Any, blob: bytes) -> bytes:
    """Return a GLB file.

    Parameters
    ----------
    document : JSON value
        The glTF document.
    blob : bytes
        The binary chunk.

    Returns
    -------
    bytes
    """
    text = json.dumps(document).encode("utf-8", "surrogatepass")
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, GLB_HEADER + len(chunks)) + chunks


def mutate_toml(text: str, rng: Generator) -> bytes:
    """Return a TOML file with changed lines, values or bytes.

    Parameters
    ----------
    text : str
        A valid TOML file.
    rng : Generator
        Chooses places and changes.

    Returns
    -------
    bytes
        Not always valid UTF-8.
    """
    lines = text.splitlines()
    for _ in range(int(rng.integers(1, 4))):
        at, kind = int(rng.integers(len(lines))), rng.random()
        if kind < 0.15:
            del lines[at : at + 1]
        elif kind < 0.3:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        elif "=" in lines[at]:
            lines[at] = lines[at].split("=")[0] + "= " + _toml_value(rng)
        if not lines:
            lines = [""]
    data = "\n".join(lines).encode("utf-8", "surrogatepass")
    return mutate_bytes(data, rng) if data and rng.random() < 0.2 else data


def _toml_value(rng: Generator) -> str:
    """Return the text of a TOML value, or text that is not valid TOML."""
    raw = ("[" * 2000 + "]" * 2000, "9" * 5000, "{a = {b = 1}}", "1979-05-27T07:32:00Z", "0x1F", "'''a\nb'''")
    pool = (*NUMBERS, *TEXTS, *raw, ["a", 1], [[]], True)
    value = pool[int(rng.integers(len(pool)))]
    if isinstance(value, str) and value not in raw:
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool | float) else str(value)
