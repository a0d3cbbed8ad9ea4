class_name LocalprtDirectLight
extends RefCounted
## Shadow maps of lamps, and their light in every texel of the light map: the runtime's passes shadow_map and direct_irradiance.

## Views of a point light, which is what has to fit at once.
const LAYERS := 6
## A distance within rounding of a position, as the runtime's ROUNDING.
const ROUNDING := 2e-6
const BATCH_BYTES := 32

## One vec4f per covered texel, W m^-2.
var irradiance := RID()

var _device: LocalprtDevice
var _map_size := 0
var _low := Vector3.ZERO
var _high := Vector3.ZERO
var _n_texels := 0
var _maps := RID()
var _framebuffers: Array[RID] = []
var _opaque := {}
var _holes := {}
var _pipeline := RID()
var _texels := RID()
## Buffers of the lamps that there are: made anew when there are more.
var _lights := RID()
var _all_views := RID()
var _views: Array[RID] = []
var _view_sets: Array[RID] = []
var _batches: Array[RID] = []
var _batch_sets: Array[RID] = []
## Lamps, views and batches that they hold.
var _room := Vector3i.ZERO


func _init(device: LocalprtDevice, surfaces: LocalprtSurfaces, map_size: int) -> void:
	_device = device
	_map_size = clampi(map_size, 16, device.rd.limit_get(RenderingDevice.LIMIT_MAX_TEXTURE_SIZE_2D))
	_low = surfaces.low
	_high = surfaces.high
	_n_texels = surfaces.n_texels
	irradiance = device.zeros("direct irradiance", 16 * _n_texels)
	_make_maps(surfaces)
	_pipeline = device.pipeline("direct_irradiance")
	if not device.error:
		_texels = device.uniform_set("direct_irradiance", 1, [
			device.bound_bytes("texel geometry", surfaces.geometry), device.bound(irradiance),
			device.bound_bytes("texel geometry", surfaces.samples),
		])


func _make_maps(surfaces: LocalprtSurfaces) -> void:
	var rd := _device.rd
	var usage := RenderingDevice.TEXTURE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | RenderingDevice.TEXTURE_USAGE_SAMPLING_BIT
	_maps = _device.texture("shadow maps", RenderingDevice.DATA_FORMAT_D32_SFLOAT, _map_size, LAYERS, 1, usage)
	if _device.error:
		return
	for layer in LAYERS:
		_framebuffers.append(rd.framebuffer_create([_device.slice(_maps, layer, 0)]))
	var format := rd.framebuffer_get_format(_framebuffers[0])
	if not surfaces.indices.is_empty():
		var vertices := rd.vertex_format_create([_attribute(0, RenderingDevice.DATA_FORMAT_R32G32B32_SFLOAT, 12, 0)])
		var positions := _vertex_buffer(surfaces.positions)
		var n_indices := surfaces.indices.size() / 4
		var indices := rd.index_buffer_create(n_indices, RenderingDevice.INDEX_BUFFER_FORMAT_UINT32, surfaces.indices)
		_device.keep("shadow casters", surfaces.indices.size(), indices)
		_opaque = {
			pipeline = _device.depth_pipeline("opaque_vertex", "", format, vertices),
			vertices = rd.vertex_array_create(surfaces.positions.size() / 12, vertices, [positions]),
			indices = rd.index_array_create(indices, 0, n_indices),
		}
	if not surfaces.masked.is_empty():
		var width := LocalprtSurfaces.MASKED_VERTEX_BYTES
		var vertices := rd.vertex_format_create([
			_attribute(0, RenderingDevice.DATA_FORMAT_R32G32B32_SFLOAT, width, 0),
			_attribute(1, RenderingDevice.DATA_FORMAT_R32G32_SFLOAT, width, 12),
			_attribute(2, RenderingDevice.DATA_FORMAT_R32_SFLOAT, width, 20),
			_attribute(3, RenderingDevice.DATA_FORMAT_R32_UINT, width, 24),
		])
		var buffer := _vertex_buffer(surfaces.masked)
		_holes = {
			pipeline = _device.depth_pipeline("masked_vertex", "masked_fragment", format, vertices),
			vertices = rd.vertex_array_create(surfaces.masked.size() / width, vertices, [buffer, buffer, buffer, buffer]),
		}
		if not _device.error:
			_holes.masks = _device.uniform_set("masked_vertex", 1, [
				_device.bound_bytes("shadow casters", surfaces.masks), _device.bound_bytes("shadow casters", surfaces.mask_texels),
			])


func _vertex_buffer(bytes: PackedByteArray) -> RID:
	return _device.keep("shadow casters", bytes.size(), _device.rd.vertex_buffer_create(bytes.size(), bytes))


static func _attribute(location: int, format: RenderingDevice.DataFormat, stride: int, offset: int) -> RDVertexAttribute:
	var attribute := RDVertexAttribute.new()
	attribute.location = location
	attribute.format = format
	attribute.stride = stride
	attribute.offset = offset
	return attribute


