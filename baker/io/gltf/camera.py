"""Reads perspective cameras: they look along the -Z axis of their node, with +Y up.

Based on: Khronos Group, glTF 2.0 Specification, section 3.10.
"""

from __future__ import annotations

import math

import numpy as np

from baker.core.errors import InputError
from baker.core.scene import Camera, SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.node import Placed


def read_cameras(placed: list[Placed], document: GltfDocument, warnings: list[SceneWarning]) -> list[Camera]:
    """Return the perspective cameras of the scene, in the order of the nodes.

    Orthographic cameras, and cameras whose node is scaled by 0, are left out.

    Parameters
    ----------
    placed : list of Placed
        Nodes of the scene.
    document : GltfDocument
        The document.
    warnings : list of SceneWarning
        A warning is added for each broken camera. A broken camera is no error, because bakes do not use
        cameras.

    Returns
    -------
    list of Camera
        The cameras in world space.
    """
    cameras = []
    for node in placed:
        if "camera" in node.json:
            try:
                camera = _camera(node, document)
            except InputError as error:
                prefix = f"{error.object}: " if error.object else ""
                message = f"the camera is left out ({prefix}{error.message})"
                warnings.append(SceneWarning("broken-camera", message, _name(node)))
            else:
                cameras += [] if camera is None else [camera]
    return cameras


def _name(node: Placed) -> str:
    return node.json.string("name", f"camera_{node.index}")


def _camera(node: Placed, document: GltfDocument) -> Camera | None:
    known = document.root.children("cameras")
    camera = known[node.json.index("camera", len(known), "cameras")]
    axes = node.matrix[:3, :3]
    length = np.linalg.norm(axes, axis=0)
    if camera.string("type") != "perspective" or not (length > 0).all():
        return None
    right, up, back = (axes / length).T
    x, y, z = (float(v) for v in node.matrix[:3, 3])
    return Camera(
        name=_name(node),
        node=node.index,
        position=(x, y, z),
        right=(float(right[0]), float(right[1]), float(right[2])),
        up=(float(up[0]), float(up[1]), float(up[2])),
        forward=(-float(back[0]), -float(back[1]), -float(back[2])),
        fov=camera.child("perspective").number("yfov", math.pi / 4, low=1e-4, high=math.pi - 1e-4),
    )
