extends SceneTree
## The passes on the engine's device: the irradiance map of every case after eight gathers against that of `precompute relight`.
##     godot --script res://tests/relight.gd -- FOLDER

const Cases := preload("res://tests/cases.gd")
const GATHERS := 8
## Of the root mean square: maps are f16, 2^-11 of a value, and what a texel at the edge of a shadow reads of a rounded shadow map.
const ALLOWED := 2e-3

var _n_failed := 0


func _initialize() -> void:
	var folder := OS.get_cmdline_user_args()[0]
	var maps := {}
	for name in Cases.NAMES:
		var example: Node3D = (load("res://example.tscn") as PackedScene).instantiate()
		var localprt: Localprt = example.get_node("Hall/Localprt")
		localprt.automatic = false
		localprt.bounces = GATHERS
		root.add_child(example)
		await localprt.loaded
		_check(localprt.error == "", "%s: %s" % [name, localprt.error])
		Cases.apply(name, example)
		localprt.reset()
		localprt.update()
		await process_frame
		_check(localprt.relighter().gathers == GATHERS, "%s: %d gathers" % [name, localprt.relighter().gathers])
		maps[name] = localprt.relighter().read_irradiance()
		var expected := Image.load_from_file(folder.path_join(name + ".exr"))
		var found := _error(maps[name], expected)
		_check(found < ALLOWED, "%s: more than %s" % [name, ALLOWED])
		print("%s: root mean square error %.6f of the root mean square" % [name, found])
		if name == "lamp":
			print("bytes: ", JSON.stringify(localprt.memory()))
		else:
			# A comparison that finds no difference between two lights would find none between right and wrong.
			var other := _error(maps["lamp"], expected)
			_check(other > 0.05, "%s: the lamp's light is as near: %s" % [name, other])
		Cases.restore(example)
		example.free()
	print("relight: %s" % ("failed" if _n_failed else "passed"))
	quit(1 if _n_failed else 0)


func _check(is_right: bool, problem: String) -> void:
	if not is_right:
		_n_failed += 1
		printerr(problem)


## Of texels that hold something in either.
static func _error(map: PackedByteArray, expected: Image) -> float:
	var squares := 0.0
	var sum := 0.0
	for y in expected.get_height():
		for x in expected.get_width():
			var color := expected.get_pixel(x, y)
			var at := 8 * (y * expected.get_width() + x)
			for band in 3:
				squares += (map.decode_half(at + 2 * band) - color[band]) ** 2
				sum += color[band] ** 2
	return sqrt(squares / sum) if sum > 0.0 else INF
