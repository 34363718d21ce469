"""Reads perspective cameras, placed by their nodes: they look along -Z, +Y is up.

Based on: Khronos Group, glTF 2.0 Specification, section 3.10.
"""

from __future__ import annotations

import math

import numpy as np

from baker.core.scene import Camera
from baker.io.gltf_document import GltfDocument
from baker.io.gltf_node import Placed


def read_cameras(placed: list[Placed], document: GltfDocument) -> list[Camera]:
    """Return the perspective cameras of the scene's nodes, in their order; others are left out.

    Raises
    ------
    InputError
        For a field of view out of range.
    """
    cameras = []
    known = document.root.children("cameras")
    for node in placed:
        if "camera" not in node.json:
            continue
        camera = known[node.json.index("camera", len(known), "cameras")]
        axes = node.matrix[:3, :3]
        length = np.linalg.norm(axes, axis=0)
        if camera.string("type") != "perspective" or not (length > 0).all():
            continue
        right, up, back = (axes / length).T
        x, y, z = (float(v) for v in node.matrix[:3, 3])
        cameras.append(
            Camera(
                name=node.json.string("name", f"camera_{node.index}"),
                node=node.index,
                position=(x, y, z),
                right=(float(right[0]), float(right[1]), float(right[2])),
                up=(float(up[0]), float(up[1]), float(up[2])),
                forward=(-float(back[0]), -float(back[1]), -float(back[2])),
                fov=camera.child("perspective").number("yfov", math.pi / 4, low=1e-4, high=math.pi - 1e-4),
            )
        )
    return cameras
