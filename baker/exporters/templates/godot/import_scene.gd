@tool
extends EditorScenePostImport
# Import script for scene.glb (Godot 4): attaches lightmaps.gd to the root of the scene.


func _post_import(scene: Node) -> Object:
	var folder := get_source_file().get_base_dir()
	scene.set_script(load(folder.path_join("lightmaps.gd")))
	scene.set("folder", folder)
	return scene
