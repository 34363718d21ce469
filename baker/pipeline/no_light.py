"""Chooses the default channels of scenes in which nothing emits light, and warns about such scenes."""

from __future__ import annotations

from baker.channels.channel import chosen_channels
from baker.checks.context import CheckContext
from baker.core.errors import SettingsError
from baker.core.export import check_exports
from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings
from baker.io.bake.write_bake import check_encodings

# Texts of the warning `no-light`: its beginning if maps of light are baked, its beginning if they are left
# out, and its end.
_BLACK = "nothing emits light, so the maps of light are black"
_LEFT_OUT = "nothing emits light, so only {} is baked"
_WAYS = "to light the scene, make a material emissive, add lights to the file, or set `sky`"


def fit_to_light(scene: Scene, settings: BakeSettings) -> tuple[BakeSettings, SceneWarning | None]:
    """Leave out the default channels that need light if nothing in the scene emits light.

    All channels are kept if the user has chosen them, if all of them need light, or if an export or an
    encoding needs a channel that would be left out.

    Parameters
    ----------
    scene : Scene
        The scene to bake.
    settings : BakeSettings
        Settings of the bake.

    Returns
    -------
    settings : BakeSettings
        With fewer `channels`, or as given.
    warning : SceneWarning or None
        The warning `no-light`; None if the scene has light or no channel needs it.
    """
    context = CheckContext(scene, settings)
    if not context.bakes_light or context.lit or context.emits:
        return settings, None
    dark = tuple(name for name, c in chosen_channels(settings.channels).items() if not c.needs_light)
    if settings.is_given("channels") or not dark or not _suffices(dark, settings):
        return settings, SceneWarning("no-light", f"{_BLACK}; {_WAYS}")
    message = f"{_LEFT_OUT.format(', '.join(dark))}; {_WAYS}; `channels` names what is baked all the same"
    return settings.changed(channels=dark), SceneWarning("no-light", message)


def _suffices(names: tuple[str, ...], settings: BakeSettings) -> bool:
    """Return whether the exports and encodings of the settings need no other channels than `names`."""
    try:
        check_exports(settings.export, names)
        check_encodings(settings.encode, chosen_channels(names))
    except SettingsError:
        return False
    return True
