"""The rules that a bake runs: defects that its importer and unwrapper do not report."""

from __future__ import annotations

from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings


def bake_warnings(scene: Scene, settings: BakeSettings) -> list[SceneWarning]:
    """Return warnings about a scene before it is baked.

    The importer warns of unusable faces and the unwrapper of lightmap uv that cannot be kept, by the codes of
    `baker check`. This function adds `inside-out`, `invisible`, `collision-hull` and `light-range`.

    Parameters
    ----------
    scene : Scene
        As the importer returns it for a bake.
    settings : BakeSettings
        Settings of the bake.

    Returns
    -------
    list of SceneWarning
        In the order of these rules.
    """
    # Import these rules directly: the registry would import all of them.
    from baker.checks.context import CheckContext
    from baker.checks.rules.collision import collision_hull
    from baker.checks.rules.inside_out import inside_out
    from baker.checks.rules.invisible import invisible
    from baker.checks.rules.light_sources import light_range

    context = CheckContext(scene, settings)
    found = [
        SceneWarning("inside-out", f"{found.message}; it will be black", found.location.object)
        for found in inside_out(context)
    ]
    found += [
        SceneWarning("invisible", f"{f.message}; raise the alpha or leave the object out", f.location.object)
        for f in invisible(context)
    ]
    found += [
        SceneWarning("collision-hull", f"{f.message}; leave it out with `exclude`", f.location.object)
        for f in collision_hull(context)
    ]
    if context.bakes_light:
        found += [SceneWarning("light-range", f.message, f.location.object) for f in light_range(context)]
    return found
