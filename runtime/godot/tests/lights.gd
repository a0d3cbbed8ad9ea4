extends SceneTree
## Writes the lighting files of all cases: FOLDER/NAME.json. Needs no renderer.
##     godot --headless --script res://tests/lights.gd -- FOLDER

const Cases := preload("res://tests/cases.gd")


func _initialize() -> void:
	for name in Cases.NAMES:
		var example: Node3D = (load("res://example.tscn") as PackedScene).instantiate()
		example.get_node("Hall/Localprt").file = ""
		root.add_child(example)
		await process_frame
		var file := FileAccess.open(OS.get_cmdline_user_args()[0].path_join(name + ".json"), FileAccess.WRITE)
		file.store_string(JSON.stringify(Cases.apply(name, example), "  ", true, true))
		file.close()
		Cases.restore(example)
		example.free()
	quit()
