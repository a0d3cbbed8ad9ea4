extends SceneTree
## The reader against the golden files of formats/tests, whole and broken.
##     godot --headless --script res://tests/read.gd -- FOLDER

var _n_checks := 0
var _n_failed := 0


func _initialize() -> void:
	var folder := OS.get_cmdline_user_args()[0]
	_old(LocalprtBaked.open(folder.path_join("minimal_v1_2.lprt")))
	var golden := folder.path_join("minimal_v2_1.lprt")
	for name in ["minimal_v2.lprt", "minimal_v2_1.lprt"]:
		_known_values(LocalprtBaked.open(folder.path_join(name)))
	_is("version 2.1", LocalprtBaked.open(golden).version, Vector2i(2, 1))
	_is("sections of 2.1", LocalprtBaked.open(golden).kinds().size(), 22)
	_near_light(LocalprtBaked.open(golden))
	_parts(golden)
	_broken(golden)
	_missing()
	if _n_checks < 50:
		_n_failed += 1
		printerr("%d checks alone" % _n_checks)
	print("read: %d checks, %d failed" % [_n_checks, _n_failed])
	quit(1 if _n_failed else 0)


func _is(what: String, found: Variant, expected: Variant) -> void:
	_n_checks += 1
	if found != expected:
		_n_failed += 1
		printerr("%s: %s, not %s" % [what, found, expected])


func _old(baked: LocalprtBaked) -> void:
	_is("version 1 is refused with what to do", baked.error.contains("version 1.2: bake the scene again (rule 3)"), true)
	_is("with its name", baked.error.contains("minimal_v1_2.lprt"), true)


func _known_values(baked: LocalprtBaked) -> void:
	_is("no error", baked.error, "")
	_is("payloads", baked.check_payloads(), true)
	_is("tool_version", baked.tool_version, "0.1.0")
	_is("scene_path", baked.scene_path, "minimal.glb")
	_is("scene_hash", baked.scene_hash, PackedByteArray(range(32)))
	_is("maps", Vector2i(baked.lightmap_size, baked.direct_size), Vector2i(4, 8))
	_is("degrees", Vector3i(baked.probe_degree, baked.receiver_degree, baked.sky_degree), Vector3i(1, 0, 1))
	_is("functions", Vector3i(baked.n_sh, baked.n_k, baked.n_sky), Vector3i(4, 1, 4))
	_is("options", baked.options, "spacing = 1.0\n")
	_is("bounds", baked.bounds, AABB(Vector3(-1, 0, -1), Vector3(2, 2, 2)))
	_is("counts", [baked.n_probes, baked.n_rays, baked.n_receivers, baked.n_blocks], [2, 6, 3, 1])
	_is("probe 1", baked.section("PROB").to_float32_array().slice(4, 8), PackedFloat32Array([0.5, 1.0, 0.0, 2.5]))
	_is("direction 3", baked.section("RDIR").to_float32_array().slice(12, 16), PackedFloat32Array([0, -1, 0, 0]))
	_is("ray_uv 0", baked.section("RAUV").decode_u32(0), 0x80004000)
	_is("ray_level 2", baked.section("RALV")[2], LocalprtBaked.LEVEL_SKY)
	_is("receiver texels", baked.section("RTEX").to_int32_array(), PackedInt32Array([5, 6, 9]))
	_is("unseen", baked.section("RUNS").to_float32_array(), PackedFloat32Array([0.0, 0.125, 1.0]))
	_is("gutters", baked.section("GUTR").to_int32_array(), PackedInt32Array([4, 0, 7, 1]))
	_is("seams", baked.section("SEAM").to_int32_array(), PackedInt32Array([0, 2]))
	_is("report", baked.section("REPT").get_string_from_utf8(), '{"receivers":3}')
	_is("distance 0", baked.section("RADS").decode_half(0), 1.5)
	_is("levels", baked.n_levels(), 4)
	_is("cells of the volume", baked.section("VCEL").to_int32_array(), PackedInt32Array([4, 1]))
	var page := _page(baked)
	_is("cluster", page.clusters, PackedInt32Array([0, 3, 0, 2, 4, 1, 0, 0, 0]))
	_is("cluster of receivers", page.receiver_cluster, PackedInt32Array([0, 0, 0]))
	_is("cluster probes", page.probes.to_int32_array(), PackedInt32Array([0, 1]))
	_is("projection", [page.projection.size(), page.projection.decode_half(6)], [24, -0.125])
	_is("reconstruction", [0, 2, 4, 6].map(page.reconstruction.decode_half), [1.0, 0.75, -0.5, 0.0])


