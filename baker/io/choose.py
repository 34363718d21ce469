"""Selects the objects of a bake by wildcard patterns of their names.

A pattern such as `Table*` or `House/Floor 1/*` is compared with the name of a node and with its path from the
root. Patterns are case-sensitive, and `*`, `?` and `[abc]` are wildcards. A pattern that matches a node also
selects all nodes below it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from baker.core.errors import InputError
from baker.core.printable import printable
from baker.core.scene import Scene, SceneWarning
from baker.core.source_mesh import SourceScene


def choose_objects(scene: Scene, include: Sequence[str], exclude: Sequence[str]) -> Scene:
    """Return the scene with the objects that the patterns select.

    Parameters
    ----------
    scene : Scene
        The scene; not changed.
    include : sequence of str
        Only objects that match one of these patterns are kept; if there are no patterns, all objects are
        kept. All lights are kept.
    exclude : sequence of str
        Objects and lights that match one of these patterns are left out.

    Returns
    -------
    Scene
        The selected scene, with a warning for each pattern that matches nothing.

    Raises
    ------
    InputError
        If the scene has objects and the patterns select none of them.
    """
    if not include and not exclude:
        return scene
    names = _Names(scene)

    def left_out(node: int, name: str) -> bool:
        return any(names.match(pattern, node, name) for pattern in exclude)

    def kept(node: int, name: str) -> bool:
        wanted = not include or any(names.match(pattern, node, name) for pattern in include)
        return wanted and not left_out(node, name)

    instances = [i for i in scene.instances if kept(i.node, i.name)]
    if scene.instances and not instances:
        message = "`include` and `exclude` leave no object to bake; look at the names with `baker inspect`"
        raise InputError(message, file=str(scene.path) if scene.path else None)
    lights = tuple(light for light in scene.lights if not left_out(light.node, light.name))
    used = sorted({i.mesh for i in instances})
    number = {old: new for new, old in enumerate(used)}
    # Call this before `unused` is computed, because a pattern may match an instance that only the source
    # scene contains.
    source = None if scene.source_scene is None else _choose_source(scene.source_scene, kept)
    unused = [p for p in (*include, *exclude) if p not in names.matched]
    return replace(
        scene,
        meshes=tuple(scene.meshes[k] for k in used),
        instances=tuple(replace(i, mesh=number[i.mesh]) for i in instances),
        lights=lights,
        source_scene=source,
        warnings=(
            *scene.warnings,
            *(
                SceneWarning("no-match", f"the pattern '{p}' matches no object and no light", p)
                for p in unused
            ),
        ),
    )


def _choose_source(source: SourceScene, kept: Callable[[int, str], bool]) -> SourceScene:
    """Return a source scene with those instances for which `kept(node, name)` is True."""
    shown = [i for i in source.instances if kept(i.node, i.name)]
    used = sorted({i.mesh for i in shown})
    number = {old: new for new, old in enumerate(used)}
    return SourceScene(
        tuple(source.meshes[k] for k in used), tuple(replace(i, mesh=number[i.mesh]) for i in shown)
    )


class _Names:
    """The names and paths of nodes that patterns are compared with."""

    def __init__(self, scene: Scene) -> None:
        document = scene.source.json if scene.source is not None else {}
        self._nodes = document.get("nodes", [])
        self._parent: dict[int, int] = {}
        for index, node in enumerate(self._nodes):
            children = node.get("children", []) if isinstance(node, dict) else []
            for child in children if isinstance(children, list) else []:
                if isinstance(child, int):
                    self._parent[child] = index
        self._known: dict[tuple[int, str], list[str]] = {}
        self.matched: set[str] = set()

    def match(self, pattern: str, node: int, name: str) -> bool:
        """Return whether a pattern matches a node or one of its ancestors."""
        found = any(fnmatchcase(text, pattern) for text in self._texts(node, name))
        if found:
            self.matched.add(pattern)
        return found

    def _texts(self, node: int, name: str) -> list[str]:
        if (node, name) not in self._known:
            chain = [name]
            at, steps = self._parent.get(node), 0
            while at is not None and steps < len(self._nodes):
                chain.append(str(self._nodes[at].get("name", f"node_{at}")))
                at, steps = self._parent.get(at), steps + 1
            chain.reverse()
            paths = ["/".join(chain[: k + 1]) for k in range(len(chain))]
            texts = [*chain, *paths]
            # A user copies a name as `baker inspect` prints it.
            self._known[node, name] = list(dict.fromkeys([*texts, *map(printable, texts)]))
        return self._known[node, name]
