"""Writes files for Unity: pages that hold E / pi, and a package that assigns them to renderers.

Unity multiplies a lightmap by the albedo and not by 1 / pi, so the pages are divided by pi. Unity's glTF
importers replace v by 1 - v, and Unity stores image rows bottom-up, so pages need no flip. The scale (su, sv)
and offset (ou, ov) of an object become

    lightmapScaleOffset = (su, sv, ou, 1 - sv - ov)     with page uv = uv * (su, sv) + (ou, ov) in glTF.

Based on: Unity manual, LightmapSettings.lightmaps and Renderer.lightmapScaleOffset.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from baker.core.export import EXPORTS
from baker.exporters.common import (
    DESCRIPTION_NAME,
    named_scene,
    template,
    write_json,
    write_page,
    write_readme,
    write_scene,
    write_text,
)

# Unity ignores folders whose name ends in `~`. Therefore the folders of several bakes can be copied into
# Assets although all contain the same scripts. The package is installed once, in the project's Packages.
PACKAGE = "Packages~/com.baker.lightmaps"
PACKAGE_FILES = (
    "package.json",
    "Runtime/Baker.Lightmaps.asmdef",
    "Runtime/BakerLightmaps.cs",
    # Its constant GUID keeps the references of scenes to the component if the package is copied again.
    "Runtime/BakerLightmaps.cs.meta",
    "Editor/Baker.Lightmaps.Editor.asmdef",
    "Editor/BakerLightmapsMenu.cs",
    "Editor/LightmapShaders.cs",
)


class UnityExport:
    """The export `unity`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        document, description, binary = named_scene(bake)
        # Remove occlusion textures: Unity would darken the lightmaps by them, but lightmaps contain occlusion
        # already.
        for material in document.get("materials", []):
            material.pop("occlusionTexture", None)
        write_scene(target, document, binary)
        for page in description["pages"]:
            write_page(
                bake,
                page["file"],
                target / page["file"],
                divisor=math.pi,
                quantity="irradiance E / pi, without the receiver's albedo",
                unit="cd/m2",
            )
        write_json(target / DESCRIPTION_NAME, unity_description(description))
        for name in PACKAGE_FILES:
            path = target / PACKAGE / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, template("unity", name))
        write_readme(
            bake,
            target,
            "Lightmaps for Unity",
            steps=(
                f"Once per project: copy {PACKAGE} into Packages, and install glTFast.",
                "Copy this folder into Assets, each bake into its own folder. Put scene.glb into the scene,",
                "select it, and choose Baker > Apply lightmaps; repeat this after every bake.",
                "Before you build a game, choose Baker > Keep lightmap shaders in builds.",
            ),
            scale="0.3183 (1 / pi). Pages contain E x 0.3183, the radiance of a white surface, cd/m2.",
            uv="TEXCOORD_1, which is Unity's `uv2` (Mesh.uv2).",
            rows="v = 0 is the first row. glTF importers replace v by 1 - v, and Unity stores images "
            "bottom-up, so no flip is needed.",
        )


EXPORTS.register("unity")(UnityExport())


def unity_description(description: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `lightmap.json` with Unity's quantity, unit and `scaleOffset`."""
    return {
        **description,
        "quantity": "irradiance / pi",
        "unit": "cd/m2",
        "objects": [
            {
                **{key: entry[key] for key in ("node", "name", "page")},
                "scaleOffset": scale_offset(entry["uv_scale"], entry["uv_offset"]),
            }
            for entry in description["objects"]
        ],
    }


def scale_offset(scale: list[float], offset: list[float]) -> list[float]:
    """Return Unity's lightmapScaleOffset of an object; v = 0 is the bottom of the image in Unity."""
    return [scale[0], scale[1], offset[0], 1.0 - scale[1] - offset[1]]