func _near_light(baked: LocalprtBaked) -> void:
	var page := _page(baked)
	_is("tiles", page.tiles.size(), 64)
	_is("tile 0", page.tiles.slice(0, 20).to_int32_array(), PackedInt32Array([0, 2, 0, 2, 0]))
	_is("scale of tile 0", page.tiles.decode_float(20), 0.5)
	_is("tile 1", page.tiles.slice(32, 52).to_int32_array(), PackedInt32Array([2, 1, 2, 0, 3]))
	_is("place of tile 1", page.tiles.decode_u32(56), 2)
	_is("scale of tile 1", page.tiles.decode_float(52), 0.25)
	_is("nodes", page.nodes.to_int32_array(), PackedInt32Array([13, 1 << 28 | 5]))
	_is("counts", page.counts, PackedByteArray([2, 1, 0]))
	_is("links", page.links, PackedByteArray([0, 1, 1]))
	_is("weights", [0, 1, 2].map(page.weights.decode_s8), [127, 64, -32])


func _page(baked: LocalprtBaked) -> LocalprtPage:
	var page := LocalprtPage.new()
	page.add(LocalprtBaked.Block.new(baked.section("BLOK"), 0, baked.n_k), baked.section("BDAT"), baked.n_sh)
	return page


## Every prefix, and one byte more, are refused.
func _parts(path: String) -> void:
	var bytes := FileAccess.get_file_as_bytes(path)
	var accepted := []
	for length in bytes.size():
		if LocalprtBaked.from_bytes(bytes.slice(0, length), "part").error.is_empty():
			accepted.append(length)
	_is("prefixes that are taken", accepted, [])
	bytes.append(0)
	_is("one byte more", LocalprtBaked.from_bytes(bytes, "more").error.is_empty(), false)


## A changed byte is found, by the rule that it breaks.
func _broken(path: String) -> void:
	var bytes := FileAccess.get_file_as_bytes(path)
	var unseen := []
	for at in bytes.size():
		var changed := bytes.duplicate()
		changed[at] ^= 0x55
		var baked := LocalprtBaked.from_bytes(changed, "changed")
		# The content hash is told to nobody; its bytes are of the header, whose checksum covers them.
		if baked.error.is_empty() and baked.check_payloads():
			unseen.append(at)
	_is("changed bytes that are not seen", unseen, [])
	for case in [["RALV", 0, 9, 44], ["RTEX", 0, 200, 45], ["GUTR", 4, 3, 60], ["BLOK", 0, 0, 50], ["BDAT", 8, 3, 57]]:
		var changed := bytes.duplicate()
		changed[LocalprtBaked.open(path)._sections[case[0]][0] + case[1]] = case[2]
		var error := LocalprtBaked.from_bytes(changed, "changed.lprt").error
		_is("%s says rule %d, and is: %s" % [case[0], case[3], error], error.ends_with("(rule %d)" % case[3]), true)
		_is("names the file", error.begins_with("changed.lprt: "), true)


func _missing() -> void:
	_is("a file that is not there", LocalprtBaked.open("/nowhere/hall.lprt").error.begins_with("/nowhere/hall.lprt: "), true)
	_is("surfaces that are not there", LocalprtSurfaces.open("/nowhere/hall.surfaces").error.contains("localprt-godot surfaces"), true)
