extends SceneTree
## So many frames with a moving lamp and a changing emission, and what memory they leave behind.
##     godot --resolution 96x72 --script res://tests/frames.gd -- N

## What is compiled and collected late is there before the first measure.
const WARM_UP := 100


func _initialize() -> void:
	var n := int(OS.get_cmdline_user_args()[0])
	var example: Node3D = (load("res://example.tscn") as PackedScene).instantiate()
	var localprt: Localprt = example.get_node("Hall/Localprt")
	# Of few texels, for many frames.
	localprt.file = "res://small.lprt"
	localprt.shadow_map_size = 256
	root.add_child(example)
	await localprt.loaded
	await _draw(example, 0, WARM_UP)
	var before := _memory(example)
	var gathers: int = localprt.relighter().gathers
	var started := Time.get_ticks_msec()
	await _draw(example, WARM_UP, n)
	var seconds := (Time.get_ticks_msec() - started) / 1000.0
	var after := _memory(example)
	print("%d frames in %.0f s; before %s; after %s" % [n, seconds, JSON.stringify(before), JSON.stringify(after)])
	var problems := PackedStringArray()
	if localprt.relighter().gathers - gathers != n:
		problems.append("%d gathers" % (localprt.relighter().gathers - gathers))
	for what in ["device", "objects", "orphans", "resources", "listed"]:
		if after[what] > before[what]:
			problems.append("%s was %s, is %s" % [what, before[what], after[what]])
	# Caches of the driver and of the allocator are less.
	if after.resident - before.resident > 4000 * n:
		problems.append("the process' memory was %d, is %d" % [before.resident, after.resident])
	# A byte a frame of each of a hundred objects would be seen.
	if after.engine - before.engine > 100 * n:
		problems.append("the engine's memory was %d, is %d" % [before.engine, after.engine])
	example.free()
	await process_frame
	await process_frame
	var left := RenderingServer.get_rendering_device().get_memory_usage(RenderingDevice.MEMORY_TOTAL)
	print("without the scene: device %d" % left)
	if left > before.device - before.listed:
		problems.append("unloading leaves %d bytes on the device, of %d with %d listed" % [left, before.device, before.listed])
	for problem in problems:
		printerr("frames leave memory behind: %s" % problem)
	quit(1 if problems else 0)


func _draw(example: Node3D, first: int, n: int) -> void:
	var red: StandardMaterial3D = example.material("red")
	red.emission_enabled = true
	for frame in range(first, first + n):
		example.lamp.position = Vector3(0.5 * cos(0.1 * frame), 1.2 + 0.3 * sin(0.07 * frame), 0.5 * sin(0.1 * frame))
		red.emission = Color(0.2 + 0.2 * sin(0.1 * frame), 0.0, 0.0).linear_to_srgb()
		await process_frame


func _memory(example: Node3D) -> Dictionary:
	var listed := 0
	for bytes: int in example.localprt.memory().values():
		listed += bytes
	# Files of the system have no length that they could be read by. Nothing where there are none.
	var status := []
	OS.execute("cat", ["/proc/%d/status" % OS.get_process_id()], status)
	var resident := 0
	for line: String in "".join(status).split("\n"):
		if line.begins_with("VmRSS:"):
			resident = 1024 * int(line)
	return {
		device = RenderingServer.get_rendering_device().get_memory_usage(RenderingDevice.MEMORY_TOTAL), listed = listed,
		engine = OS.get_static_memory_usage(), resident = resident, objects = int(Performance.get_monitor(Performance.OBJECT_COUNT)),
		orphans = int(Performance.get_monitor(Performance.OBJECT_ORPHAN_NODE_COUNT)),
		resources = int(Performance.get_monitor(Performance.OBJECT_RESOURCE_COUNT)),
	}
