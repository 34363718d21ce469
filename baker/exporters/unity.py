"""Unity: pages in Unity's scale, and scripts that import them and assign them to renderers.

Unity multiplies a lightmap by the albedo only, so pages hold E / pi. glTF importers flip v (v' = 1 - v), and
image rows start at the bottom, so pages need no flip; scale and offset of an object become

    lightmapScaleOffset = (su, sv, ou, 1 - sv - ov)     with page uv = uv * (su, sv) + (ou, ov) in glTF.

Based on: Unity manual, LightmapSettings.lightmaps and Renderer.lightmapScaleOffset.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from baker.core.encoding import encoding_of
from baker.core.export import EXPORTS
from baker.exporters.common import (
    DESCRIPTION_NAME,
    place_named_scene,
    template,
    write_json,
    write_readme,
    write_text,
)

# Entries of a page's header that are still valid after division by pi.
_KEPT = ("colourSpace", "software")

SCRIPTS = ("Editor/BakerLightmapImporter.cs", "BakerLightmaps.cs")


class UnityExport:
    """Files the export `unity`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        description = place_named_scene(bake, target)
        for page in description["pages"]:
            _write_page(bake / page["file"], target / page["file"])
        write_json(target / DESCRIPTION_NAME, unity_description(description))
        for script in SCRIPTS:
            (target / script).parent.mkdir(exist_ok=True)
            write_text(target / script, template("unity", Path(script).name))
        write_readme(
            target,
            "Lightmaps for Unity",
            steps=(
                "Copy the folder into Assets; scene.glb needs a glTF importer (glTFast or UnityGLTF).",
                "Put scene.glb into the open scene, select it, and choose Baker > Apply lightmaps.",
                "The component BakerLightmaps keeps the pages with the scene. Delete the baked lights.",
                "Leave occlusion maps off: what is open or closed is in the light.",
            ),
            scale="EXR holds E / pi, what a white surface sends out in cd/m2; Unity multiplies by albedo.",
            uv="TEXCOORD_1, which is Unity's `uv2` (Mesh.uv2).",
            rows="v = 0 is the first row; importers turn v over and Unity's images begin below: they agree.",
        )


EXPORTS.register("unity")(UnityExport())


def unity_description(description: dict[str, Any]) -> dict[str, Any]:
    """Return the description in Unity's terms."""
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
    """Return Unity's lightmapScaleOffset of an object: v runs upwards there."""
    return [scale[0], scale[1], offset[0], 1.0 - scale[1] - offset[1]]


def _write_page(source: Path, target: Path) -> None:
    """Write a page divided by pi, in the number format of its source."""
    encoding = encoding_of(source.name)
    assert encoding is not None, "the bake wrote this file itself"
    image = encoding.decode(source)
    header: dict[str, str] = {key: image.header[key] for key in _KEPT if key in image.header}
    header |= {"quantity": "irradiance E / pi, without the receiver's albedo", "unit": "cd/m2"}
    pixels = (image.pixels.astype(np.float64) / math.pi).astype(np.float32)
    encoding.encode(target, pixels, options=encoding.options_of_image(image), header=header)
