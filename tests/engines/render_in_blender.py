"""Renders an export `blender` with Cycles, in a Python that has the module `bpy`.

`test_blender.py` starts this script. The arguments are the folder of the export, the view (`front` or
`inside`) and the EXR file to write.
"""

import math
import runpy
import sys

import bpy
from mathutils import Vector

folder, view, image = sys.argv[1:4]
bpy.ops.wm.read_factory_settings(use_empty=True)
lit = runpy.run_path(f"{folder}/import_lightmaps.py", run_name="lightmaps")["load"](folder)
assert lit, "no object was lit"
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.pixel_filter_type = 4, False, "BOX"
scene.cycles.max_bounces = 0
scene.render.resolution_x = scene.render.resolution_y = 64
scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
scene.view_settings.view_transform = "Raw"
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(camera)
scene.camera = camera
# The point (x, y, z) of glTF is (x, -z, y) in Blender.
if view == "front":
    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.0
    camera.location, camera.rotation_euler = (0.0, -2.0, 0.0), (math.pi / 2, 0.0, 0.0)
else:
    camera.data.angle, camera.data.clip_start = math.radians(80.0), 0.01
    camera.location = Vector((0.2, -0.3, 0.1))
    way = Vector((-1.0, 0.7, -0.4)) - camera.location
    camera.rotation_euler = way.to_track_quat("-Z", "Y").to_euler()
scene.render.filepath = image
bpy.ops.render.render(write_still=True)
