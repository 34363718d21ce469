extends Spatial
# Assigns lightmaps to the objects below this node (Godot 3, GLES3). Attach it to the root of scene.glb.

export var folder = "res://godot"
export var exposure = 1.0
# Hide the lights of the file, because the pages contain their light.
export var hide_lights = true


func _ready():
	apply()


func apply():
	var file = File.new()
	if file.open(folder.plus_file("lightmap.json"), File.READ) != OK:
		push_error("there is no lightmap.json in " + folder)
		return
	var bake = JSON.parse(file.get_as_text()).result
	file.close()
	var pages = []
	for page in bake["pages"]:
		pages.append(load(folder.plus_file(page["file"])))
	var by_name = {}
	for entry in bake["objects"]:
		by_name[entry["name"]] = entry
	visit(self, load(folder.plus_file("lightmap.shader")), pages, by_name)


func visit(node, shader, pages, by_name):
	if node is Light and hide_lights:
		node.visible = false
	if node is MeshInstance and by_name.has(node.name):
		var entry = by_name[node.name]
		for surface in node.mesh.get_surface_count():
			var old = node.mesh.surface_get_material(surface)
			node.set_surface_material(surface, lit(old, shader, pages[int(entry["page"])], entry))
	for child in node.get_children():
		visit(child, shader, pages, by_name)


func lit(old, shader, page, entry):
	var material = ShaderMaterial.new()
	material.shader = shader
	material.set_shader_param("page", page)
	material.set_shader_param("uv_scale", Vector2(entry["uv_scale"][0], entry["uv_scale"][1]))
	material.set_shader_param("uv_offset", Vector2(entry["uv_offset"][0], entry["uv_offset"][1]))
	material.set_shader_param("exposure", exposure)
	if old is SpatialMaterial:
		material.set_shader_param("albedo", old.albedo_color)
		material.set_shader_param("albedo_texture", old.albedo_texture)
		if old.emission_enabled:
			material.set_shader_param("emission", old.emission)
			material.set_shader_param("emission_energy", old.emission_energy)
			material.set_shader_param("emission_texture", old.emission_texture)
	return material
