"""Compares wildcard patterns with the names and paths of a scene's nodes.

A case-sensitive pattern with `*`, `?` or `[abc]` is compared with the name of a node and with its path from
the root, such as `House/Floor 1/*`. A pattern that matches a node also matches all nodes below it.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Any

from baker.core.names import nearest_name
from baker.core.printable import printable
from baker.core.scene import Scene


class NodeNames:
    """The names and paths of a scene's nodes.

    Parameters
    ----------
    scene : Scene
        A scene without a source document has no hierarchy: the path of an object is its name.
    """

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
        """Return whether a pattern matches a node or one of its ancestors; remember patterns that match."""
        found = any(fnmatchcase(text, pattern) for text in self._texts(node, name))
        if found:
            self.matched.add(pattern)
        return found

    def ancestors(self, node: int) -> list[int]:
        """Return the nodes from the root to `node`, which is the last."""
        chain = [node]
        while chain[-1] in self._parent and len(chain) <= len(self._nodes):
            chain.append(self._parent[chain[-1]])
        return chain[::-1]

    def name(self, node: int) -> str:
        """Return the name of a node of the source document."""
        return str(self._nodes[node].get("name", f"node_{node}"))

    def path(self, node: int, name: str) -> str:
        """Return the path of a node from the root; `name` is its own name."""
        above = self.ancestors(node)[:-1] if node < len(self._nodes) else []
        return "/".join([*(self.name(n) for n in above), name])

    def json(self, node: int) -> dict[str, Any]:
        """Return the JSON of a node, {} if there is no such node."""
        found = self._nodes[node] if node < len(self._nodes) else {}
        return found if isinstance(found, dict) else {}

    def nearest(self, pattern: str) -> str:
        """Return the words "; did you mean 'NAME'?" for a pattern that matches nothing, or an empty text."""
        found = nearest_name(pattern, [text for texts in self._known.values() for text in texts])
        return "" if found is None else f"; did you mean '{found}'?"

    def _texts(self, node: int, name: str) -> list[str]:
        """Return the names and paths of a node and its ancestors."""
        if (node, name) not in self._known:
            chain = [*(self.name(n) for n in self.ancestors(node)[:-1]), name]
            paths = ["/".join(chain[: k + 1]) for k in range(len(chain))]
            texts = [*chain, *paths]
            # A user copies a name as `baker inspect` prints it.
            self._known[node, name] = list(dict.fromkeys([*texts, *map(printable, texts)]))
        return self._known[node, name]
