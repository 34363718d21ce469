"""Imports a GLB into Blender and exports it again.

Arguments: both files, the keywords of the exporter as JSON, and optionally an FBX file that is written and
read in between.
"""

import json
import sys

import bpy

source, target, keywords, *fbx = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=source)
if fbx:
    bpy.ops.export_scene.fbx(filepath=fbx[0], use_custom_props=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.fbx(filepath=fbx[0])
bpy.ops.export_scene.gltf(filepath=target, export_format="GLB", **json.loads(keywords))
