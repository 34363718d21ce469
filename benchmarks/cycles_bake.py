"""Bakes the light of a `scene.glb` with Blender's Cycles, into the layout of the file's second uv set.

`against_cycles.py` runs this script in the Python environment that has `bpy`:

    python cycles_bake.py JOB.json

JOB.json: {"scene", "resolution", "runs": [{"samples", "denoise", "seed", "out"}], "surface": FILE.npz}. Each
`out` is an .npz file with `irradiance` (H, W, 3), `covered` (H, W) and `seconds`, the duration of the bake
alone. The first row of the images is v = 0, as in glTF. The script writes Blender's triangles to `surface`,
for `path_truth.py`.

The following settings make Cycles bake the same quantity as baker. A diffuse bake without colour is E / pi.
Every material is replaced by a Lambertian material with constant emission and a black back. Clamping and
light thresholds are off, and paths have up to 64 bounces.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

BOUNCES = 64


def main() -> None:
    """Load the scene and bake all runs of the job."""
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=job["scene"])
    image = bpy.data.images.new(
        "lightmap", job["resolution"], job["resolution"], alpha=True, float_buffer=True
    )
    image.colorspace_settings.name = "Non-Color"
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    colours = {
        material.name: _make_plain(material, image) for material in bpy.data.materials if material.use_nodes
    }
    bpy.ops.object.select_all(action="DESELECT")
    for item in meshes:
        item.select_set(True)
        # Bake to the last uv layer, which is TEXCOORD_1: the importer keeps the order of the sets.
        item.data.uv_layers.active = item.data.uv_layers[-1]
    bpy.context.view_layer.objects.active = meshes[0]
    # Join all objects and bake once, because Cycles builds its BVH again for each baked object.
    bpy.ops.object.join()
    if job.get("surface"):
        _write_surface(bpy.context.view_layer.objects.active, colours, job["surface"])
    for run in job["runs"]:
        _bake(run, image)
    print(json.dumps({"blender": bpy.app.version_string}))


def _make_plain(material: Any, image: Any) -> tuple[list[float], list[float]]:
    """Give a material a Lambertian front with emission and a black back; return its albedo and emission."""
    tree = material.node_tree
    old = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    if old.inputs["Base Color"].links or old.inputs["Emission Color"].links:
        raise SystemExit(f"material {material.name} has textures: this comparison wants plain colours")
    albedo = list(old.inputs["Base Color"].default_value)[:3]
    strength = old.inputs["Emission Strength"].default_value
    emission = [part * strength for part in list(old.inputs["Emission Color"].default_value)[:3]]
    tree.nodes.clear()
    new, link = tree.nodes.new, tree.links.new
    geometry, diffuse, light, both, out = (
        new(f"ShaderNode{kind}")
        for kind in ("NewGeometry", "BsdfDiffuse", "Emission", "AddShader", "OutputMaterial")
    )
    black, choose = new("ShaderNodeBsdfDiffuse"), new("ShaderNodeMixShader")
    diffuse.inputs["Color"].default_value = [*albedo, 1.0]
    black.inputs["Color"].default_value = [0.0, 0.0, 0.0, 1.0]
    light.inputs["Color"].default_value = [*emission, 1.0]
    light.inputs["Strength"].default_value = 1.0
    link(diffuse.outputs[0], both.inputs[0])
    link(light.outputs[0], both.inputs[1])
    link(geometry.outputs["Backfacing"], choose.inputs[0])
    link((both if any(emission) else diffuse).outputs[0], choose.inputs[1])
    link(black.outputs[0], choose.inputs[2])
    link(choose.outputs[0], out.inputs["Surface"])
    target = new("ShaderNodeTexImage")
    target.image = image
    tree.nodes.active = target
    return albedo, emission


def _write_surface(item: Any, colours: dict[str, tuple[list[float], list[float]]], path: str) -> None:
    mesh = item.data
    mesh.calc_loop_triangles()
    layer = mesh.uv_layers.active.data
    triangles = mesh.loop_triangles
    corner = np.array([[mesh.vertices[v].co for v in t.vertices] for t in triangles])
    world = np.array(item.matrix_world)
    uv = np.array([[layer[k].uv for k in t.loops] for t in triangles])
    # Flip v, because Blender has v = 0 at the bottom of the image.
    uv[..., 1] = 1.0 - uv[..., 1]
    names = [slot.material.name for slot in item.material_slots]
    shade = [colours[names[t.material_index]] for t in triangles]
    np.savez(
        path,
        position=corner @ world[:3, :3].T + world[:3, 3],
        uv=uv,
        albedo=np.array([s[0] for s in shade]),
        emission=np.array([s[1] for s in shade]),
    )


def _bake(run: dict[str, Any], image: Any) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.seed = "CPU", run["seed"]
    cycles.samples, cycles.use_adaptive_sampling = run["samples"], False
    cycles.use_denoising, cycles.denoiser = run["denoise"], "OPENIMAGEDENOISE"
    cycles.max_bounces = cycles.diffuse_bounces = BOUNCES
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
    settings = scene.render.bake
    settings.use_pass_direct = settings.use_pass_indirect = True
    settings.use_pass_color = False
    settings.margin, settings.use_clear = 0, True
    colour = 1.0
    if run["denoise"]:
        # Use a combined bake, because Cycles denoises no other type. Without emission, a combined bake is
        # albedo x E / pi, so bake the albedo first and divide by it.
        settings.use_pass_emit = settings.use_pass_glossy = settings.use_pass_transmission = False
        kind = {"type": "COMBINED"}
        cycles.samples, cycles.use_denoising = 1, False
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"COLOR"})
        colour = np.maximum(_pixels(image)[..., :3], 1e-6)
        cycles.samples, cycles.use_denoising = run["samples"], True
    else:
        kind = {"type": "DIFFUSE"}
    start = time.perf_counter()
    bpy.ops.object.bake(**kind)
    seconds = time.perf_counter() - start
    pixels = _pixels(image)
    irradiance = pixels[..., :3] / colour * math.pi
    np.savez(run["out"], irradiance=irradiance, covered=pixels[..., 3] > 0.5, seconds=seconds)


def _pixels(image: Any) -> Any:
    size = image.size[0]
    flat = np.zeros(size * size * 4, np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(size, size, 4)[::-1]


if __name__ == "__main__":
    main()
