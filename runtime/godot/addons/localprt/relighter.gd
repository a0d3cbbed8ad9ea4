class_name LocalprtRelighter
extends RefCounted
## The passes in sequence, in the order of the runtime's relighter.rs. Every function is for the render thread.

const SHADERS := "shaders"
## Arrays of the transport are split into pages of whole blocks, none wider than what every device can bind.
const PAGE_BYTES := 1 << 27
const RAYS_PER_SEGMENT := 256
const PROBES_PER_GROUP := 4
const ROWS_PER_GROUP := 8
const LEVELS_PER_DISPATCH := 4
const OCCLUDER_BYTES := 64 * 80
## So that the light settles although the transport's gain can be above 1.
const FEEDBACK_ALBEDO_CAP := 0.95
## The engine's light maps are arrays of two layers or more; with directions, of four.
const ENGINE_LAYERS := 2
const ENGINE_DIRECTIONAL_LAYERS := 4

const FLOAT_4 := RenderingDevice.DATA_FORMAT_R32G32B32A32_SFLOAT
const HALF_4 := RenderingDevice.DATA_FORMAT_R16G16B16A16_SFLOAT
const MAP_USAGE := RenderingDevice.TEXTURE_USAGE_SAMPLING_BIT | RenderingDevice.TEXTURE_USAGE_STORAGE_BIT \
		| RenderingDevice.TEXTURE_USAGE_CAN_COPY_FROM_BIT | RenderingDevice.TEXTURE_USAGE_CAN_COPY_TO_BIT

## What went wrong; empty if nothing did.
var error := ""
## Gathers in a frame.
var bounces := 1
## The light map that the engine samples: E / pi, or with its direction.
var engine_map := RID()
## Whether it has directions.
var is_directional := false
## Gathers since the last reset.
var gathers := 0
## Bytes by purpose.
var memory: Dictionary:
	get:
		return _device.memory if _device else {}

var _device: LocalprtDevice
var _baked: LocalprtBaked
var _direct: LocalprtDirectLight
var _light_map := RID()
var _levels: Array[RID] = []
var _irradiance_map := RID()
var _radiance_map := RID()
var _probe_radiance := RID()
var _materials := RID()
var _n_materials := 1
var _pages: Array[Dictionary] = []

## Passes of a gather in order.
var _passes: Array[LocalprtDevice.Step] = []
var _gutters := LocalprtDevice.Step.new()
var _engine := LocalprtDevice.Step.new()
var _must_clear := true
var _lamps: Array[LocalprtLamp] = []
var _lamp_bytes := PackedByteArray()
var _lights_changed := false


## Uploads a file with its surfaces. All light is zero. Directions are made of files that have them, where they are wanted. False, and
## [member error], if it cannot.
func setup(baked: LocalprtBaked, surfaces: LocalprtSurfaces, shadow_map_size: int, directional: bool, folder: String) -> bool:
	_device = LocalprtDevice.new(folder)
	_baked = baked
	is_directional = directional and baked.n_k == 4
	for make: Callable in [
		_make_maps, _add_direct_lightmap.bind(surfaces, shadow_map_size), _add_mips, _add_probes, _upload_transport, _add_transport,
		_add_gutters, _add_engine_map,
	]:
		if _device.error.is_empty():
			make.call()
	error = _device.error
	if error:
		free_all()
	return error.is_empty()


## Lights for the next frames.
func set_lamps(lamps: Array[LocalprtLamp]) -> void:
	var bytes := PackedByteArray()
	for lamp in lamps:
		bytes.append_array(lamp.record(0, 0))
		bytes.append_array(PackedFloat32Array([lamp.inner_cone, lamp.outer_cone]).to_byte_array())
	if bytes != _lamp_bytes:
		_lights_changed = true
		_lamp_bytes = bytes
		_lamps = lamps


## Emission of each material, four numbers each: radiance and 1, or zeros for the scene's own.
func set_emission(rows: PackedFloat32Array) -> void:
	var table := PackedFloat32Array()
	table.resize(8 * _n_materials)
	for material in mini(rows.size() / 4, _n_materials):
		for at in 4:
			table[8 * material + 4 + at] = rows[4 * material + at]
	_device.rd.buffer_update(_materials, 0, 4 * table.size(), table.to_byte_array())


