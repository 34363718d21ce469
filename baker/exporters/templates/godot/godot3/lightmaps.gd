extends Spatial
# Shows lightmaps with an unlit shader (Godot 3, GLES3). Attach it to the root of scene.glb.

# Factor on everything that the shader shows.
export var exposure = 1.0
# Hide the lights of the file, because the pages contain their light.
export var hide_lights = true

var _shaders = {}


func _ready():
	apply()


func apply():
	var folder = get_script().resource_path.get_base_dir()
	var file = File.new()
	if file.open(folder.plus_file("lightmap.json"), File.READ) != OK:
		push_error("there is no lightmap.json in " + folder)
		return
	var bake = JSON.parse(file.get_as_text()).result
	file.close()
	var by_name = {}
	for entry in bake["objects"]:
		by_name[entry["name"]] = entry
	visit(self, bake, by_name, folder)


func visit(node, bake, by_name, folder):
	if node is Light and hide_lights:
		node.visible = false
	if node is MeshInstance and by_name.has(node.name):
		var entry = by_name[node.name]
		var page = bake["pages"][int(entry["page"])]
		for surface in node.mesh.get_surface_count():
			var material = lit(node.mesh.surface_get_material(surface), bake["exposure"], folder)
			material.set_shader_param("pages", load(folder.plus_file(page["file"])))
			material.set_shader_param("slice", page["slice"])
			material.set_shader_param("slices", page["slices"])
			material.set_shader_param("page_size", page["height"])
			material.set_shader_param("uv_scale", Vector2(entry["uv_scale"][0], entry["uv_scale"][1]))
			material.set_shader_param("uv_offset", Vector2(entry["uv_offset"][0], entry["uv_offset"][1]))
			node.set_surface_material(surface, material)
	for child in node.get_children():
		visit(child, bake, by_name, folder)


# Returns an unlit material that looks like `old`; `scale` is the factor on light in the pages.
func lit(old, scale, folder):
	var material = ShaderMaterial.new()
	material.shader = shader_for(old, folder)
	material.set_shader_param("exposure", exposure)
	if old is SpatialMaterial:
		material.set_shader_param("albedo", old.albedo_color)
		material.set_shader_param("albedo_texture", old.albedo_texture)
		material.set_shader_param("vertex_colour", old.vertex_color_use_as_albedo)
		material.set_shader_param("alpha_scissor", old.params_alpha_scissor_threshold)
		material.set_shader_param("uv1_scale", Vector2(old.uv1_scale.x, old.uv1_scale.y))
		material.set_shader_param("uv1_offset", Vector2(old.uv1_offset.x, old.uv1_offset.y))
		if old.emission_enabled:
			material.set_shader_param("emission", old.emission)
			material.set_shader_param("emission_energy", old.emission_energy * scale)
			material.set_shader_param("emission_texture", old.emission_texture)
	return material


# Returns the shader with the cull mode and transparency of `old`.
func shader_for(old, folder):
	var code = load(folder.plus_file("lightmap.shader")).code
	if old is SpatialMaterial:
		if old.params_cull_mode == SpatialMaterial.CULL_DISABLED:
			code = code.replace("cull_back;", "cull_disabled;")
		if old.params_use_alpha_scissor:
			code = code.replace("// ALPHA", "ALPHA = base.a; ALPHA_SCISSOR = alpha_scissor;")
		elif old.flags_transparent:
			code = code.replace("// ALPHA", "ALPHA = base.a;")
	if not _shaders.has(code):
		var shader = Shader.new()
		shader.code = code
		_shaders[code] = shader
	return _shaders[code]
