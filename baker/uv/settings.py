"""The settings of lightmap uv, which are the bake settings that unwrapping reads."""

from __future__ import annotations

from typing import ClassVar, Literal

from baker.core.atlas import Atlas
from baker.core.errors import SettingsError
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.settings_model import Settings, same_setting


class UnwrapSettings(Settings):
    """Settings of lightmap uv, with validation. Each is the setting of the same name in `BakeSettings`."""

    what: ClassVar[str] = "unwrap setting"

    resolution: int = same_setting(BakeSettings, "resolution")
    density: float | None = same_setting(BakeSettings, "density")
    max_pages: int = same_setting(BakeSettings, "max_pages")
    padding: int = same_setting(BakeSettings, "padding")
    uv: Literal["auto", "keep", "unwrap"] = same_setting(BakeSettings, "uv")
    instances: Literal["share", "unique"] = same_setting(BakeSettings, "instances")
    unwrapper: Literal["xatlas"] = same_setting(BakeSettings, "unwrapper")
    threads: int | None = same_setting(BakeSettings, "threads")

    def for_bake(self) -> BakeSettings:
        """Return bake settings with these values, and defaults for all other settings."""
        return BakeSettings(**self.model_dump())


def settings_of_atlas(scene: Scene, atlas: Atlas, settings: BakeSettings) -> BakeSettings:
    """Return bake settings with the resolution and padding of an atlas.

    Parameters
    ----------
    scene : Scene
        The scene that is baked.
    atlas : Atlas
        The lightmap uv of the scene.
    settings : BakeSettings
        Settings to change.

    Returns
    -------
    BakeSettings
        `settings` with `resolution` and `padding` of the atlas.

    Raises
    ------
    SettingsError
        If the atlas was made for another scene: its numbers of instances or triangles differ.
    """
    meshes = [scene.meshes[instance.mesh] for instance in scene.instances]
    same = len(meshes) == len(atlas.layouts) and all(
        len(layout.triangle) == len(mesh.triangle) for layout, mesh in zip(atlas.layouts, meshes, strict=True)
    )
    if not same:
        raise SettingsError("the atlas is that of another scene; unwrap this one", object="atlas")
    return settings.changed(resolution=atlas.resolution, padding=atlas.padding)