## Radiance of a sky that is the same everywhere.
func set_sky(radiance: Vector3) -> void:
	var has_sky := 0 if radiance == Vector3.ZERO else 1
	var sh := PackedFloat32Array()
	sh.resize(4 * _baked.n_sky)
	for band in 3:
		sh[band] = sqrt(4.0 * PI) * radiance[band]
	for page in _pages:
		_device.rd.buffer_update(page.sky, 0, 4 * sh.size(), sh.to_byte_array())
		_device.rd.buffer_update(page.params, 0, 16, PackedInt32Array([page.n_clusters, has_sky, 0, 0]).to_byte_array())


## Forgets all light.
func reset() -> void:
	_must_clear = true


## One frame: lights if they have changed, then gathers up to the map that the engine samples.
func frame() -> void:
	if _lights_changed:
		_direct.draw(_lamps)
		_lights_changed = false
	if _must_clear:
		for page in _pages:
			_device.rd.buffer_clear(page.coefficients, 0, page.coefficient_bytes)
		_device.run([_gutters])
		_must_clear = false
		gathers = 0
	for bounce in bounces:
		_device.run(_passes)
		gathers += 1
	_device.run([_engine])


## Irradiance of the last gather, W m^-2, `lightmap_size` texels per side, four f16 each; waits for the device.
func read_irradiance() -> PackedByteArray:
	return _device.rd.texture_get_data(_irradiance_map, 0)


## Gives everything back.
func free_all() -> void:
	if _device:
		_device.free_all()
	_device = null
	_direct = null
	engine_map = RID()


func _make_maps() -> void:
	var n_levels := 1
	while 1 << (n_levels - 1) < _baked.direct_size:
		n_levels += 1
	_light_map = _device.texture("light map", FLOAT_4, _baked.direct_size, 1, n_levels, MAP_USAGE)
	for level in n_levels:
		_levels.append(_device.slice(_light_map, 0, level))
	_irradiance_map = _device.texture("irradiance map", HALF_4, _baked.lightmap_size, 1, 1, MAP_USAGE)
	# Four coefficients; one texel where a file has none.
	var size := _baked.lightmap_size if _baked.n_k == 4 else 1
	_radiance_map = _device.texture("radiance map", HALF_4, size, 4, 1, MAP_USAGE)
	var layers := ENGINE_DIRECTIONAL_LAYERS if is_directional else ENGINE_LAYERS
	engine_map = _device.texture("engine's light map", HALF_4, _baked.lightmap_size, layers, 1, MAP_USAGE)


## Emission, direct light and the last gather to level 0 of the light map.
func _add_direct_lightmap(surfaces: LocalprtSurfaces, shadow_map_size: int) -> void:
	_direct = LocalprtDirectLight.new(_device, surfaces, shadow_map_size)
	var n_texels := surfaces.n_texels
	for texel in n_texels:
		_n_materials = maxi(_n_materials, surfaces.surface.decode_u16(12 * texel + 6) + 1)
	_materials = _device.zeros("materials", 32 * _n_materials)
	var has_emission := 0 if surfaces.emission.is_empty() else 1
	var params := PackedInt32Array([n_texels, _baked.direct_size, _baked.lightmap_size, has_emission]).to_byte_array()
	# No albedo of its own.
	params.append_array(PackedFloat32Array([FEEDBACK_ALBEDO_CAP, -1.0]).to_byte_array())
	params.append_array(PackedInt32Array([_n_materials, 0]).to_byte_array())
	var step := LocalprtDevice.Step.new()
	var pipeline := _device.pipeline("direct_lightmap")
	if n_texels > 0 and not _device.error:
		var uniforms := [_device.uniform(_device.uniform_buffer(params))]
		for bytes: PackedByteArray in [surfaces.index, surfaces.surface, surfaces.emission]:
			uniforms.append(_device.bound_bytes("surface texels", bytes))
		uniforms.append_array([
			_device.bound(_materials), _device.bound(_direct.irradiance), _device.sampled(_irradiance_map), _device.image(_levels[0]),
		])
		step.add(pipeline, [_device.uniform_set("direct_lightmap", 0, uniforms)], _device.groups(n_texels, 64))
	_passes.append(step)


