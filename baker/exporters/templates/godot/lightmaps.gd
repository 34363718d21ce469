@tool
extends Node3D
# Assigns lightmaps to the objects below this node (Godot 4). Attach it to the root of the imported scene.glb.

@export var folder := "res://godot"
@export var exposure := 1.0
# Hide the lights of the file, because the pages contain their light.
@export var hide_lights := true


func _ready() -> void:
	apply()


func apply() -> void:
	var bake = JSON.parse_string(FileAccess.get_file_as_string(folder.path_join("lightmap.json")))
	if bake == null:
		push_error("there is no lightmap.json in " + folder)
		return
	var pages := []
	for page in bake["pages"]:
		pages.append(load(folder.path_join(page["file"])))
	var shader: Shader = load(folder.path_join("lightmap.gdshader"))
	var by_name := {}
	for entry in bake["objects"]:
		by_name[entry["name"]] = entry
	for node in find_children("*", "", true, false):
		if node is Light3D and hide_lights:
			node.visible = false
		if node is MeshInstance3D and by_name.has(String(node.name)):
			var entry: Dictionary = by_name[String(node.name)]
			for surface in node.mesh.get_surface_count():
				var old = node.mesh.surface_get_material(surface)
				node.set_surface_override_material(surface, lit(old, shader, pages[int(entry["page"])], entry))


func lit(old: Material, shader: Shader, page: Texture2D, entry: Dictionary) -> ShaderMaterial:
	var material := ShaderMaterial.new()
	material.shader = shader
	material.set_shader_parameter("page", page)
	material.set_shader_parameter("uv_scale", Vector2(entry["uv_scale"][0], entry["uv_scale"][1]))
	material.set_shader_parameter("uv_offset", Vector2(entry["uv_offset"][0], entry["uv_offset"][1]))
	material.set_shader_parameter("exposure", exposure)
	if old is BaseMaterial3D:
		material.set_shader_parameter("albedo", old.albedo_color)
		material.set_shader_parameter("albedo_texture", old.albedo_texture)
		if old.emission_enabled:
			material.set_shader_parameter("emission", old.emission)
			material.set_shader_parameter("emission_energy", old.emission_energy_multiplier)
			material.set_shader_parameter("emission_texture", old.emission_texture)
	return material
