tool
extends EditorScenePostImport
# Import script for scene.glb (Godot 3): attaches lightmaps.gd to its root.


func post_import(scene):
	var folder = get_source_folder()
	scene.set_script(load(folder.plus_file("lightmaps.gd")))
	scene.set("folder", folder)
	return scene