func _add_mips() -> void:
	var pipeline := _device.pipeline("lightmap_mips")
	var spares: Array[RID] = []
	for spare in LEVELS_PER_DISPATCH:
		spares.append(_device.texture("light map", FLOAT_4, 1, 1, 1, RenderingDevice.TEXTURE_USAGE_STORAGE_BIT))
	for below in range(0, _levels.size() - 1, LEVELS_PER_DISPATCH):
		var n := mini(_levels.size() - 1 - below, LEVELS_PER_DISPATCH)
		var size := _baked.direct_size >> below
		var uniforms := [_device.uniform_words([size, n, 0, 0]), _device.sampled(_levels[below])]
		for above in LEVELS_PER_DISPATCH:
			uniforms.append(_device.image(_levels[below + 1 + above] if above < n else spares[above]))
		# A pass each: it reads what the one before wrote.
		var step := LocalprtDevice.Step.new()
		step.add(pipeline, [_device.uniform_set("lightmap_mips", 0, uniforms)], LocalprtDevice.square(size, 16))
		_passes.append(step)


func _add_probes() -> void:
	var n_sh := _baked.n_sh
	var n_segments := (_baked.n_rays + RAYS_PER_SEGMENT - 1) / RAYS_PER_SEGMENT
	var partial := _device.zeros("relight partial sums", _baked.n_probes * n_segments * n_sh * 16)
	_probe_radiance = _device.zeros("probe radiance", _baked.n_probes * n_sh * 16)
	if _baked.n_probes == 0:
		return
	# Of objects that block rays there are none, and no sky in probes: what is about them is not read.
	var nothing := _device.zeros("unused", 16)
	var occluders := PackedByteArray()
	occluders.resize(OCCLUDER_BYTES)
	var shader := "probe_relight_%d" % n_sh
	var pipeline := _device.pipeline(shader)
	var sum_shader := "sum_segments_%d" % n_sh
	var sum_pipeline := _device.pipeline(sum_shader)
	if _device.error:
		return
	var uniforms := [_device.uniform_words([_baked.n_probes, _baked.n_rays, n_segments, _baked.direct_size, _levels.size(), 0, 0, 0])]
	for kind in ["RASH", "RAUV", "RALV"]:
		uniforms.append(_device.bound_bytes("relight rays", _baked.section(kind)))
	uniforms.append_array([
		_device.sampled(_light_map), _device.bound(nothing), _device.bound(partial),
		_device.uniform(_device.uniform_buffer(occluders)), _device.bound(nothing), _device.bound(nothing), _device.bound(nothing),
	])
	var relight := LocalprtDevice.Step.new()
	var n_groups := (_baked.n_probes + PROBES_PER_GROUP - 1) / PROBES_PER_GROUP * n_segments
	relight.add(pipeline, [_device.uniform_set(shader, 0, uniforms)], _device.groups(n_groups, 1))
	var sum := LocalprtDevice.Step.new()
	uniforms = [_device.uniform_words([_baked.n_probes, n_segments, 0, 0]), _device.bound(partial), _device.bound(_probe_radiance)]
	sum.add(sum_pipeline, [_device.uniform_set(sum_shader, 0, uniforms)], _device.groups(_baked.n_probes * n_sh, 64))
	_passes.append_array([relight, sum])


## Blocks to pages.
func _upload_transport() -> void:
	var table := _baked.section("BLOK")
	var data := _baked.section("BDAT")
	var page := LocalprtPage.new()
	for number in _baked.n_blocks:
		var block := LocalprtBaked.Block.new(table, number, _baked.n_k)
		if page.n_receivers > 0 and page.widest_with(block) > PAGE_BYTES:
			_upload_page(page)
			page = LocalprtPage.new(page.first_receiver + page.n_receivers)
		page.add(block, data, _baked.n_sh)
	if page.n_receivers > 0:
		_upload_page(page)


func _upload_page(page: LocalprtPage) -> void:
	var coefficient_bytes := page.n_receivers * _baked.n_k * 16
	var params := PackedInt32Array([page.n_clusters, 0, 0, 0]).to_byte_array()
	var uploaded := {
		first_receiver = page.first_receiver, n_receivers = page.n_receivers, n_clusters = page.n_clusters, n_tiles = page.n_tiles,
		most_coefficients = page.most_coefficients,
		clusters = _device.storage("transport", page.clusters.to_byte_array()),
		probes = _device.storage("transport", page.probes),
		projection = _device.storage("transport", page.projection),
		receiver_cluster = _device.storage("transport", page.receiver_cluster.to_byte_array()),
		reconstruction = _device.storage("transport", page.reconstruction),
		lights = _device.zeros("cluster lights", page.n_lights * 16),
		coefficients = _device.zeros("coefficients", coefficient_bytes),
		coefficient_bytes = coefficient_bytes,
		sky = _device.zeros("sky", _baked.n_sky * 16),
		params = _device.uniform_buffer(params),
		near = [],
	}
	if page.n_tiles > 0:
		for bytes: PackedByteArray in [page.tiles, page.nodes, page.counts, page.links, page.weights]:
			uploaded.near.append(_device.storage("near light", bytes))
	_pages.append(uploaded)


