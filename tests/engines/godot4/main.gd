extends Node
# Draws the exports that res://tasks.json names, once for each exposure, and hands the pictures to the page.
# A picture has 8 bits after an sRGB curve, so bright and dark values need different exposures.

var view := SubViewport.new()
var environment := Environment.new()


func _ready() -> void:
	view.size = Vector2i(64, 64)
	view.own_world_3d = true
	view.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	add_child(view)
	environment.background_mode = Environment.BG_COLOR
	environment.background_color = Color.BLACK
	environment.tonemap_mode = Environment.TONE_MAPPER_LINEAR
	var world := WorldEnvironment.new()
	world.environment = environment
	view.add_child(world)
	var results := []
	for task in JSON.parse_string(FileAccess.get_file_as_string("res://tasks.json")):
		results.append(await draw(task))
	JavaScriptBridge.eval("window.result = " + JSON.stringify(results))


# Replaces what the editor's importer does: makes the texture arrays of an export, at the paths of the images.
# The numbers are half floats in a file of their own, because this build of Godot cannot read EXR files.
func import_textures(folder: String) -> Array:
	var kept := []
	for entry in JSON.parse_string(FileAccess.get_file_as_string(folder.path_join("lightmap.json")))["textures"]:
		var path: String = folder.path_join(entry["file"])
		var settings := ConfigFile.new()
		settings.load(path + ".import")
		var numbers := FileAccess.get_file_as_bytes(path + ".numbers")
		var count: int = settings.get_value("params", "slices/vertical")
		var part := numbers.size() / count
		var size := int(sqrt(part / 6))
		var slices: Array[Image] = []
		for slice in count:
			var own := numbers.slice(slice * part, (slice + 1) * part)
			slices.append(Image.create_from_data(size, size, false, Image.FORMAT_RGBH, own))
		var texture := Texture2DArray.new()
		texture.create_from_images(slices)
		texture.take_over_path(path)
		kept.append(texture)
	return kept


func import_scene(folder: String) -> Node:
	var document := GLTFDocument.new()
	var state := GLTFState.new()
	document.append_from_buffer(FileAccess.get_file_as_bytes(folder.path_join("scene.glb")), "", state)
	return document.generate_scene(state)


# Saves a scene as the importer does, and returns what a game loads.
func saved(scene: Node) -> Node:
	var packed := PackedScene.new()
	packed.pack(scene)
	scene.free()
	ResourceSaver.save(packed, "user://scene.scn")
	return ResourceLoader.load("user://scene.scn", "", ResourceLoader.CACHE_MODE_IGNORE).instantiate()


func draw(task: Dictionary) -> Array:
	var folder: String = task["folder"]
	var kept := import_textures(folder) if task["textures"] else []
	var scene := import_scene(folder)
	if task["way"] == "fallback":
		scene.set_script(load(folder.path_join("fallback/lightmaps.gd")))
	else:
		var script = load(folder.path_join("import_scene.gd")).new()
		script.source_file = folder.path_join("scene.glb")
		# The second call must change nothing.
		scene = saved(script._post_import(script._post_import(scene)))
	view.add_child(scene)
	var camera := Camera3D.new()
	view.add_child(camera)
	if task["camera"] == "inside":
		camera.set_perspective(80.0, 0.01, 10.0)
		camera.look_at_from_position(Vector3(0.2, 0.1, 0.3), Vector3(-1, -0.4, -0.7), Vector3.UP)
	else:
		var side := -1.0 if task["camera"] == "back" else 1.0
		camera.set_orthogonal(2.0, 0.1, 10.0)
		camera.look_at_from_position(Vector3(0, 0, 2.0 * side), Vector3.ZERO, Vector3.UP)
	camera.current = true
	if task["ev100"] != null:
		var attributes := CameraAttributesPhysical.new()
		attributes.exposure_aperture = 1.0
		attributes.exposure_sensitivity = 100.0
		attributes.exposure_shutter_speed = pow(2.0, task["ev100"])
		camera.attributes = attributes
	var pictures := []
	for exposure in task["exposures"]:
		environment.tonemap_exposure = exposure
		for _frame in 2:
			await RenderingServer.frame_post_draw
		var image := view.get_texture().get_image()
		image.convert(Image.FORMAT_RGB8)
		pictures.append(Marshalls.raw_to_base64(image.get_data()))
	for node in [scene, camera]:
		view.remove_child(node)
		node.free()
	return pictures
