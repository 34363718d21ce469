"""Writes files for Unreal Engine: pages, textures, scene, and a script that imports them into a level.

Unreal cannot import lightmaps, so the reflected light becomes the emission of an unlit material:

emissive colour = (base colour * page(TexCoord[1] * scale + offset) / pi + emission) * exposure.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from baker.core.export import EXPORTS
from baker.exporters.common import (
    named_scene,
    place_description,
    template,
    write_readme,
    write_scene,
    write_text,
)
from baker.exporters.unreal_scene import TEXTURE_FOLDER, split_scene
from baker.io.png import encode_png

# White textures for parameters without a texture: the script imports the first as a colour texture and the
# second as a page.
DEFAULTS = ("T_BakerWhite.png", "T_BakerPage.png")


class UnrealExport:
    """The export `unreal`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        document, description, binary = named_scene(bake)
        textures = split_scene(document, description, binary)
        write_scene(target, document, binary)
        place_description(bake, target, description)
        if textures:
            (target / TEXTURE_FOLDER).mkdir()
        white = encode_png(np.full((4, 4, 4), 255, np.uint8))
        for name, content in {**textures, **dict.fromkeys(DEFAULTS, white)}.items():
            (target / name).write_bytes(content)
        write_text(target / "import_lightmaps.py", template("unreal", "import_lightmaps.py"))
        write_readme(
            bake,
            target,
            "Lightmaps for Unreal Engine",
            steps=(
                "Enable the plugin Python Editor Script, open the saved level that gets the scene, and run",
                "import_lightmaps.py (Tools > Execute Python Script). It places the objects in the level and",
                "imports everything to /Game/Baker/<path of the level>. Run it again after every bake.",
                "The parameter `Exposure` scales the light; the level's auto exposure is applied after it.",
            ),
            scale="1.0. Pages contain irradiance E in lx; the material shows E x 0.3183 (1 / pi), cd/m2.",
            uv="TEXCOORD_1, which is UV channel 1 (TexCoord[1]).",
            rows="v = 0 is the first row of the image, as in Unreal; v is not flipped.",
        )


EXPORTS.register("unreal")(UnrealExport())