func _add_transport() -> void:
	var projection := "cluster_projection_%d" % _baked.n_sh
	var reconstruction := "receiver_reconstruction_%d" % _baked.n_k
	var near := "near_light_%d" % _baked.n_k
	var pipelines := [projection, reconstruction, near].map(_device.pipeline)
	var steps: Array[LocalprtDevice.Step] = []
	for step in 3:
		steps.append(LocalprtDevice.Step.new())
	if _device.error:
		return
	for page in _pages:
		var uniforms := [_device.uniform(page.params)]
		for buffer: RID in [page.clusters, page.probes, page.projection, _probe_radiance, page.sky, page.lights]:
			uniforms.append(_device.bound(buffer))
		var groups := _device.groups(page.n_clusters, 1)
		groups.z = maxi((page.most_coefficients + ROWS_PER_GROUP - 1) / ROWS_PER_GROUP, 1)
		steps[0].add(pipelines[0], [_device.uniform_set(projection, 0, uniforms)], groups)
		uniforms = [_device.uniform_words([page.n_receivers, 0, 0, 0])]
		for buffer: RID in [page.clusters, page.receiver_cluster, page.reconstruction, page.lights, page.coefficients]:
			uniforms.append(_device.bound(buffer))
		steps[1].add(pipelines[1], [_device.uniform_set(reconstruction, 0, uniforms)], _device.groups(page.n_receivers * _baked.n_k, 64))
		if page.n_tiles > 0:
			uniforms = [_device.uniform_words([page.n_tiles, page.n_receivers, _baked.direct_size, 0])]
			for buffer: RID in page.near:
				uniforms.append(_device.bound(buffer))
			uniforms.append_array([_device.sampled(_light_map), _device.bound(page.coefficients)])
			steps[2].add(pipelines[2], [_device.uniform_set(near, 0, uniforms)], _device.groups(page.n_tiles, 1))
	_passes.append_array(steps)


## Texels of receivers and gutters, each once, from the receiver that is named last.
func _add_gutters() -> void:
	var shader := "gutter_dilation_%d" % _baked.n_k
	var pipeline := _device.pipeline(shader)
	if _device.error:
		return
	var receiver_of_texel := PackedInt32Array()
	receiver_of_texel.resize(_baked.lightmap_size * _baked.lightmap_size)
	receiver_of_texel.fill(-1)
	var texels := _baked.section("RTEX").to_int32_array()
	for receiver in texels.size():
		receiver_of_texel[texels[receiver]] = receiver
	var gutters := _baked.section("GUTR").to_int32_array()
	for at in range(0, gutters.size(), 2):
		receiver_of_texel[gutters[at]] = gutters[at + 1]
	for page in _pages:
		var fills := PackedInt32Array()
		for texel in receiver_of_texel.size():
			var receiver: int = receiver_of_texel[texel] - page.first_receiver
			if receiver >= 0 and receiver < page.n_receivers:
				fills.append(texel)
				fills.append(receiver)
		var normals := PackedByteArray()
		if _baked.n_k == 4:
			normals = _baked.section("RNRM").slice(12 * page.first_receiver, 12 * (page.first_receiver + page.n_receivers))
		var uniforms := [
			_device.uniform_words([fills.size() / 2, _baked.lightmap_size, 0, 0]), _device.bound_bytes("gutters", fills.to_byte_array()),
			_device.bound(page.coefficients), _device.bound_bytes("gutters", normals), _device.image(_irradiance_map),
			_device.image(_radiance_map),
		]
		_gutters.add(pipeline, [_device.uniform_set(shader, 0, uniforms)], _device.groups(fills.size() / 2, 64))
	_passes.append(_gutters)


func _add_engine_map() -> void:
	var shader := "engine_directional_map" if is_directional else "engine_map"
	var pipeline := _device.pipeline(shader)
	if _device.error:
		return
	var maps := [_device.sampled(_radiance_map if is_directional else _irradiance_map), _device.image(engine_map)]
	_engine.add(pipeline, [_device.uniform_set(shader, 0, maps)], LocalprtDevice.square(_baked.lightmap_size, 8))
