class_name LocalprtDevice
extends RefCounted
## Buffers, textures, shaders and their sets on the engine's own RenderingDevice; all given back at once. For the render thread.

## What went wrong first; empty if nothing did.
var error := ""
## Bytes by purpose.
var memory := {}
var rd: RenderingDevice

var _folder := ""
var _shaders := {}
## Roots of everything that is made: what depends on them goes with them.
var _roots: Array[RID] = []


## With the folder of the add-on's shaders.
func _init(folder: String) -> void:
	_folder = folder
	rd = RenderingServer.get_rendering_device()
	if rd == null:
		fail("this renderer has no RenderingDevice: use Forward+ or Mobile")


## Keeps the first problem.
func fail(problem: String) -> void:
	if error.is_empty():
		error = problem


## Gives everything back.
func free_all() -> void:
	if rd == null:
		return
	for root in _roots:
		rd.free_rid(root)
	for shader: RID in _shaders.values():
		if shader.is_valid():
			rd.free_rid(shader)
	_roots.clear()
	_shaders.clear()
	memory.clear()


## Gives one buffer back that has been kept.
func release(buffer: RID, purpose: String, bytes: int) -> void:
	rd.free_rid(buffer)
	_roots.erase(buffer)
	memory[purpose] -= bytes


## A read-only storage buffer, at least 16 bytes long, of whole words.
func storage(purpose: String, bytes: PackedByteArray) -> RID:
	var size := maxi((bytes.size() + 3) / 4 * 4, 16)
	if size != bytes.size():
		bytes = bytes.duplicate()
		bytes.resize(size)
	return keep(purpose, size, rd.storage_buffer_create(size, bytes))


## A storage buffer of zeros.
func zeros(purpose: String, size: int) -> RID:
	var bytes := PackedByteArray()
	bytes.resize(size)
	return storage(purpose, bytes)


## A uniform buffer.
func uniform_buffer(bytes: PackedByteArray) -> RID:
	return keep("parameters", bytes.size(), rd.uniform_buffer_create(bytes.size(), bytes))


## Remembers a buffer of so many bytes.
func keep(purpose: String, bytes: int, buffer: RID) -> RID:
	if not buffer.is_valid():
		fail("%s: the device has no buffer of %d bytes" % [purpose, bytes])
		return buffer
	memory[purpose] = memory.get(purpose, 0) + bytes
	_roots.append(buffer)
	return buffer


## A square texture, zero where it can be cleared.
func texture(purpose: String, format: RenderingDevice.DataFormat, size: int, layers: int, levels: int, usage: int) -> RID:
	var wanted := RDTextureFormat.new()
	wanted.format = format
	wanted.width = size
	wanted.height = size
	wanted.array_layers = layers
	wanted.mipmaps = levels
	wanted.texture_type = RenderingDevice.TEXTURE_TYPE_2D_ARRAY if layers > 1 else RenderingDevice.TEXTURE_TYPE_2D
	wanted.usage_bits = usage
	var made := rd.texture_create(wanted, RDTextureView.new())
	if not made.is_valid():
		fail("%s: the device has no texture of %d x %d texels, %d layers" % [purpose, size, size, layers])
		return made
	if usage & RenderingDevice.TEXTURE_USAGE_CAN_COPY_TO_BIT:
		rd.texture_clear(made, Color(0, 0, 0, 0), 0, levels, 0, layers)
	_roots.append(made)
	var width := 16
	if format == RenderingDevice.DATA_FORMAT_D32_SFLOAT:
		width = 4
	elif format == RenderingDevice.DATA_FORMAT_R16G16B16A16_SFLOAT:
		width = 8
	for level in levels:
		memory[purpose] = memory.get(purpose, 0) + width * layers * (size >> level) * (size >> level)
	return made


## One level of one layer of a texture.
func slice(of_texture: RID, layer: int, level: int) -> RID:
	return rd.texture_create_shared_from_slice(RDTextureView.new(), of_texture, layer, level)


# Shaders.

## A compute pipeline of a shader by its name.
func pipeline(name: String) -> RID:
	if name not in _shaders:
		var code := RDShaderSPIRV.new()
		code.bytecode_compute = _code(name)
		_shaders[name] = rd.shader_create_from_spirv(code, "localprt.%s" % name)
	var shader: RID = _shaders[name]
	if not shader.is_valid():
		fail("%s: the device does not take this shader" % name)
		return RID()
	return rd.compute_pipeline_create(shader)


