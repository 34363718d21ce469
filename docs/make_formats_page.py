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
