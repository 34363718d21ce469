@tool
extends EditorScenePostImport
# Import script of scene.glb (Godot 4.2 or newer): adds the lightmaps.


func _post_import(scene: Node) -> Object:
	var folder := get_source_file().get_base_dir()
	load(folder.path_join("lightmap_gi.gd")).attach(scene, folder)
	return scene
