@tool
extends Node3D
# Shows lightmaps with an unlit shader, for renderers without LightmapGI (Compatibility before Godot 4.3) and
# for Godot 4.0 and 4.1. Attach it to the root of scene.glb, imported without import_scene.gd.

# Factor on everything that the shader shows.
@export var exposure := 1.0
# Hide the lights of the file, because the pages contain their light.
@export var hide_lights := true

var _shaders := {}


func _ready() -> void:
	apply()


func apply() -> void:
	var folder: String = get_script().resource_path.get_base_dir().get_base_dir()
	var bake = JSON.parse_string(FileAccess.get_file_as_string(folder.path_join("lightmap.json")))
	if not bake is Dictionary:
		push_error("%s has no readable lightmap.json" % folder)
		return
	if has_node("BakerLightmapGI"):
		push_error("this scene has a LightmapGI; clear Import Script in the Import dock of scene.glb and reimport")
		return
	var by_name := {}
	for entry in bake["objects"]:
		by_name[entry["name"]] = entry
	for node in find_children("*", "", true, false):
		if node is Light3D and hide_lights:
			node.visible = false
		if node is MeshInstance3D and by_name.has(String(node.name)):
			var entry: Dictionary = by_name[String(node.name)]
			var page: Dictionary = bake["pages"][int(entry["page"])]
			var texture: TextureLayered = load(folder.path_join(page["file"]))
			for surface in node.mesh.get_surface_count():
				var material := lit(node.mesh.surface_get_material(surface), bake["exposure"])
				material.set_shader_parameter("pages", texture)
				material.set_shader_parameter("slice", float(page["slice"]))
				material.set_shader_parameter("uv_scale", Vector2(entry["uv_scale"][0], entry["uv_scale"][1]))
				material.set_shader_parameter("uv_offset", Vector2(entry["uv_offset"][0], entry["uv_offset"][1]))
				node.set_surface_override_material(surface, material)


# Returns an unlit material that looks like `old`; `scale` is the factor on light in the pages.
func lit(old: Material, scale: float) -> ShaderMaterial:
	var material := ShaderMaterial.new()
	material.shader = shader_for(old)
	material.set_shader_parameter("exposure", exposure)
	if old is BaseMaterial3D:
		material.set_shader_parameter("albedo", old.albedo_color)
		material.set_shader_parameter("albedo_texture", old.albedo_texture)
		material.set_shader_parameter("vertex_colour", old.vertex_color_use_as_albedo)
		material.set_shader_parameter("alpha_scissor", old.alpha_scissor_threshold)
		material.set_shader_parameter("uv1_scale", Vector2(old.uv1_scale.x, old.uv1_scale.y))
		material.set_shader_parameter("uv1_offset", Vector2(old.uv1_offset.x, old.uv1_offset.y))
		if old.emission_enabled:
			material.set_shader_parameter("emission", old.emission)
			material.set_shader_parameter("emission_energy", old.emission_energy_multiplier * scale)
			material.set_shader_parameter("emission_texture", old.emission_texture)
	return material


# Returns the shader with the cull mode and transparency of `old`.
func shader_for(old: Material) -> Shader:
	var code: String = load(get_script().resource_path.get_base_dir().path_join("lightmap.gdshader")).code
	if old is BaseMaterial3D:
		if old.cull_mode == BaseMaterial3D.CULL_DISABLED:
			code = code.replace("cull_back;", "cull_disabled;")
		if old.transparency == BaseMaterial3D.TRANSPARENCY_ALPHA_SCISSOR:
			code = code.replace("// ALPHA", "ALPHA = alpha; ALPHA_SCISSOR_THRESHOLD = alpha_scissor;")
		elif old.transparency != BaseMaterial3D.TRANSPARENCY_DISABLED:
			code = code.replace("// ALPHA", "ALPHA = alpha;")
	if not _shaders.has(code):
		var shader := Shader.new()
		shader.code = code
		_shaders[code] = shader
	return _shaders[code]
