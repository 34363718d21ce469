"""Writes FORMATS.md: the table of glTF extensions comes from the records in `baker/io/gltf/extensions/`.

python docs/make_formats_page.py            writes the page
python docs/make_formats_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.io.formats import scene_suffixes
from baker.io.gltf.extension import UNKNOWN, GltfExtension
from baker.io.gltf.known_extensions import known_extensions

HEAD = """\
# Scene files

`baker` reads {formats}. A bake writes the scene as `scene.glb`, whatever the format of the input.
`docs/make_formats_page.py` generates this page from the code.

## Textures

Images may be PNG, JPEG, WebP, AVIF, BMP, TGA, TIFF, GIF or KTX2 (Basis Universal). Their pixels may be RGB,
grey, indices of a palette, or CMYK. Images with 16 bits per channel are reduced to 8. Rotations in EXIF data
are ignored, as glTF demands. AVIF images need a build of Pillow that decodes AVIF. KTX2 images need the
package `opengl-basisu` (`pip install opengl-basisu`).

A glTF texture may name several images. The first one that can be decoded is used, in this order: WebP,
AVIF, the texture's own `source` (PNG or JPEG), KTX2. The wrap modes of samplers and
`KHR_texture_transform` are applied. Textures may use TEXCOORD_0 to TEXCOORD_15.

Images that a bake does not use (normals, roughness, occlusion) may be missing: the bake prints a warning. A
missing image of base colour, emission or alpha is an error, unless `--missing-textures` names a colour
that replaces the image: `white`, `grey` (0.5, linear) or `magenta`, with alpha 1. `scene.glb` keeps the name
of the missing image. Images that an MTL file names are treated alike.

## Materials of glTF

- The base colour is factor x texture x vertex colour (`COLOR_0`). All materials, metals included, reflect
  their base colour diffusely. In a material with `KHR_materials_pbrSpecularGlossiness`, the diffuse colour of
  the extension is the base colour.
- Unlit materials (`KHR_materials_unlit`) block light, and neither reflect nor emit light, because the colour
  of such materials usually contains light already. With `--unlit lit` they reflect their base colour like
  other materials, but still emit nothing.
- `--variant NAME` bakes the materials of one variant (`KHR_materials_variants`). `scene.glb` keeps all
  variants and the materials that are shown without a variant.

## Scenes of glTF

`--scene NAME` chooses the scene of this name. `--scene N` chooses a scene by its index, from 0, unless a
scene has the name `N`. The chosen scene becomes the default scene of `scene.glb`. `scene.glb` keeps the nodes
of the other scenes, without lightmap uv. Nodes that `KHR_node_visibility` hides, and all nodes below them,
neither block light nor get texels, and their lights are off.

## Extensions of glTF

- *read*: what is read of the extension.
- *used in the bake*: what it changes in the lightmap.
- *in scene.glb*: whether `scene.glb` and fixed files contain it.
- *refused*: a file that lists the extension in `extensionsRequired` is refused with "the file requires the
  extension NAME, " and this text. If the column is empty, such files are read.

A file that requires any other extension is refused with the text "{unknown}".
If a file only uses such an extension, the bake ignores it with the warning `extension-ignored`, and
`scene.glb` keeps it.

"""


def page() -> str:
    """Return the text of the page."""
    *others, last = (suffix.removeprefix(".") for suffix in scene_suffixes())
    head = HEAD.format(formats=f"{', '.join(others)} and {last}", unknown=UNKNOWN)
    rows = [_row(name, extension) for name, extension in known_extensions().items()]
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
