"""Runs the rules that are part of every bake and find defects that neither importer nor unwrapper reports."""

from __future__ import annotations

from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings


def bake_warnings(scene: Scene, settings: BakeSettings) -> list[SceneWarning]:
    """Return warnings about a scene before it is baked.

    This function runs the rules `inside-out`, `invisible` and `collision-hull`, and for bakes of light also
    `light-range`. The importer warns of unusable faces, and the unwrapper of lightmap uv that cannot be kept.

    Parameters
    ----------
    scene : Scene
        The scene, read for a bake.
    settings : BakeSettings
        Settings of the bake.

    Returns
    -------
    list of SceneWarning
        Sorted by rule, in the order above.
    """
    # Import the four rules directly, because the registry would import all rules.
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
