"""Poses the nodes of a glTF document as an animation does at a time.

Translation, rotation, scale and morph weights of nodes are interpolated between the two keys around the time;
before the first and after the last key, the value of that key applies. Other targets (KHR_animation_pointer)
are not read.

Based on: Khronos Group, glTF 2.0 Specification, section 3.11 and appendix C.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.read_options import ReadOptions
from baker.core.scene import SceneWarning
from baker.io.gltf.accessor import read_accessor
from baker.io.gltf.choose_scene import named_index
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

_PATHS = {"translation": ("VEC3",), "rotation": ("VEC4",), "scale": ("VEC3",), "weights": ("SCALAR",)}
_POINTER = "KHR_animation_pointer"


def posed_nodes(
    document: GltfDocument, options: ReadOptions, warnings: list[SceneWarning]
) -> list[JsonObject]:
    """Return all nodes of a document; nodes that the animation moves are copies with changed members.

    Parameters
    ----------
    document : GltfDocument
        The document; not changed.
    options : ReadOptions
        `animation` and `time`. Without both, no node is moved.
    warnings : list of SceneWarning
        A warning is added for each animation with a target that is not read.

    Returns
    -------
    list of JsonObject
        The nodes, in the order of the file.

    Raises
    ------
    InputError
        If the animation is malformed.
    SettingsError
        If the file has no animation of that name or number.
    """
    nodes = list(document.root.children("nodes"))
    animations = document.root.children("animations")
    posed = options.time is not None or options.animation is not None
    number = None
    if posed:
        asked = "0" if options.animation is None else options.animation
        number = named_index(animations, asked, "animation", document.root.file)
    warnings += _unread_targets(animations, number)
    if number is None:
        return nodes
    time = 0.0 if options.time is None else options.time
    moved: dict[int, dict[str, list[float]]] = {}
    samplers = animations[number].children("samplers")
    for channel in animations[number].children("channels"):
        target = channel.child("target")
        path = target.string("path")
        if path not in _PATHS or "node" not in target:
            continue
        node = target.index("node", len(nodes), "nodes")
        if path != "weights" and "matrix" in nodes[node]:
            nodes[node].fail("an animated node may not have a matrix", "matrix")
        sampler = samplers[channel.index("sampler", len(samplers), "samplers")]
        moved.setdefault(node, {})[path] = _value(document, sampler, path, time).tolist()
    for node, members in moved.items():
        nodes[node] = JsonObject({**nodes[node].value, **members}, nodes[node].where, nodes[node].file)
    return nodes


def _unread_targets(animations: list[JsonObject], chosen: int | None) -> list[SceneWarning]:
    """Return a warning for each animation that changes visibility, or that is chosen and has pointers."""
    found = []
    for number, animation in enumerate(animations):
        try:
            pointers = _pointers(animation)
            name = animation.string("name", f"animation_{number}")
        except InputError:
            # A bake does not need this animation, unless it is the chosen one, whose errors are raised later.
            continue
        if number != chosen:
            pointers = [pointer for pointer in pointers if "KHR_node_visibility" in pointer]
        if pointers:
            message = f"the animation changes {pointers[0]} ({_POINTER}), which a bake does not read"
            found.append(SceneWarning("animation-pointer", message, name))
    return found


def _pointers(animation: JsonObject) -> list[str]:
    """Return the pointers that the channels of an animation have as targets."""
    targets = [channel.child_or_empty("target") for channel in animation.children("channels")]
    extensions = [target.extension(_POINTER) for target in targets]
    return [extension.string("pointer", "") for extension in extensions if extension is not None]


def _value(document: GltfDocument, sampler: JsonObject, path: str, time: float) -> NDArray[np.float64]:
    """Return the value of a sampler at a time: (3,), (4,), or one weight for each morph target."""
    accessors = document.root.children("accessors")

    def read(key: str, types: tuple[str, ...]) -> NDArray[np.float64]:
        at = sampler.index(key, len(accessors), "accessors")
        return read_accessor(document, at, types=types).astype(np.float64)

    key = read("input", ("SCALAR",))[:, 0]
    mode = sampler.string("interpolation", "LINEAR")
    if mode not in ("LINEAR", "STEP", "CUBICSPLINE"):
        sampler.fail(f"'{mode[:20]}' is none of LINEAR, STEP, CUBICSPLINE", "interpolation")
    if not (np.isfinite(key).all() and (np.diff(key) > 0).all()):
        sampler.fail("the times of the keys do not increase", "input")
    output = read("output", _PATHS[path])
    parts = 3 if mode == "CUBICSPLINE" else 1
    rows = len(key) * parts
    if len(output) % rows or (path != "weights" and len(output) != rows):
        sampler.fail(f"it has {len(output)} values for {len(key)} keys", "output")
    # (keys, tangents and value, components)
    output = output.reshape(len(key), parts, -1)
    if not np.isfinite(output).all():
        sampler.fail("a number is not finite", "output")
    k = int(np.clip(np.searchsorted(key, time, side="right") - 1, 0, len(key) - 1))
    middle = parts // 2
    if mode == "STEP" or k == len(key) - 1 or time <= key[0]:
        found = output[k, middle]
    elif mode == "LINEAR":
        share = (time - key[k]) / (key[k + 1] - key[k])
        blend = slerp if path == "rotation" else _lerp
        found = blend(output[k, 0], output[k + 1, 0], share)
    else:
        seconds = float(key[k + 1] - key[k])
        found = _spline(output[k], output[k + 1], (time - key[k]) / seconds, seconds)
    if path == "rotation":
        found = found / max(float(np.linalg.norm(found)), 1e-300)
    return np.asarray(found, np.float64)


def _lerp(a: NDArray[np.float64], b: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    return a + share * (b - a)


def slerp(a: NDArray[np.float64], b: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return the spherical linear interpolation of two unit quaternions, along the shorter arc.

    Parameters
    ----------
    a, b : (4,) float64
        Quaternions x, y, z, w.
    share : float
        0 for `a`, 1 for `b`.

    Returns
    -------
    (4,) float64
        The quaternion between them.
    """
    cosine = float(a @ b)
    if cosine < 0.0:
        b, cosine = -b, -cosine
    if cosine > 1.0 - 1e-9:
        return _lerp(a, b, share)
    angle = math.acos(cosine)
    found: NDArray[np.float64] = math.sin((1.0 - share) * angle) * a + math.sin(share * angle) * b
    return found / math.sin(angle)


def _spline(a: NDArray[np.float64], b: NDArray[np.float64], s: float, seconds: float) -> NDArray[np.float64]:
    """Return the cubic Hermite spline between two keys.

    a, b : (3, components) in-tangent, value and out-tangent of the keys; seconds : time between the keys
    """
    found: NDArray[np.float64] = (
        (2 * s**3 - 3 * s**2 + 1) * a[1]
        + seconds * (s**3 - 2 * s**2 + s) * a[2]
        + (-2 * s**3 + 3 * s**2) * b[1]
        + seconds * (s**3 - s**2) * b[0]
    )
    return found