## A pipeline that draws depth, greater is nearer, both sides of triangles; its shader has the name of the vertex stage.
func depth_pipeline(vertex: String, fragment: String, framebuffer_format: int, vertices: int) -> RID:
	var code := RDShaderSPIRV.new()
	code.bytecode_vertex = _code(vertex)
	if fragment:
		code.bytecode_fragment = _code(fragment)
	_shaders[vertex] = rd.shader_create_from_spirv(code, "localprt.%s" % vertex)
	if not _shaders[vertex].is_valid():
		fail("%s: the device does not take this shader" % vertex)
		return RID()
	var depth := RDPipelineDepthStencilState.new()
	depth.enable_depth_test = true
	depth.enable_depth_write = true
	depth.depth_compare_operator = RenderingDevice.COMPARE_OP_GREATER
	return rd.render_pipeline_create(
			_shaders[vertex], framebuffer_format, vertices, RenderingDevice.RENDER_PRIMITIVE_TRIANGLES,
			RDPipelineRasterizationState.new(), RDPipelineMultisampleState.new(), depth, RDPipelineColorBlendState.new())


## Uniforms for bindings 0, 1, 2, ... of a shader whose pipeline has been made.
func uniform_set(shader: String, number: int, uniforms: Array) -> RID:
	for binding in uniforms.size():
		uniforms[binding].binding = binding
	return rd.uniform_set_create(uniforms, _shaders[shader], number) if _shaders[shader].is_valid() else RID()


func _code(name: String) -> PackedByteArray:
	var path := _folder.path_join(name + ".spv")
	var code := FileAccess.get_file_as_bytes(path)
	if code.is_empty():
		fail("%s: %s: scripts/godot.sh writes the add-on's shaders" % [path, error_string(FileAccess.get_open_error())])
	return code


# Uniforms.

func bound(buffer: RID) -> RDUniform:
	return _of_type(RenderingDevice.UNIFORM_TYPE_STORAGE_BUFFER, buffer)


func bound_bytes(purpose: String, bytes: PackedByteArray) -> RDUniform:
	return bound(storage(purpose, bytes))


func uniform(buffer: RID) -> RDUniform:
	return _of_type(RenderingDevice.UNIFORM_TYPE_UNIFORM_BUFFER, buffer)


func uniform_words(words: Array) -> RDUniform:
	return uniform(uniform_buffer(PackedInt32Array(words).to_byte_array()))


func sampled(of_texture: RID) -> RDUniform:
	return _of_type(RenderingDevice.UNIFORM_TYPE_TEXTURE, of_texture)


func image(of_texture: RID) -> RDUniform:
	return _of_type(RenderingDevice.UNIFORM_TYPE_IMAGE, of_texture)


static func _of_type(type: RenderingDevice.UniformType, rid: RID) -> RDUniform:
	var made := RDUniform.new()
	made.uniform_type = type
	made.add_id(rid)
	return made


# Dispatches.

## Workgroups for so many invocations, in rows of what the device allows.
func groups(n: int, group_size: int) -> Vector3i:
	var n_groups := (n + group_size - 1) / group_size
	var limit := rd.limit_get(RenderingDevice.LIMIT_MAX_COMPUTE_WORKGROUP_COUNT_X)
	var y := maxi((n_groups + limit - 1) / limit, 1)
	return Vector3i(maxi((n_groups + y - 1) / y, 1), y, 1)


static func square(size: int, group_size: int) -> Vector3i:
	var n := (size + group_size - 1) / group_size
	return Vector3i(n, n, 1)


## Records passes: each waits for the one before.
func run(steps: Array[Step]) -> void:
	var list := rd.compute_list_begin()
	for step in steps:
		for dispatch in step.dispatches:
			rd.compute_list_bind_compute_pipeline(list, dispatch.pipeline)
			for number in dispatch.sets.size():
				rd.compute_list_bind_uniform_set(list, dispatch.sets[number], number)
			rd.compute_list_dispatch(list, dispatch.groups.x, dispatch.groups.y, dispatch.groups.z)
		rd.compute_list_add_barrier(list)
	rd.compute_list_end()


class Dispatch:
	var pipeline: RID
	var sets: Array[RID]
	var groups: Vector3i


## Dispatches of one pass, which do not wait for each other.
class Step:
	var dispatches: Array[Dispatch] = []

	func add(pipeline: RID, sets: Array[RID], groups: Vector3i) -> void:
		var dispatch := Dispatch.new()
		dispatch.pipeline = pipeline
		dispatch.sets = sets
		dispatch.groups = groups
		dispatches.append(dispatch)
