"""Reports those warnings of the importer that no other rule reports."""

from __future__ import annotations

from collections.abc import Iterator

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check

# Severity and advice, by code of the importer's warning. Warnings with the code of a rule are not in this
# table, because that rule reports the defect.
NOTES = {
    "broken-attribute": ("warning", "export the attribute again if the level needs it"),
    "broken-camera": ("info", "export the camera again if the level needs it"),
    "bad-texcoord": ("warning", "repair the texture coordinates; they are read as 0"),
    "extension-ignored": ("info", "export without the extension if it changes shapes or colours"),
    "integer-colours": ("warning", "export the vertex colours as normalized integers or floats"),
    "lower-levels": ("info", "bake lower levels apart if they need a lightmap of their own"),
    "missing-file": ("info", "put the file beside the scene if the level needs it"),
    "missing-mtl": ("warning", "put the material library beside the scene"),
    "missing-texcoord": ("warning", "export the texture coordinates that the material reads"),
    "missing-texture": ("warning", "put the image beside the scene, or take the texture off the material"),
    "animation-pointer": ("info", "nothing to do, if the state of the file is what is to be baked"),
    "morphed": ("info", "nothing to do, if the shape of these weights is what is to be baked"),
    "no-material": ("info", "name a material for these faces"),
    "not-triangles": ("info", "nothing to do, if points and lines are not to be baked"),
    "odd-indices": ("warning", "export the mesh again: its index buffer is cut off"),
    "several-scenes": ("info", "choose a scene with `scene_name`"),
    "skinned": ("info", "nothing to do, if the pose of the file is what is to be baked"),
    "transmission": ("warning", "look at the light behind the surface"),
    "unlit": ("info", "nothing to do, if the picture of the material contains its light"),
    "unknown-material": ("warning", "export the material with a base colour"),
    "up-and-scale-ignored": ("info", "leave `up` and `scale` away for glTF"),
}


@check("file-note", group="file", severity="info", fix="see the message")
def file_note(context: CheckContext) -> Iterator[RawFinding]:
    """Parts of the file that a bake ignores, or interprets in one of several possible ways.

    The key `note` has the code of the importer's warning. Examples are:

    - unknown extensions, and materials of an unknown model;
    - skinned meshes and morph targets, which are baked in one pose, and animations that change other values;
    - unlit materials, which reflect no light, and materials whose transmission is not used completely;
    - primitives of points and lines;
    - several scenes in one file, and lower levels of detail;
    - missing texture coordinates or material libraries;
    - unreadable parts that a bake does not need: normal maps, unused files, tangents, cameras.
    """
    for warning in context.scene.warnings:
        if warning.code in NOTES:
            severity, advice = NOTES[warning.code]
            node = context.node_named.get(warning.object)
            text = f"{warning.message}; {advice}"
            yield RawFinding(
                text, Location(warning.object, node), severity=severity, more={"note": warning.code}
            )
