extends RefCounted
# Stands in for EditorScenePostImport, which only Godot's editor has.

var source_file := ""


func get_source_file() -> String:
	return source_file
