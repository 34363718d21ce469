"""Lists the differences between the manifests of two bakes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from baker.comparison.pairs import ObjectPairs
from baker.io.bake.read_bake import StoredBake


def manifest_differences(a: StoredBake, b: StoredBake, pairs: ObjectPairs) -> list[dict[str, Any]]:
    """Return the entries in which two manifests differ, as dictionaries with the keys `what`, `a` and `b`.

    `what` is the name of the entry; `a` and `b` are its values in the two bakes, None if it is missing. The
    function compares input (except the path), settings, versions, number and size of pages, channels and
    lights. It also compares the world matrices of each pair of objects.

    Parameters
    ----------
    a, b : StoredBake
        The two bakes.
    pairs : ObjectPairs
        The pairs of instances of both scenes.
    """
    first, second = dict(_facts(a)), dict(_facts(b))
    found = [
        {"what": what, "a": first.get(what), "b": second.get(what)}
        for what in dict.fromkeys([*first, *second])
        if first.get(what) != second.get(what)
    ]
    for i in np.flatnonzero(pairs.partner >= 0):
        mine, theirs = a.scene.instances[i], b.scene.instances[pairs.partner[i]]
        if not np.allclose(mine.world_from_object, theirs.world_from_object, rtol=1e-6, atol=1e-9):
            matrices = [m.world_from_object.tolist() for m in (mine, theirs)]
            found.append({"what": f"objects.{mine.name}.matrix", "a": matrices[0], "b": matrices[1]})
    return found


def _facts(bake: StoredBake) -> Iterator[tuple[str, Any]]:
    manifest = bake.manifest
    for section in ("input", "settings", "versions"):
        entries = manifest.get(section)
        for key, value in entries.items() if isinstance(entries, dict) else ():
            # Leave out the path of the scene, because it is relative to the output folder of each bake.
            if (section, key) != ("input", "path"):
                yield f"{section}.{key}", value
    yield "pages.count", bake.atlas.n_pages
    yield "pages.resolution", bake.atlas.resolution
    yield "pages.channels", list(bake.maps)
    lights = manifest.get("lights")
    for light in lights if isinstance(lights, list) else ():
        name = (
            f"lights.{light.get('kind')} '{light.get('name')}' {light.get('node', light.get('material', ''))}"
        )
        yield name.rstrip(), {k: v for k, v in light.items() if k not in ("kind", "name", "node", "material")}
