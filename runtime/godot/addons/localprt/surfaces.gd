class_name LocalprtSurfaces
extends RefCounted
## Surfaces of a baked scene, as `localprt-godot surfaces` writes them: texels of the light map with their samples, and shadow casters.

const MAGIC: PackedByteArray = [0x89, 0x4c, 0x50, 0x53, 0x0d, 0x0a, 0x1a, 0x0a]
const VERSION := 1
const HEADER := 56
const N_ARRAYS := 11
## Of an array: what a buffer can be.
const MOST_BYTES := 1 << 31
## Bytes of an element of each array.
const WIDTHS: PackedInt32Array = [1, 4, 12, 12, 40, 16, 12, 4, 28, 4, 4]
const BOUNDS_BYTES := 24
const MASK_BYTES := 28
const MASKED_VERTEX_BYTES := 28

var error := ""
var direct_size := 0
## Of the baked file that these belong to.
var content_hash := PackedByteArray()
## Names of the scene's materials.
var materials := PackedStringArray()
## Arrays of the texels, one element each: place, surface, emission (or none), geometry.
var index := PackedByteArray()
var surface := PackedByteArray()
var emission := PackedByteArray()
var geometry := PackedByteArray()
var samples := PackedByteArray()
## Shadow casters: vertices, triangles of them, and vertices of triangles with holes.
var positions := PackedByteArray()
var indices := PackedByteArray()
var masked := PackedByteArray()
var masks := PackedByteArray()
var mask_texels := PackedByteArray()
## Box around the casters.
var low := Vector3.ZERO
var high := Vector3.ZERO

var n_texels: int:
	get:
		return index.size() / 4


## Reads a file. What is wrong with it is in [member error].
static func open(path: String) -> LocalprtSurfaces:
	var surfaces := LocalprtSurfaces.new()
	var bytes := FileAccess.get_file_as_bytes(path)
	if bytes.is_empty() and FileAccess.get_open_error() != OK:
		surfaces.error = "%s: %s: write it with `localprt-godot surfaces FILE.lprt`" % [path, error_string(FileAccess.get_open_error())]
	else:
		var problem := surfaces._read(bytes)
		surfaces.error = "%s: %s" % [path, problem] if problem else ""
	return surfaces


func _read(bytes: PackedByteArray) -> String:
	if bytes.size() < HEADER + 16 * N_ARRAYS or bytes.slice(0, 8) != MAGIC:
		return "no file of surfaces"
	if bytes.decode_u32(8) != VERSION or bytes.decode_u32(48) != N_ARRAYS:
		return "version %d: write it again" % bytes.decode_u32(8)
	direct_size = bytes.decode_u32(12)
	content_hash = bytes.slice(16, 48)
	var arrays: Array[PackedByteArray] = []
	var at := HEADER + 16 * N_ARRAYS
	for array in N_ARRAYS:
		var length := bytes.decode_u64(HEADER + 16 * array)
		var packed := bytes.decode_u64(HEADER + 16 * array + 8)
		if packed < 0 or packed > bytes.size() - at:
			return "array %d ends beyond the file" % array
		if length < 0 or length > MOST_BYTES or length % WIDTHS[array] != 0:
			return "array %d: %d bytes" % [array, length]
		arrays.append(bytes.slice(at, at + packed).decompress(length, FileAccess.COMPRESSION_DEFLATE) if length > 0 else PackedByteArray())
		if arrays[-1].size() != length:
			return "array %d is broken" % array
		at += packed
	if at != bytes.size():
		return "%d bytes too many" % (bytes.size() - at)
	materials = _names(arrays[0])
	index = arrays[1]
	surface = arrays[2]
	emission = arrays[3]
	geometry = arrays[4]
	samples = arrays[5]
	positions = arrays[6]
	indices = arrays[7]
	masked = arrays[8]
	if arrays[9].size() < BOUNDS_BYTES:
		return "no bounds"
	low = Vector3(arrays[9].decode_float(0), arrays[9].decode_float(4), arrays[9].decode_float(8))
	high = Vector3(arrays[9].decode_float(12), arrays[9].decode_float(16), arrays[9].decode_float(20))
	masks = arrays[9].slice(BOUNDS_BYTES)
	mask_texels = arrays[10]
	return _problem()


## What would let a shader read what is not there.
func _problem() -> String:
	if surface.size() != 12 * n_texels or geometry.size() != 40 * n_texels or emission.size() not in [0, 12 * n_texels]:
		return "arrays of texels differ in length"
	if not LocalprtBaked._is_below(index.to_int32_array(), direct_size * direct_size):
		return "a texel is beyond the map's"
	var end := 0
	for texel in n_texels:
		var own_end := geometry.decode_u32(40 * texel + 36)
		if own_end < end:
			return "texel %d: its samples end before they begin" % texel
		end = own_end
	if end != samples.size() / 16:
		return "samples are not those of the texels"
	if not LocalprtBaked._is_below(indices.to_int32_array(), positions.size() / 12) or indices.size() % 12 != 0:
		return "a triangle has a vertex that there is not"
	if masked.size() % (3 * MASKED_VERTEX_BYTES) != 0 or masks.size() % MASK_BYTES != 0:
		return "masks of triangles"
	for mask in masks.size() / MASK_BYTES:
		var at := MASK_BYTES * mask
		var n := masks.decode_u32(at + 4) * masks.decode_u32(at + 8)
		if n < 1 or masks.decode_u32(at) + n > mask_texels.size():
			return "mask %d: its image ends beyond the file" % mask
	for vertex in masked.size() / MASKED_VERTEX_BYTES:
		if masked.decode_u32(MASKED_VERTEX_BYTES * vertex + 24) >= masks.size() / MASK_BYTES:
			return "a triangle has a mask that there is not"
	return ""


## Strings that end with 0.
static func _names(bytes: PackedByteArray) -> PackedStringArray:
	var names := PackedStringArray()
	var first := 0
	for at in bytes.size():
		if bytes[at] == 0:
			names.append(bytes.slice(first, at).get_string_from_utf8())
			first = at + 1
	return names
