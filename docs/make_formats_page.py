"""Writes FORMATS.md: the table of glTF extensions comes from the records in `baker/io/gltf/extensions/`.

python docs/make_formats_page.py            writes the page
python docs/make_formats_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.io.formats import scene_suffixes
from baker.io.gltf.extension import EXTENSIONS, UNKNOWN, GltfExtension

HEAD = """\
# Scene files

`baker` reads {formats}. The result of every format is the same `scene.glb`. `docs/make_formats_page.py`
generates this page from the code.

## Textures

PNG, JPEG, WebP, AVIF, BMP, TGA, TIFF, GIF and KTX2 (Basis Universal) pictures are read, with 1 to 16 bits,
grey, palette or four inks (CMYK); 16 bits are rounded to 8. Rotations in EXIF data are ignored, as glTF
demands. AVIF needs a Pillow that can decode it. KTX2 needs the package `opengl-basisu` (`pip install
opengl-basisu`), of which only pre-releases exist.

A texture of glTF may name several pictures. The first one that can be decoded is used, in this order: WebP,
AVIF, the texture's own `source` (PNG or JPEG), KTX2. The repeat modes of samplers, `KHR_texture_transform`,
and each of TEXCOORD_0 to TEXCOORD_15 are applied.

A picture that light does not need (normals, roughness, occlusion) may be missing; that is a warning. A
missing picture of base colour, emission or alpha is an error, unless `--missing-textures` names a colour
that replaces it: `white`, `grey` (0.5, linear) or `magenta`, with alpha 1. `scene.glb` keeps the name of
the missing picture. The same is true for the pictures of MTL files.

## Materials of glTF

- The base colour is factor times texture times vertex colour (`COLOR_0`). Metals reflect it diffusely, like
  all other materials. `KHR_materials_pbrSpecularGlossiness` replaces it by the diffuse colour.
- Unlit materials (`KHR_materials_unlit`) have their light in their texture. They block light, but neither
  reflect nor emit it; `--unlit lit` treats them like other materials.
- `--variant NAME` bakes the materials of one variant (`KHR_materials_variants`). `scene.glb` keeps all
  variants and the materials that are shown without a variant.

## Scenes of glTF

`--scene NAME` or `--scene N` chooses a scene, by its name if a scene has this name, else by its number from
0. The chosen scene becomes the default scene of `scene.glb`. Nodes of the other scenes stay, without
lightmap uv. Nodes that `KHR_node_visibility` hides, and all nodes below them, neither block light nor get
texels, and their lights are off.

## Extensions of glTF

- *read*: what is read of the extension.
- *used in the bake*: what it changes in the lightmap.
- *in scene.glb*: whether `scene.glb` and fixed files contain it.
- *refused*: a file that lists the extension in `extensionsRequired` is refused with "the file requires the
  extension NAME, " and this text. Without a text, such files are read.

A file that requires any other extension is refused with the text "{unknown}".
If a file only uses such an extension, the bake ignores it with the warning `extension-ignored`, and
`scene.glb` keeps it.

"""


def page() -> str:
    """Return the text of the page."""
    *others, last = (suffix.removeprefix(".") for suffix in scene_suffixes())
    head = HEAD.format(formats=f"{', '.join(others)} and {last}", unknown=UNKNOWN)
    rows = [_row(name, EXTENSIONS.require(name, "extension")) for name in EXTENSIONS.names()]
    return (
        head
        + "\n".join(
            [
                "| extension | read | used in the bake | in scene.glb | refused |",
                "|---|---|---|---|---|",
                *rows,
            ]
        )
        + "\n"
    )


def _row(name: str, extension: GltfExtension) -> str:
    cells = (f"`{name}`", extension.read, extension.used, extension.kept, extension.refused)
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("FORMATS.md").write_text(page(), "utf-8")
