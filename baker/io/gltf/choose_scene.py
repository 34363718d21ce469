"""Chooses the scene of a glTF file by name or number, and places its nodes."""

from __future__ import annotations

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.scene import SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.node import Placed, place_nodes


def choose_scene(
    document: GltfDocument,
    nodes: list[JsonObject],
    asked: str | None,
    warnings: list[SceneWarning],
    *,
    lenient: bool,
) -> tuple[int | None, list[Placed]]:
    """Return the index of the chosen scene (None if the file has no scenes), and the scene's nodes.

    If a scene is asked for, it becomes the default scene of the document, so that `scene.glb` opens with it.

    Parameters
    ----------
    document : GltfDocument
        The document; changed in place.
    nodes : list of JsonObject
        The nodes of the document, in the pose in which they are placed.
    asked : str or None
        Name or number of a scene; None chooses the default scene of the file, or else the first one.
    warnings : list of SceneWarning
        A warning is added if the file has several scenes and none is asked for.
    lenient : bool
        Accept a scene without nodes.

    Raises
    ------
    InputError
        If the scene has no nodes, or its nodes are malformed.
    SettingsError
        If the file has no scene of that name or number.
    """
    root = document.root
    scenes = root.children("scenes")
    if asked is not None:
        number = named_index(scenes, asked, "scene", root.file)
        root.value["scene"] = number
    elif not scenes:
        inside = {k for node in nodes for k in node.indices("children", len(nodes), "nodes")}
        return None, place_nodes(nodes, [k for k in range(len(nodes)) if k not in inside])
    else:
        number = root.index("scene", len(scenes), "scenes", 0)
        if len(scenes) > 1:
            message = f"the file has {len(scenes)} scenes; scene {number} is taken"
            warnings.append(SceneWarning("several-scenes", message, scenes[number].string("name", "")))
    roots = scenes[number].indices("nodes", len(nodes), "nodes")
    if not roots and not lenient:
        scenes[number].fail("there is nothing to bake: the scene has no nodes")
    return number, place_nodes(nodes, roots)


def named_index(items: list[JsonObject], asked: str, what: str, file: str) -> int:
    """Return the index of the item whose name is `asked`; without such an item, the number `asked`.

    Parameters
    ----------
    items : list of JsonObject
        Items of the document. If several have the name, the first one is chosen.
    asked : str
        Name or number.
    what : str
        What the items are, in the singular.
    file : str
        Name of the file, for messages.

    Returns
    -------
    int
        Index of the item.

    Raises
    ------
    SettingsError
        If there is no such item. The message lists the names.
    """
    names = [item.string("name", "") for item in items]
    if asked in names:
        return names.index(asked)
    if asked.isdecimal() and int(asked) < len(items):
        return int(asked)
    if not items:
        raise SettingsError(
            f"the file has no {what}s, so there is no {what} '{asked}'", file=file, object=what
        )
    shown = [name or str(number) for number, name in enumerate(names)]
    raise unknown_name(what, asked, shown, file=file, object=what)