## Shadow maps of as many lamps as fit, then their light in every texel; then the next ones.
func draw(lamps: Array[LocalprtLamp]) -> void:
	if _n_texels == 0:
		return
	var extent := _low.abs().max(_high.abs())
	var rounding := ROUNDING * (maxf(extent.x, maxf(extent.y, extent.z)) + (_high - _low).length())
	var lights := PackedByteArray()
	var views: Array[PackedByteArray] = []
	# First lamp, lamps, first view, views of each.
	var batches: Array[PackedInt32Array] = []
	for number in lamps.size():
		var own := lamps[number].views(_low, _high, rounding, _map_size)
		lights.append_array(lamps[number].record(views.size(), own.size()))
		if batches.is_empty() or batches[-1][3] + own.size() > LAYERS:
			batches.append(PackedInt32Array([number, 0, views.size(), 0]))
		var last := batches[-1]
		batches[-1] = PackedInt32Array([last[0], last[1] + 1, last[2], last[3] + own.size()])
		views.append_array(own)
	if batches.is_empty():
		_device.rd.buffer_clear(irradiance, 0, 16 * _n_texels)
		return
	_reserve(Vector3i(lamps.size(), views.size(), batches.size()))
	_write(lights, views, batches, rounding)
	for number in batches.size():
		for layer in batches[number][3]:
			_draw_view(layer, batches[number][2] + layer)
		var step := LocalprtDevice.Step.new()
		step.add(_pipeline, [_batch_sets[number], _texels], _device.groups(_n_texels, 64))
		_device.run([step])


func _write(lights: PackedByteArray, views: Array[PackedByteArray], batches: Array[PackedInt32Array], rounding: float) -> void:
	var rd := _device.rd
	rd.buffer_update(_lights, 0, lights.size(), lights)
	var all := PackedByteArray()
	for view in views.size():
		rd.buffer_update(_views[view], 0, LocalprtLamp.VIEW_BYTES, views[view])
		all.append_array(views[view])
	rd.buffer_update(_all_views, 0, all.size(), all)
	for number in batches.size():
		var batch := batches[number]
		var words := PackedInt32Array([batch[0], batch[1], batch[2], 1 if number == 0 else 0]).to_byte_array()
		words.append_array(PackedFloat32Array([rounding, 0.0, 0.0, 0.0]).to_byte_array())
		rd.buffer_update(_batches[number], 0, BATCH_BYTES, words)


func _draw_view(layer: int, view: int) -> void:
	var rd := _device.rd
	var list := rd.draw_list_begin(_framebuffers[layer], RenderingDevice.DRAW_CLEAR_DEPTH, PackedColorArray(), 0.0)
	if not _opaque.is_empty():
		rd.draw_list_bind_render_pipeline(list, _opaque.pipeline)
		rd.draw_list_bind_uniform_set(list, _view_sets[view], 0)
		rd.draw_list_bind_vertex_array(list, _opaque.vertices)
		rd.draw_list_bind_index_array(list, _opaque.indices)
		rd.draw_list_draw(list, true, 1)
	if not _holes.is_empty():
		rd.draw_list_bind_render_pipeline(list, _holes.pipeline)
		rd.draw_list_bind_uniform_set(list, _view_sets[view], 0)
		rd.draw_list_bind_uniform_set(list, _holes.masks, 1)
		rd.draw_list_bind_vertex_array(list, _holes.vertices)
		rd.draw_list_draw(list, false, 1)
	rd.draw_list_end()


## Buffers for so many lamps, views and batches. A draw reads view 0 of a buffer of its own: the engine's draws have no first instance.
func _reserve(needed: Vector3i) -> void:
	if needed == needed.min(_room):
		return
	if _room != Vector3i.ZERO:
		_device.release(_lights, "lights", LocalprtLamp.BYTES * _room.x)
		_device.release(_all_views, "lights", LocalprtLamp.VIEW_BYTES * _room.y)
		for view in _views:
			_device.release(view, "lights", LocalprtLamp.VIEW_BYTES)
		for batch in _batches:
			_device.release(batch, "parameters", BATCH_BYTES)
	for list: Array[RID] in [_views, _view_sets, _batches, _batch_sets]:
		list.clear()
	_room = needed.max(_room)
	_lights = _device.zeros("lights", LocalprtLamp.BYTES * _room.x)
	_all_views = _device.zeros("lights", LocalprtLamp.VIEW_BYTES * _room.y)
	var caster := "masked_vertex" if _opaque.is_empty() else "opaque_vertex"
	for view in _room.y:
		_views.append(_device.zeros("lights", LocalprtLamp.VIEW_BYTES))
		if not (_opaque.is_empty() and _holes.is_empty()):
			_view_sets.append(_device.uniform_set(caster, 0, [_device.bound(_views[view])]))
	var nothing := PackedByteArray()
	nothing.resize(BATCH_BYTES)
	for batch in _room.z:
		_batches.append(_device.uniform_buffer(nothing))
		_batch_sets.append(_device.uniform_set("direct_irradiance", 0, [
			_device.uniform(_batches[batch]), _device.bound(_lights), _device.bound(_all_views), _device.sampled(_maps),
		]))
