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
- Materials that transmit light (`KHR_materials_transmission`) are panes. Light passes a pane in a straight
  line. At each crossing it is multiplied by transmission x base colour x (1 - F). F is the Fresnel
  reflectance by Schlick, F0 + (1 - F0) (1 - cos)^5, with F0 from `KHR_materials_ior` (0.04 by default); the
  reflected light is lost, because all surfaces reflect diffusely. The rest, 1 - transmission, reflects the
  base colour. With `KHR_materials_volume`, each of the two crossings of a closed object also has half of
  the attenuation of `thicknessFactor`, which colours the reflected light, too; without a thickness, the
  attenuation has no effect. Roughness does not scatter the light, and the thickness texture is not read. AO
  rays pass with the probability of the transmission. Alpha below 1 precedes transmission. A transmission
  texture whose uv differ from those of the base colour texture is replaced by its mean.
- `--variant NAME` bakes the materials of one variant (`KHR_materials_variants`). `scene.glb` keeps all
  variants and the materials that are shown without a variant.

## Scenes of glTF

`--scene NAME` chooses the scene of this name. `--scene N` chooses a scene by its index, from 0, unless a
scene has the name `N`. The chosen scene becomes the default scene of `scene.glb`. `scene.glb` keeps the nodes
of the other scenes, without lightmap uv. Nodes that `KHR_node_visibility` hides, and all nodes below them,
neither block light nor get texels, and their lights are off.

## Skins, morph targets and animations

Skinned meshes have the pose that the joints have in the file; the matrix of their own node does not apply.
Morph targets have the weights of the node, or else of the mesh. `--animation NAME` (or its number from 0)
and `--time SECONDS` pose nodes, joints and morph targets as the animation does at that time, with STEP,
LINEAR and CUBICSPLINE interpolation. Before the first key and after the last one, the value of that key
applies. `scene.glb` keeps the animation and the pose of the file: show the pose of the bake to see objects
where they were baked. Animations of other values (`KHR_animation_pointer`), such as the visibility of
nodes, are not read.

## OBJ and MTL

OBJ and MTL files are read as UTF-8, UTF-16 with a byte order mark, or else Latin-1. Lines may end with a
backslash, and polygons may be concave. Each object and group becomes an object of the scene; `--split
objects` ignores groups, `--split none` makes one object. The opacity is `d`, or else 1 - `Tr`, times
`map_d` (its alpha, if it has any, else its red). Programs disagree about `Tr`; a used material of opacity 0
gives the warning `invisible-material`. The options -o, -s and -clamp of maps are applied.

## Data of glTF

- Only glTF 2.0 is read. For a file of glTF 1.0, the error names a converter, `npx gltf-pipeline`.
- Accessors may be sparse, have a stride, or have no data (zeros). Sparse data is written as plain data.
- Quantised vertices (`KHR_mesh_quantization`) are read with all types, and keep their types in `scene.glb`.
- Triangles, strips and fans are read. Points and lines are left out with a warning. All stay in
  `scene.glb`, strips and fans as triangles.
- If an object has levels of detail (`MSFT_lod`), its first level is baked. Lower levels stay in `scene.glb`
  without a lightmap, also if their `TEXCOORD_1` equals that of the first level.
- Cameras are kept. `render` uses them, and a solid with a camera inside counts as a room.

## Compressed glTF

Draco and meshopt data is decoded when a file is read. The numbers equal those of the decoders of npm
(`draco3dgltf`, `meshoptimizer`) bit by bit. Where a file also has the data uncompressed (a fallback buffer,
or accessors with data beside Draco), that data is used. Sizes that a file states are checked before memory is
allocated. Draco is decoded in a separate process. On Linux, this process may use 1 GiB and eight times the
size of the decoded mesh, and 8 s of processor time and 2 s for each MB of compressed data; on other systems
only its run time is limited, to ten times as long.

`scene.glb` and fixed files are not compressed, and there is no option for it. Compressors round `TEXCOORD_1`
and reorder vertices, and no maintained Python package encodes meshopt. Compress `scene.glb` after the bake:
[AFTER.md](AFTER.md) has the flags of gltf-transform and gltfpack that keep the lightmap uv precise.

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
