extends SceneTree
## Pictures of the example in every light, FOLDER/NAME.png, and of its bounced light alone.
##     godot --resolution 480x360 --script res://tests/pictures.gd -- FOLDER

const Cases := preload("res://tests/cases.gd")
const GATHERS := 8


func _initialize() -> void:
	root.msaa_3d = Viewport.MSAA_4X
	for name in Array(Cases.NAMES) + ["indirect"]:
		var example: Node3D = (load("res://example.tscn") as PackedScene).instantiate()
		root.add_child(example)
		var localprt: Localprt = example.get_node("Hall/Localprt")
		await localprt.loaded
		localprt.automatic = false
		Cases.apply(name, example)
		if name == "indirect":
			_show_indirect(example)
		localprt.reset()
		for frame in GATHERS:
			localprt.update()
			await process_frame
		# What the engine filters over frames has settled.
		for frame in 4:
			await process_frame
		await RenderingServer.frame_post_draw
		var picture := root.get_texture().get_image()
		picture.convert(Image.FORMAT_RGB8)
		picture.save_png(OS.get_cmdline_user_args()[0].path_join(name + ".png"))
		print("%s: %d x %d, %d meshes, %d gathers" % [
			name, picture.get_width(), picture.get_height(), localprt.meshes().size(), localprt.relighter().gathers])
		Cases.restore(example)
		example.free()
	quit()


## What the viewer's view of this name shows: indirect light alone on surfaces of albedo 0.5.
func _show_indirect(example: Node3D) -> void:
	example.lamp.light_cull_mask = 0
	for material: StandardMaterial3D in example.materials():
		material.albedo_color = Color(0.5, 0.5, 0.5).linear_to_srgb()
		material.albedo_texture = null
		material.vertex_color_use_as_albedo = false
