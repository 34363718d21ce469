@tool
extends RefCounted
# Lights an imported scene.glb with baked lightmaps: adds a LightmapGI node with data (Godot 4.2 or newer).

const NODE := "BakerLightmapGI"
const PHYSICAL_UNITS := "rendering/lights_and_shadows/use_physical_light_units"


# Adds the node to `scene`. Does nothing if the scene already has it, or if a file in `folder` is missing.
static func attach(scene: Node, folder: String) -> void:
	if scene.has_node(NODE):
		return
	var bake = JSON.parse_string(FileAccess.get_file_as_string(folder.path_join("lightmap.json")))
	if not bake is Dictionary:
		push_error("%s has no readable lightmap.json; copy the whole folder of the export" % folder)
		return
	var textures: Array[TextureLayered] = []
	for entry in bake["textures"]:
		var path: String = folder.path_join(entry["file"])
		var texture = load(path) if ResourceLoader.exists(path) else null
		if not texture is Texture2DArray or texture.get_layers() != int(entry["slices"]):
			push_error("%s is not imported as Texture2DArray with %d slices; copy its .import file, too, "
					% [path, entry["slices"]] + "and reimport first it and then scene.glb")
			return
		textures.append(texture)
	var physical: bool = ProjectSettings.get_setting(PHYSICAL_UNITS, false)
	_add_node(scene, bake, textures, physical)
	_set_emission(scene, bake["exposure"], physical)
	for light in scene.find_children("*", "Light3D", true, false):
		_set_light(light, bake["exposure"], physical)


static func _add_node(scene: Node, bake: Dictionary, textures: Array[TextureLayered], physical: bool) -> void:
	var data := LightmapGIData.new()
	data.lightmap_textures = textures
	data.set_uses_spherical_harmonics(false)
	if physical:
		# Godot divides the lightmap by this number and multiplies it by the camera's exposure.
		data.set("probe_data", {
			"bounds": AABB(), "interior": false, "baked_exposure": bake["exposure"],
			"points": PackedVector3Array(), "sh": PackedColorArray(),
			"tetrahedra": PackedInt32Array(), "bsp": PackedInt32Array(),
		})
	var by_name := {}
	for mesh in scene.find_children("*", "MeshInstance3D", true, false):
		by_name[String(mesh.name)] = mesh
	var missing := PackedStringArray()
	for entry in bake["objects"]:
		var mesh: MeshInstance3D = by_name.get(entry["name"])
		if mesh == null:
			missing.append(entry["name"])
			continue
		mesh.gi_mode = GeometryInstance3D.GI_MODE_STATIC
		var rect := Rect2(entry["uv_offset"][0], entry["uv_offset"][1], entry["uv_scale"][0], entry["uv_scale"][1])
		# The paths are relative to the LightmapGI node, a child of the scene's root.
		data.add_user(NodePath("../" + String(scene.get_path_to(mesh))), rect, int(entry["page"]), -1)
	if not missing.is_empty():
		push_warning("no lightmap for %d objects that are not in the scene: %s" % [missing.size(), ", ".join(missing)])
	var node := LightmapGI.new()
	node.name = NODE
	node.light_data = data
	scene.add_child(node)
	node.owner = scene


# Scales emission as the lightmaps.
static func _set_emission(scene: Node, exposure: float, physical: bool) -> void:
	var done := {}
	for mesh in scene.find_children("*", "MeshInstance3D", true, false):
		for surface in mesh.mesh.get_surface_count():
			var material = mesh.mesh.surface_get_material(surface)
			# A material with its own file may be used by other scenes.
			if not material is BaseMaterial3D or done.has(material) or _has_own_file(material):
				continue
			done[material] = true
			# The Compatibility renderer is not linear in `emission_energy_multiplier`, so scale the colour.
			var scale: float = material.emission_energy_multiplier * (1.0 if physical else exposure)
			material.emission = (material.emission.srgb_to_linear() * scale).linear_to_srgb()
			material.emission_energy_multiplier = 1.0
			if physical:
				material.emission_intensity = 1.0


static func _has_own_file(material: Material) -> bool:
	return material.resource_path != "" and not "::" in material.resource_path


# The importer stores cd or lx in `light_energy`. Static lights do not light objects that have a lightmap.
static func _set_light(light: Light3D, exposure: float, physical: bool) -> void:
	light.light_bake_mode = Light3D.BAKE_STATIC
	light.set_param(Light3D.PARAM_ATTENUATION, 2.0)
	if not physical:
		light.light_energy *= exposure / PI
		return
	# Godot's unit is lx for directional lights and lm for others: it divides by 4 pi (omni) or pi (spot).
	var units := 4.0 * PI if light is OmniLight3D else PI if light is SpotLight3D else 1.0
	light.set_param(Light3D.PARAM_INTENSITY, light.light_energy * units)
	light.light_energy = 1.0
