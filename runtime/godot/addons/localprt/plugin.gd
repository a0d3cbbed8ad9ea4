@tool
extends EditorPlugin
## Takes along, when a project is exported, what is no resource of the engine: baked files, surfaces, shaders.

var _exporter := Exporter.new()


func _enter_tree() -> void:
	add_export_plugin(_exporter)


func _exit_tree() -> void:
	remove_export_plugin(_exporter)


class Exporter:
	extends EditorExportPlugin

	const ENDINGS: PackedStringArray = ["lprt", "surfaces", "spv"]

	func _get_name() -> String:
		return "localprt"

	func _export_begin(_features: PackedStringArray, _is_debug: bool, _path: String, _flags: int) -> void:
		_add_folder("res://")

	func _add_folder(folder: String) -> void:
		for file in DirAccess.get_files_at(folder):
			if file.get_extension() in ENDINGS:
				var path := folder.path_join(file)
				add_file(path, FileAccess.get_file_as_bytes(path), false)
		for inner in DirAccess.get_directories_at(folder):
			if not inner.begins_with("."):
				_add_folder(folder.path_join(inner))
