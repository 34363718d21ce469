"""The checks that a bake runs by itself: errors of geometry that its importer and unwrapper do not tell."""

from __future__ import annotations

from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings


def bake_warnings(scene: Scene, settings: BakeSettings) -> list[SceneWarning]:
    """Return what is wrong with a scene that is about to be baked.

    Faces that cannot be used are told by the importer, lightmap uv that cannot be kept by the unwrapper, both
    under the codes that `baker check` has for them; here comes the rest.
    """
    # Not through the register, which would import every check.
    from baker.checks.context import CheckContext
    from baker.checks.rules.collision import collision_hull
    from baker.checks.rules.inside_out import inside_out
    from baker.checks.rules.invisible import invisible
    from baker.checks.rules.light_sources import light_range

    context = CheckContext(scene, settings)
    found = [
        SceneWarning("inside-out", f"{found.message}; it will be black", found.place.object)
        for found in inside_out(context)
    ]
    found += [
        SceneWarning("invisible", f"{f.message}; raise the alpha or leave the object out", f.place.object)
        for f in invisible(context)
    ]
    found += [
        SceneWarning("collision-hull", f"{f.message}; leave it out with `exclude`", f.place.object)
        for f in collision_hull(context)
    ]
    if context.wants_light:
        found += [SceneWarning("light-range", f.message, f.place.object) for f in light_range(context)]
    return found
