extends Node
# Draws the export in res://godot once for each exposure and writes the pixels to res://result.json.
# The picture has 8 bits after an sRGB curve, so bright and dark values need different exposures.


func _ready():
	var file = File.new()
	file.open("res://task.json", File.READ)
	var task = JSON.parse(file.get_as_text()).result
	file.close()
	var view = Viewport.new()
	view.size = Vector2(64, 64)
	view.own_world = true
	view.hdr = true
	view.msaa = Viewport.MSAA_DISABLED
	view.render_target_update_mode = Viewport.UPDATE_ALWAYS
	view.render_target_v_flip = true
	add_child(view)
	var scene = load("res://godot/scene.glb").instance()
	scene.set_script(load("res://godot/lightmaps.gd"))
	view.add_child(scene)
	var camera = Camera.new()
	view.add_child(camera)
	if task["camera"] == "inside":
		camera.set_perspective(80.0, 0.01, 10.0)
		camera.look_at_from_position(Vector3(0.2, 0.1, 0.3), Vector3(-1, -0.4, -0.7), Vector3.UP)
	else:
		var side = -1 if task["camera"] == "back" else 1
		camera.set_orthogonal(2.0, 0.1, 10.0)
		camera.look_at_from_position(Vector3(0, 0, 2 * side), Vector3.ZERO, Vector3.UP)
	camera.current = true
	var pictures = []
	for exposure in task["exposures"]:
		scene.exposure = exposure
		scene.apply()
		for _frame in range(4):
			yield(VisualServer, "frame_post_draw")
		var image = view.get_texture().get_data()
		image.convert(Image.FORMAT_RGB8)
		pictures.append(Array(image.get_data()))
	file.open("res://result.json", File.WRITE)
	file.store_string(JSON.print(pictures))
	file.close()
	get_tree().quit()
